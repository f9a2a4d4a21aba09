"""Fuse one raw folder into a closed surface and evenly spaced points, the object upright on z = 0."""

from pathlib import Path

from pipeline.command import parser, run, say, steps


def main() -> None:
    """Parse the options, fuse, write."""
    options = parser(__doc__)
    options.add_argument(
        "--raw", type=Path, required=True, help="folder with the scan; its name is the object's"
    )
    options.add_argument("--mesh", type=Path, required=True, help="surface to write, PLY")
    options.add_argument("--cloud", type=Path, required=True, help="points to write, Parquet")
    options.add_argument("--report", type=Path, required=True, help="what was found, JSON")
    options.add_argument("--voxel-m", type=float, default=0.00125, help="edge of a voxel")
    options.add_argument("--truncation-m", type=float, default=0.0025, help="truncation distance")
    options.add_argument("--points", type=int, default=12_000, help="points of the cloud, at least 5000")
    options.add_argument("--seed", type=int, default=2)
    o = options.parse_args()

    from pipeline.fuse import outputs
    from pipeline.fuse.fusion import fused

    how = {"voxel_m": o.voxel_m, "truncation_m": o.truncation_m, "n_points": o.points, "seed": o.seed}
    with steps(f"fusing {o.raw.name}", 4) as tell:
        result = fused(o.raw, **how, tell=tell)
    for complaint in result.complaints:
        say(f"{o.raw}: {complaint}")
    outputs.write(result, o.mesh, o.cloud, o.report)


run(main)
