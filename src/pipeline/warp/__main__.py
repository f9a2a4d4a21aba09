"""Warp the source to a target: its points onto the target's (point mapping), its labels onto the target (label mapping)."""

from pathlib import Path
from typing import TYPE_CHECKING

from pipeline import command
from pipeline.artefacts import normals, points, read_table, write_json, write_table

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.warp.warp import Cloud, Mapped, Warp


def main() -> None:
    """Read the labels of the source and of a target; write both mappings and the alignment."""
    parser = command.parser(__doc__)
    for option in ("--source-labels", "--target-labels", "--point-mapping", "--label-mapping", "--alignment"):
        parser.add_argument(option, type=Path, required=True)
    parser.add_argument("--k", type=int, default=1, help="neighbours a point is mapped to")
    parser.add_argument(
        "--refinements", type=int, default=5, help="refinements of the alignment; the paper has none"
    )
    options = parser.parse_args()

    from pipeline.warp import warp as warping

    fitted = warping.fit(_cloud(options.source_labels), _cloud(options.target_labels), options.refinements)
    mapped = {
        "point_mapping": warping.point_mapping(fitted, options.k),
        "label_mapping": warping.label_mapping(fitted, options.k),
    }
    write_table(options.point_mapping, _table(mapped["point_mapping"]), "mapping")
    write_table(options.label_mapping, _table(mapped["label_mapping"]), "mapping")
    write_json(options.alignment, _alignment(fitted, mapped))


def _cloud(path: Path) -> "Cloud":
    from pipeline.warp.warp import Cloud

    table = read_table(path, "labels")
    parts = table[["container", "rim", "handle"]].to_numpy(bool)
    return Cloud(path.parent.name, points(table), normals(table), table["area_m2"].to_numpy(), parts)


def _table(mapped: "Mapped") -> "pd.DataFrame":
    import pandas as pd

    cloud = mapped.cloud
    return pd.DataFrame(
        {
            **dict(zip(("x_m", "y_m", "z_m"), cloud.points_m.T, strict=True)),
            **dict(zip(("nx", "ny", "nz"), cloud.normals.T, strict=True)),
            "area_m2": cloud.area_m2,
            **dict(zip(("container", "rim", "handle"), cloud.parts.T, strict=True)),
            "source_index": mapped.source_index,
            "target_index": mapped.target_index,
            "valid": mapped.valid,
        }
    )


def _alignment(warp: "Warp", mapped: "dict[str, Mapped]") -> dict:
    import numpy as np

    from pipeline.warp.warp import wall_side_flips

    return {
        "source": warp.source.name,
        "target": warp.target.name,
        "T_source_part": warp.source_frame.T_object_part.tolist(),
        "T_target_part": warp.target_frame.T_object_part.tolist(),
        "first_axis_knots_m": warp.stretch.knots_m.tolist(),
        "scale": [
            float(np.ptp(warp.stretch.knots_m[1]) / np.ptp(warp.stretch.knots_m[0])),
            *warp.stretch.scale.tolist(),
        ],
        "offset_m": warp.stretch.offset_m.tolist(),
        "roll_observable": warp.target_frame.roll_observable,
        **{
            mapping: {
                "residual_m": float(np.mean(result.distance_m[result.valid])),
                "share_without_candidate": float(np.mean(~result.valid)),
                "wall_side_flips": wall_side_flips(warp, result),
                "share_of_target_reached": len(np.unique(result.target_index[result.valid]))
                / len(warp.target.points_m),
            }
            for mapping, result in mapped.items()
        },
    }


if __name__ == "__main__":
    command.run(main)
