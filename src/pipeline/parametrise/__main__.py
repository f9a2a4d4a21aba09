"""Read the warped parameters of an object off its warped clouds."""

from pathlib import Path
from typing import Any

from pipeline import command
from pipeline.artefacts import points, read_table, write_table

# The paper's, and the capacity: what later stages use.
PAPER = (
    *("opening_m", "lip_m", "radius_m", "volume_m3", "height_m", "tilt_reference_rad"),
    "capacity_m3",
)


def main() -> None:
    """Read both mappings; write one row of parameters and the rim's tilt references for each."""
    parser = command.parser(__doc__)
    parser.add_argument("--object", required=True, help="name of the object")
    for option in ("--point-mapping", "--label-mapping", "--parameters", "--tilt-references"):
        parser.add_argument(option, type=Path, required=True)
    parser.add_argument("--hull-points", type=int, default=8000, help="points that fill the hull")
    options = parser.parse_args()

    import pandas as pd

    from pipeline.parametrise import cloud
    from pipeline.parametrise.parameters import evaluate, numbers

    mappings = {
        "point_mapping": read_table(options.point_mapping, "mapping"),
        "label_mapping": read_table(options.label_mapping, "mapping"),
    }
    centre_m = points(mappings["label_mapping"]).mean(axis=0)
    rows, references = [], []
    for mapping, table in mappings.items():
        head = {"object": options.object, "mapping": mapping}
        pieces = cloud.warped(table, name=options.object).pieces(options.hull_points)
        values = evaluate([*PAPER, "tilt_references_rad"], pieces)
        rows.append({**head, **numbers(PAPER, values)})
        references.append(pd.DataFrame({**head, **_references(values)}))
    centre = dict(zip(("centre_x_m", "centre_y_m", "centre_z_m"), centre_m, strict=True))
    write_table(options.parameters, pd.DataFrame(rows).assign(**centre), "parameters")
    write_table(options.tilt_references, pd.concat(references), "tilt_references")


def _references(values: dict[str, Any]) -> dict[str, Any]:
    return {
        **dict(zip(("x_m", "y_m", "z_m"), values["rim_m"].T, strict=True)),
        "tilt_reference_rad": values["tilt_references_rad"],
    }


if __name__ == "__main__":
    command.run(main)
