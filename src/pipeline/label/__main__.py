"""Label the points of a fused cloud: container, rim, handle; initial estimate, learnt from the annotated source alone."""

from pathlib import Path

from pipeline import command
from pipeline.artefacts import points, read_json, read_table, write_table


def main() -> None:
    """Read the source's cloud and annotation and a target's cloud; write the target's labels."""
    parser = command.parser(__doc__)
    for option in ("--source-cloud", "--source-fusion", "--annotation", "--cloud", "--labels"):
        parser.add_argument(option, type=Path, required=True)
    parser.add_argument(
        "--neighbours", type=int, nargs="+", default=[60, 120, 300], help="points a neighbourhood"
    )
    parser.add_argument(
        "--ridge", type=float, default=300.0, help="weight of the squared standardised weights"
    )
    options = parser.parse_args()

    import numpy as np

    from pipeline.geometry import frames
    from pipeline.label.classifier import PARTS, train, transfer_annotation
    from pipeline.label.features import neighbourhood_features

    annotation = read_table(options.annotation, "annotation")
    source = points(read_table(options.source_cloud, "cloud"))
    T_object_world = np.array(read_json(options.source_fusion)["T_object_world"])
    parts = transfer_annotation(
        frames.apply(T_object_world, points(annotation)),
        annotation[list(PARTS)].to_numpy(bool),
        source,
        name=str(options.annotation),
    )
    cloud = read_table(options.cloud, "cloud")
    if options.cloud == options.source_cloud:
        probabilities = parts.astype(float)
    else:
        classifier = train(neighbourhood_features(source, options.neighbours), parts, options.ridge)
        probabilities = classifier.probabilities(neighbourhood_features(points(cloud), options.neighbours))
    for part, probability in zip(PARTS, probabilities.T, strict=True):
        cloud[f"p_{part}"], cloud[part] = probability, probability > 0.5
    write_table(options.labels, cloud, "labels")


if __name__ == "__main__":
    command.run(main)
