"""What thin walls do to a fused cup: `python benchmarks/fusion.py --json`; what the numbers mean is in docs/fusion.md.

A cup of outer diameter 80 mm, height 90 mm, wall and floor 2.5 mm is scanned virtually (36 views) at three levels of noise, and
fused with truncations of 0.5 to 10 walls: ours, and plain (the weighted mean of all views, Open3D's VoxelBlockGrid). Then cups
of several walls are fused with the default truncation. Both ways are closed in the same way.
"""

import argparse
import json
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import open3d as o3d

from pipeline.errors import PipelineError
from pipeline.fuse import tsdf
from pipeline.fuse.placement import find
from pipeline.fuse.planes import inverse_depths
from pipeline.fuse.raw import Views
from pipeline.fuse.table import Placement
from pipeline.geometry import frames
from pipeline.geometry.cavity import cavity
from pipeline.geometry.surface import Surface
from pipeline.scan import lofts

WALL_M, RADIUS_M, HEIGHT_M = 0.0025, 0.040, 0.090
WALLS_M, TRUNCATION_M = (0.001, 0.0015, 0.002, 0.003, 0.004), 0.0025
RATIOS = (0.5, 1.0, 2.0, 3.3, 5.0, 10.0)
NOISES = (0.0, 1.0, 2.0)
VIEWS, SEED = 36, 1
VOXEL_M = 0.00125


def cup(wall_m: float) -> SimpleNamespace:
    """Return a cup as `scan` wants it: straight walls, everything `wall_m` thick, a rounded lip."""
    low, side, top = wall_m / 2, RADIUS_M - wall_m / 2, HEIGHT_M - wall_m / 2
    controls = [(0.0, low), *((share * side, low) for share in (0.4, 0.7, 0.9, 1.0, 1.0))]
    controls += [(side, low + share * (top - low)) for share in (0.03, 0.1, 0.25, 0.5, 0.75, 1.0)]
    body = lofts.wall(controls, wall_m)
    vertices, triangles = body.vertices_m, body.triangles
    return SimpleNamespace(
        name=f"wall_{wall_m * 1e6:.0f}um",
        vertices_m=vertices,
        triangles=triangles,
        inner=body.inner,
        height_m=vertices[:, 2].max(),
    )


def recorded(body: SimpleNamespace, noise: float) -> tuple[Views, Placement]:
    """Return the views of the cup on its table, as `fuse` reads them, and where it found it."""
    from fuse import scenes

    views, _ = scenes.views(body, VIEWS, noise)
    return views, find(views, body.name, np.random.default_rng(SEED))[1]


