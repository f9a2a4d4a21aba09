"""Draw every warped parameter on its object, and set it against known values; three kinds of volume side by side."""

from pathlib import Path
from typing import TYPE_CHECKING

from pipeline import command
from pipeline.artefacts import points, read_arrays, read_json, read_table, write_json

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.report.parameters_page import Drawn

MAPPINGS = ("label_mapping", "point_mapping")


def main() -> None:
    """Read parameters, clouds, containers and errors of all objects; write the pages and the volumes."""
    parser = command.parser(__doc__)
    parser.add_argument("--uncertainties", type=Path, required=True, help="the table of all objects")
    parser.add_argument("--label-mappings", type=Path, nargs="+", required=True, help="one table an object")
    parser.add_argument("--containers", type=Path, nargs="+", required=True, help="same order")
    parser.add_argument("--accuracy", type=Path, nargs="*", default=[], help="demonstration objects' errors")
    parser.add_argument("--page", type=Path, required=True)
    parser.add_argument("--numbers", type=Path, required=True)
    options = parser.parse_args()

    from pipeline.report.parameters_page import drawings
    from pipeline.report.parameters_table import table
    from pipeline.report.style import save
    from pipeline.report.volumes import biases, comparison, volumes

    listed = read_table(options.uncertainties, "uncertainties")
    errors = {path.stem: read_json(path) for path in options.accuracy}
    containers = {path.stem: read_arrays(path) for path in options.containers}
    drawn = [_drawn(path, listed) for path in options.label_mappings]
    found = volumes(listed, containers, errors)
    save([drawings(drawn), comparison(found, drawn, containers), *table(listed, errors)], options.page)
    write_json(options.numbers, biases(found))


def _drawn(path: Path, listed: "pd.DataFrame") -> "Drawn":
    from pipeline.report.parameters_page import Drawn

    name, mapped = path.parent.name, read_table(path, "mapping")
    own = listed[(listed["object"] == name) & (listed["mapping"] == "label_mapping")].set_index("parameter")
    container = mapped["container"].to_numpy(bool)
    return Drawn(name, points(mapped), container, own["value"].to_dict(), own["std"].to_dict())


if __name__ == "__main__":
    command.run(main)
