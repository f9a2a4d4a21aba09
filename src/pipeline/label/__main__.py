"""Label the points of a fused cloud: container, rim, handle; initial estimate, learnt from the annotated source alone."""

from pathlib import Path

from pipeline import command
from pipeline.artefacts import points, read_columns, read_json, write_table


def main() -> None:
    """Read a cloud and what was learnt (of the source: its annotation); write the cloud's labels."""
    parser = command.parser(__doc__)
    for option in (
        "--source-cloud",
        "--source-fusion",
        "--annotation",
        "--classifier",
        "--cloud",
        "--labels",
    ):
        parser.add_argument(option, type=Path, required=True)
    options = parser.parse_args()

    import numpy as np

    from pipeline.label.classifier import PARTS, PartClassifier
    from pipeline.label.features import neighbourhood_features

    cloud = read_columns(options.cloud, "cloud")
    if options.cloud == options.source_cloud:
        from pipeline.label.annotation import source_parts

        parts = source_parts(options.annotation, options.source_fusion, points(cloud))
        probabilities = parts.astype(float)
    else:
        learnt = read_json(options.classifier)
        classifier = PartClassifier(np.array(learnt["weights"]), np.array(learnt["offsets"]))
        probabilities = classifier.probabilities(neighbourhood_features(points(cloud), learnt["neighbours"]))
    for part, probability in zip(PARTS, probabilities.T, strict=True):
        cloud[f"p_{part}"], cloud[part] = probability, probability > 0.5
    write_table(options.labels, cloud, "labels")


if __name__ == "__main__":
    command.run(main)
