"""Learn from the annotated source how the parts of a container look: one logistic regression a part."""

from pathlib import Path

import numpy as np

from pipeline import command
from pipeline.artefacts import points, read_columns, write_json
from pipeline.label.annotation import source_parts
from pipeline.label.classifier import train
from pipeline.label.features import neighbourhood_features


def main() -> None:
    """Read the source's cloud and annotation; write the classifier, JSON."""
    parser = command.parser(__doc__)
    for option in ("--source-cloud", "--source-fusion", "--annotation", "--classifier"):
        parser.add_argument(option, type=Path, required=True)
    parser.add_argument(
        "--neighbours", type=int, nargs="+", default=[60, 120, 300], help="points a neighbourhood"
    )
    parser.add_argument(
        "--ridge", type=float, default=300.0, help="weight of the squared standardised weights"
    )
    options = parser.parse_args()

    source_m = points(read_columns(options.source_cloud, "cloud"))
    parts = source_parts(options.annotation, options.source_fusion, source_m)
    learnt = train(neighbourhood_features(source_m, options.neighbours), np.asarray(parts), options.ridge)
    numbers = {"weights": learnt.weights.tolist(), "offsets": learnt.offsets.tolist()}
    write_json(options.classifier, {"neighbours": options.neighbours, **numbers})


if __name__ == "__main__":
    command.run(main)
