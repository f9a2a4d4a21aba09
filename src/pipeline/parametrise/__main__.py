"""Read the warped parameters of an object off its warped clouds."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline import command
from pipeline.artefacts import normals, points, read_table, write_table
from pipeline.errors import PipelineError

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

SCALARS = ("radius_m", "volume_m3", "height_m", "tilt_reference_rad", "capacity_m3")


def main() -> None:
    """Read both mappings; write one row of parameters and the rim's tilt references for each."""
    parser = command.parser(__doc__)
    parser.add_argument("--object", required=True, help="name of the object")
    for option in ("--point-mapping", "--label-mapping", "--parameters", "--tilt-references"):
        parser.add_argument(option, type=Path, required=True)
    parser.add_argument("--hull-points", type=int, default=20000, help="points that fill the hull")
    options = parser.parse_args()

    import pandas as pd

    mappings = {
        "point_mapping": read_table(options.point_mapping, "mapping"),
        "label_mapping": read_table(options.label_mapping, "mapping"),
    }
    centre = points(mappings["label_mapping"]).mean(axis=0)
    rows, references = [], []
    for mapping, table in mappings.items():
        head = {"object": options.object, "mapping": mapping}
        values = _parameters(options.object, table, options.hull_points)
        rows.append({**head, **_row(values), **_vector("centre", centre)})
        references.append(pd.DataFrame({**head, **_references(values)}))
    write_table(options.parameters, pd.DataFrame(rows), "parameters")
    write_table(options.tilt_references, pd.concat(references), "tilt_references")


def _parameters(name: str, table: "pd.DataFrame", hull_points: int) -> dict[str, Any]:
    from pipeline.parametrise.parameters import evaluate

    table = table[table["valid"]]
    container, rim = table[table["container"]], table[table["rim"]]
    if min(len(container), len(rim)) < 20:
        raise PipelineError(
            f"{name}: expected a container and a rim after warping, found {len(container)} and {len(rim)} points; "
            "look at the scan and the initial labels"
        )
    pieces = {
        "points_m": points(table),
        "container_m": points(container),
        "container_normals": normals(container),
        "container_area_m2": container["area_m2"].to_numpy(),
        "rim_m": points(rim),
        "hull_points": hull_points,
    }
    return evaluate([*SCALARS, "opening_m", "lip_m", "tilt_references_rad"], pieces)


def _row(values: dict[str, Any]) -> dict[str, Any]:
    scalars = {name: values[name] for name in SCALARS}
    return {**scalars, **_vector("opening", values["opening_m"]), **_vector("lip", values["lip_m"])}


def _references(values: dict[str, Any]) -> dict[str, Any]:
    rim_m = values["rim_m"]
    return {
        **dict(zip(("x_m", "y_m", "z_m"), rim_m.T, strict=True)),
        "tilt_reference_rad": values["tilt_references_rad"],
    }


def _vector(name: str, vector_m: "np.ndarray") -> dict[str, float]:
    return {f"{name}_{axis}_m": float(value) for axis, value in zip("xyz", vector_m, strict=True)}


if __name__ == "__main__":
    command.run(main)
