"""Join the objects' tables into one."""

from pathlib import Path

from pipeline import command
from pipeline.artefacts import read_table, write_table


def main() -> None:
    """Write the rows of all given tables, in the order given, as one table."""
    parser = command.parser(__doc__)
    parser.add_argument("--tables", type=Path, nargs="+", required=True)
    parser.add_argument(
        "--table",
        choices=["parameters", "tilt_references", "uncertainties"],
        required=True,
        help="what they are",
    )
    parser.add_argument("--output", type=Path, required=True)
    options = parser.parse_args()

    import pandas as pd

    write_table(
        options.output, pd.concat([read_table(path, options.table) for path in options.tables]), options.table
    )


if __name__ == "__main__":
    command.run(main)
