"""Labels of an object that becomes a source itself: those that a warp mapped onto it, in place of the first estimate."""

from pathlib import Path

from pipeline import command
from pipeline.artefacts import read_table, write_table

PARTS = ["container", "rim", "handle"]


def main() -> None:
    """Read an object's first estimate and the label mapping onto it; write its labels."""
    parser = command.parser(__doc__)
    for option in ("--estimate", "--label-mapping", "--labels"):
        parser.add_argument(option, type=Path, required=True)
    options = parser.parse_args()

    labels, mapping = read_table(options.estimate, "labels"), read_table(options.label_mapping, "mapping")
    mapped = mapping[mapping["valid"]].set_index("target_index")
    for part in PARTS:
        labels.loc[mapped.index, part] = mapped[part]
        labels[f"p_{part}"] = labels[part].astype(float)
    write_table(options.labels, labels, "labels")


if __name__ == "__main__":
    command.run(main)
