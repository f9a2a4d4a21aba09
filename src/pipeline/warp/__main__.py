"""Warp the source to a target: its points onto the target's (point mapping), its labels onto the target (label mapping)."""

import time
from pathlib import Path
from typing import TYPE_CHECKING
from zlib import crc32

from pipeline import command
from pipeline.artefacts import normals, points, read_columns, write_json, write_table
from pipeline.errors import PipelineError

if TYPE_CHECKING:
    from pipeline.columns import Columns
    from pipeline.warp.clouds import Cloud, Mapped
    from pipeline.warp.warp import Warp

PARTS = ("container", "rim", "handle")


def main() -> None:
    """Read the labels of the source and of a target; write both mappings, the alignment and the warp itself."""
    parser = command.parser(__doc__)
    for option in ("--source-labels", "--target-labels"):
        parser.add_argument(option, type=Path, required=True)
    for option in ("--point-mapping", "--label-mapping", "--alignment", "--warp"):
        parser.add_argument(option, type=Path, required=True)
    parser.add_argument(
        "--method", default="nearest_neighbour", help="how the source is fitted to the target"
    )
    parser.add_argument("--k", type=int, default=1, help="neighbours a point is mapped to")
    parser.add_argument(
        "--refinements", type=int, default=5, help="refinements of nearest_neighbour; the paper has none"
    )
    parser.add_argument("--bends", type=int, default=1, help="bends of nearest_neighbour; the paper has none")
    parser.add_argument("--seed", type=int, default=3, help="of methods that draw points")
    parser.add_argument(
        "--examples",
        type=Path,
        nargs="*",
        default=[],
        help="warps of the source onto other objects that shape_space learns from",
    )
    parser.add_argument("--cpu", type=Path, help="processor time of the fit to write, JSON")
    options = parser.parse_args()

    from pipeline.warp import files

    fitted, cpu_s = _fit(options)
    mapped = {"point_mapping": fitted.map_cloud(options.k), "label_mapping": fitted.map_labels(options.k)}
    write_table(options.point_mapping, _table(mapped["point_mapping"]), "mapping")
    write_table(options.label_mapping, _table(mapped["label_mapping"]), "mapping")
    write_json(options.alignment, _alignment(fitted, mapped))
    files.save(options.warp, fitted)
    if options.cpu:
        write_json(options.cpu, {"fit_s": cpu_s})


def _fit(options) -> "tuple[Warp, float]":  # type: ignore[no-untyped-def]
    """Return the warp and the processor seconds that fitting took."""
    import numpy as np

    from pipeline.warp import files
    from pipeline.warp.methods import METHODS, fit

    if options.method not in METHODS:
        raise PipelineError(
            f"--method: expected one of {' '.join(METHODS)}, found '{options.method}'; correct warp.method"
        )
    source, target = _cloud(options.source_labels), _cloud(options.target_labels)
    own = {
        "nearest_neighbour": {"refinements": options.refinements, "bends": options.bends},
        "shape_space": {"examples": [files.load_example(path, source) for path in options.examples]},
    }
    rng = np.random.default_rng([options.seed, crc32(target.name.encode())])
    start_s = time.process_time()
    fitted = fit(options.method, source, target, rng=rng, **own.get(options.method, {}))
    return fitted, time.process_time() - start_s


def _cloud(path: Path) -> "Cloud":
    import numpy as np

    from pipeline.warp.clouds import Cloud

    table = read_columns(path, "labels")
    parts = np.column_stack([table[part] for part in PARTS])
    return Cloud(path.parent.name, points(table), normals(table), table["area_m2"], parts)


def _table(mapped: "Mapped") -> "Columns":
    cloud = mapped.cloud
    return {
        **dict(zip(("x_m", "y_m", "z_m"), cloud.points_m.T, strict=True)),
        **dict(zip(("nx", "ny", "nz"), cloud.normals.T, strict=True)),
        "area_m2": cloud.area_m2,
        **dict(zip(PARTS, cloud.parts.T, strict=True)),
        "source_index": mapped.source_index,
        "target_index": mapped.target_index,
        "valid": mapped.valid,
    }


def _alignment(warp: "Warp", mapped: "dict[str, Mapped]") -> dict:
    from pipeline.warp.quality import quality, unchecked_flips

    return {
        "method": warp.method,
        "source": warp.source.name,
        "target": warp.target.name,
        "T_source_part": warp.source_frame.T_object_part.tolist(),
        "T_target_part": warp.target_frame.T_object_part.tolist(),
        "scale": warp.scale.tolist(),
        "roll_observable": warp.target_frame.roll_observable,
        "roll_symmetry": warp.target_frame.roll_symmetry,
        "handles": warp.target_frame.handles,
        "cost_m": warp.cost_m,
        "diagnostics": warp.diagnostics,
        "wall_side_flips_without_check": unchecked_flips(warp),
        **{mapping: quality(warp, result) for mapping, result in mapped.items()},
    }


if __name__ == "__main__":
    command.run(main)