def plain(views: Views, placement: Placement, voxel_m: float, truncation_m: float) -> tsdf.Surface:
    """Return the surface of the mean over all views, whichever side of the wall they saw."""
    lowest, covered = tsdf._box(placement, voxel_m)
    keys = np.argwhere(np.ones([n // tsdf.BLOCK for n in covered.shape])) + lowest // tsdf.BLOCK
    blocks, one = o3d.core.Tensor.from_numpy(np.ascontiguousarray(keys, np.int32)), o3d.core.SizeVector([1])
    grid = o3d.t.geometry.VoxelBlockGrid(
        ("tsdf", "weight"), (o3d.core.float32,) * 2, (one, one), voxel_m, tsdf.BLOCK, len(keys)
    )
    K = views.intrinsics[0] + [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]  # Open3D truncates projected coordinates
    for depth_m, T_world_camera in zip(views.depths_m, views.T_world_cameras, strict=True):
        depth = np.where(inverse_depths(depth_m) > 0, depth_m, 0).astype(np.float32)
        image = o3d.t.geometry.Image(o3d.core.Tensor.from_numpy(depth)).filter_bilateral(5, 0.004, 1.5)
        T_camera_object = frames.inverse(placement.T_object_world @ T_world_camera)
        matrices = (o3d.core.Tensor.from_numpy(np.ascontiguousarray(m)) for m in (K, T_camera_object))
        grid.integrate(blocks, image, *matrices, 1.0, float(depth.max()) + 1.0, truncation_m / voxel_m)
    places, flat = (t.numpy() for t in grid.voxel_coordinates_and_flattened_indices())
    index = tuple((np.round(places / voxel_m).astype(int) - lowest).T)
    value, weight = np.zeros(covered.shape, np.float32), np.zeros(covered.shape, np.float32)
    for target, name in ((value, "tsdf"), (weight, "weight")):
        target[index] = grid.attribute(name).reshape((-1,)).numpy()[flat]
    value = tsdf.regularised(value, weight)
    value[~covered] = 1.0
    vertices, triangles = tsdf._marched(value * truncation_m, lowest, voxel_m, "plain")
    base = vertices[:, 2] < tsdf._table_layers(voxel_m) * voxel_m
    vertices[base, 2] = 0.0
    return tsdf.Surface(vertices, triangles, ~base, ~base)


def measured(surface: tsdf.Surface, body: SimpleNamespace) -> dict[str, float | None]:
    """Return the capacity's relative error and the thickness of the wall at half height; None: it holds nothing."""
    true_m3 = cavity(body.vertices_m, body.triangles, name="truth").capacity_m3
    try:
        found_m3 = cavity(surface.vertices_m, surface.triangles, name="cup").capacity_m3
    except PipelineError:
        found_m3 = np.nan
    azimuth = np.linspace(0, 2 * np.pi, 72, endpoint=False)
    out = np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth], axis=-1)
    middle = np.array([*surface.vertices_m[:, :2].mean(axis=0), body.height_m / 2])
    fused = Surface(surface.vertices_m, surface.triangles)
    first, last = fused.hit(np.tile(middle, (72, 1)), out), 0.2 - fused.hit(middle + 0.2 * out, -out)
    error = found_m3 / true_m3 - 1.0
    return {
        "capacity_error": None if np.isnan(error) else float(error),
        "wall_mm": float(np.median(last - first)) * 1e3,
    }


def row(wall_m: float, noise: float, truncation_m: float) -> dict:
    """Return what both ways make of one scan."""
    body = cup(wall_m)
    views, placement = recorded(body, noise)
    voxel_m = min(VOXEL_M, truncation_m / 2)
    found: dict = {"wall_mm": wall_m * 1e3, "noise": noise, "ratio": truncation_m / wall_m}
    found["ours"] = measured(tsdf.fuse(views, placement, voxel_m, truncation_m, "ours"), body)
    found["plain"] = measured(plain(views, placement, voxel_m, truncation_m), body)
    sys.stderr.write(f"{json.dumps(found)}\n")
    return found


def shown(part: dict) -> str:
    """Return the error of the capacity in % and, in brackets, the wall in mm."""
    error = part["capacity_error"]
    return f"{'leaks' if error is None else f'{100 * error:+.1f} %'} ({part['wall_mm']:.1f})"


def tables(by_ratio: list[dict], by_wall: list[dict]) -> str:
    """Return the rows as the two tables of docs/fusion.md."""
    heads = [f"noise {n:g}: ours | plain" for n in NOISES]
    lines = ["| truncation ÷ wall | " + " | ".join(heads) + " |", "|---" * (1 + 2 * len(NOISES)) + "|"]
    for k, ratio in enumerate(RATIOS):
        cells = [shown(found[kind]) for found in by_ratio[k :: len(RATIOS)] for kind in ("ours", "plain")]
        lines.append(f"| {ratio:g} | " + " | ".join(cells) + " |")
    lines += ["", "| wall, mm | ours | plain |", "|---|---|---|"]
    for found in by_wall:
        lines.append(f"| {found['wall_mm']:g} | {shown(found['ours'])} | {shown(found['plain'])} |")
    return "\n".join(lines)


def main() -> None:
    """Measure and write the tables, or JSON."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--json", action="store_true", help="write rows as JSON")
    as_json = options.parse_args().json
    sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
    by_ratio = [row(WALL_M, noise, ratio * WALL_M) for noise in NOISES for ratio in RATIOS]
    by_wall = [row(wall_m, 1.0, TRUNCATION_M) for wall_m in WALLS_M]
    text = json.dumps(by_ratio + by_wall, indent=2) if as_json else tables(by_ratio, by_wall)
    sys.stdout.write(text + "\n")


if __name__ == "__main__":
    main()
