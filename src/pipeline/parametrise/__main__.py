"""Read the warped parameters of an object off its warped clouds."""

from pathlib import Path
from typing import Any

from pipeline import command
from pipeline.artefacts import points, read_columns, write_table
from pipeline.columns import Columns
from pipeline.errors import PipelineError

# The paper's, and what later stages use or compare beside them.
WRITTEN = (
    *("opening_m", "lip_m", "radius_m", "volume_m3", "height_m", "tilt_reference_rad"),
    *("capacity_m3", "tilt_reference_cavity_rad", "wall_m"),
)
# Where the mappings differ by more, one of them at least is wrong: with the demonstration objects they are within 5 %.
ALIKE = 0.1
COMPARED = {
    "radius": ("radius_m", 1e3, "mm"),
    "hull volume": ("volume_m3", 1e6, "ml"),
    "capacity": ("capacity_m3", 1e6, "ml"),
}
ALONG_RIM = ("x_m", "y_m", "z_m", "tilt_reference_rad")


def main() -> None:
    """Read both mappings; write one row of parameters and the rim's tilt references for each."""
    parser = command.parser(__doc__)
    parser.add_argument("--object", required=True, help="name of the object")
    parser.add_argument("--source", default="the source", help="name of what was warped to it")
    for option in ("--point-mapping", "--label-mapping", "--parameters", "--tilt-references"):
        parser.add_argument(option, type=Path, required=True)
    parser.add_argument("--hull-points", type=int, default=8000, help="points that fill the hull")
    parser.add_argument(
        "--allow-missing",
        action="store_true",
        help="where a mapping has no container or rim, write no numbers",
    )
    options = parser.parse_args()

    import numpy as np

    mappings = {
        "point_mapping": read_columns(options.point_mapping, "mapping"),
        "label_mapping": read_columns(options.label_mapping, "mapping"),
    }
    centre_m = points(mappings["label_mapping"]).mean(axis=0)
    centre = dict(zip(("centre_x_m", "centre_y_m", "centre_z_m"), centre_m, strict=True))
    rows, references = [], []
    for mapping, table in mappings.items():
        head = {"object": options.object, "mapping": mapping}
        try:
            values, along_rim = _read_off(table, options.object, options.hull_points)
        except PipelineError:
            if not options.allow_missing:
                raise
            values, along_rim = _nothing()
        rows.append({**head, **values, **centre})
        words = {name: [word] * len(along_rim["x_m"]) for name, word in head.items()}
        references.append({**along_rim, **words})
    complaint = disagreement(rows[0], rows[1], options.source)
    if complaint:
        command.say(f"{options.object}: {complaint}")
    parameters = {column: [row[column] for row in rows] for column in rows[0]}
    write_table(options.parameters, parameters, "parameters")
    together = {column: np.concatenate([some[column] for some in references]) for column in references[0]}
    write_table(options.tilt_references, together, "tilt_references")


def disagreement(point: dict[str, Any], label: dict[str, Any], source: str) -> str:
    """Return what a user should know of the parameters of both mappings: on what they do not agree; nothing, where they do."""
    differ = [
        f"{what} {point[key] * scale:.0f} and {label[key] * scale:.0f} {unit}"
        for what, (key, scale, unit) in COMPARED.items()
        if abs(point[key] - label[key]) > ALIKE * max(point[key], label[key])
    ]
    if not differ:
        return ""
    return (
        f"expected point and label mapping to agree within {ALIKE:.0%}, found {', '.join(differ)}: perhaps it has little of the "
        f"shape of {source}; label mapping is then the nearer, or choose another source"
    )


def _read_off(table: Columns, name: str, hull_points: int) -> tuple[dict[str, float], dict[str, Any]]:
    """Return the parameters of a mapping, and the columns of the tilt references along its rim."""
    from pipeline.parametrise import cloud
    from pipeline.parametrise.parameters import evaluate, numbers

    pieces = cloud.warped(table, name=name).pieces(hull_points)
    values = evaluate([*WRITTEN, "tilt_references_rad"], pieces)
    columns = dict(zip(ALONG_RIM, (*values["rim_m"].T, values["tilt_references_rad"]), strict=True))
    return numbers(WRITTEN, values), columns


def _nothing() -> tuple[dict[str, float], dict[str, Any]]:
    import numpy as np

    from pipeline.parametrise.parameters import known

    columns = [column for found in known(WRITTEN) for column in found.columns]
    return dict.fromkeys(columns, np.nan), dict.fromkeys(ALONG_RIM, np.zeros(0))


if __name__ == "__main__":
    command.run(main)
