"""What poses that are off do to a scan, and what scans without poses are like: `python benchmarks/poses.py`; see docs/fusion.md.

The demonstration mug with poses off at random, fused as given and refined. Then demonstration objects without their pose files,
against the truth after the turn and the shift on the table that no scan can tell.
"""

import argparse
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from pipeline.artefacts import points, read_json, read_table
from pipeline.errors import PipelineError
from pipeline.fuse import agreement, fusion, layouts, outputs, placement, recorded, tsdf
from pipeline.fuse.raw import Views
from pipeline.geometry import frames
from pipeline.geometry.cavity import cavity
from pipeline.geometry.surface import Surface
from pipeline.report import accuracy
from pipeline.scan import recording, truth
from pipeline.scan.shapes import NAMES, shape

VIEWS, DISTANCE_M, NOISE, SEED = 36, 0.6, 1.0, 1
HOW = {"voxel_m": 0.00125, "truncation_m": 0.0025, "n_points": 12000, "seed": 2}  # config/config.yaml
# Millimetres and degrees, standard deviations of each axis.
OFF = ((0.2, 0.03), (0.5, 0.1), (1.5, 0.3), (3.0, 0.5))
DRIFT_M = 0.005
AXIS_M, ASTRAY_M = (0.0005, 0.001, 0.002, 0.004), (0.02, 0.1)
STARTS_DEG, FEW, MANY = 5, 400, 1500


def record(folder: Path, name: str) -> Path:
    """Record a demonstration object as `scan` does, the truth beside it, and return the folder of its views."""
    body, rng = shape(name), recording.generator(SEED, name, 0)
    T_world_object = recording.pose_on_table(rng)
    raw = folder / "raw" / name
    recording.write(raw, recording.views(body, T_world_object, VIEWS, DISTANCE_M, NOISE, SEED))
    truth.write(folder / "scan" / name, body, T_world_object, rng)
    return raw


def drifting(views: Views) -> Views:
    """Return the views with poses that drift away along the first one's diagonal."""
    direction = np.ones(3) / np.sqrt(3)
    shifts = np.linspace(0, DRIFT_M, len(views.names))
    poses = [
        frames.transform(np.eye(3), s * direction) @ T
        for s, T in zip(shifts, views.T_world_cameras, strict=True)
    ]
    return replace(views, T_world_cameras=poses)


def held(views: Views, place: placement.Placement, name: str) -> str:
    """Return in words how far capacity and height of the fused views are from the truth."""
    body = shape(name)
    try:
        surface = tsdf.fuse(views, place, HOW["voxel_m"], HOW["truncation_m"], name)
        room = cavity(surface.vertices_m, surface.triangles, name=name)
    except PipelineError:
        return "holds nothing"
    higher_mm = 1e3 * (surface.vertices_m[:, 2].max() - body.height_m)
    return f"capacity {100 * (room.capacity_m3 / body.capacity_m3 - 1):+.1f} %, height {higher_mm:+.1f} mm"


def as_given(views: Views, name: str) -> str:
    """Return what comes of the poses as they are."""
    try:
        return held(views, placement.find(views, name, np.random.default_rng(HOW["seed"]))[1], name)
    except PipelineError:
        return "refused"


def refined(views: Views, name: str) -> str:
    """Return what comes of them with what fuse does about it."""
    scan = recorded.located(views, name, np.random.default_rng(HOW["seed"]))
    if not scan.is_refined:
        return "not asked for"
    return held(scan.views, scan.placement, name)


def unposed(folder: Path, name: str) -> str:
    """Return a row: the errors of an object that is fused without its pose files."""
    raw = record(folder, name)
    for path in raw.glob("*.pose.txt"):
        path.unlink()
    try:
        found = fusion.fused(raw, **HOW)
    except PipelineError as error:
        return f"| {name} | refused: {error} |"
    made = folder / "fuse" / name
    outputs.write(found, made / "mesh.ply", made / "cloud.parquet", made / "fusion.json")
    true = accuracy.read_truth(folder, name)
    e = accuracy.fusion_errors(folder, name, replace(true, T_truth_object=aligned(true, made)))
    cells = [
        name.replace("_", " "),
        *(
            f"{e[f'{side}_error_mm_mean']:.2f}, {e[f'{side}_error_mm_p95']:.2f}"
            for side in ("inner", "outer")
        ),
        f"{e['wall_error_mm_mean']:.2f}",
        f"{100 * e['capacity_relative_error']:+.1f} %",
        f"{100 * e['seen_normals_within_10_deg_share']:.0f} %",
        "seen" if read_json(made / "fusion.json")["roll_observable"] else "not observable",
    ]
    return f"| {' | '.join(cells)} |"


def aligned(true: accuracy.Truth, made: Path) -> np.ndarray:
    """Return T_truth_object: the turn and the shift on the table that bring the seen points nearest to the true surface."""
    cloud = read_table(made / "cloud.parquet", "cloud")
    seen_m = points(cloud[cloud["seen"]])
    seen_m = np.random.default_rng(0).permutation(seen_m)[:MANY]
    surface, middle_m = Surface(*true.mesh), _middle_m(points(true.cloud))

    def placed(turn_and_shift_cm: np.ndarray) -> np.ndarray:
        turn, x, y = turn_and_shift_cm
        return frames.transform(
            frames.rotation_about(np.array([0.0, 0.0, 1.0]), turn), np.array([x, y, 0.0]) / 100
        )

    def cost(values: np.ndarray, some_m: np.ndarray) -> float:
        return float(np.mean((1e3 * surface.distance(frames.apply(placed(values), some_m))) ** 2))

    starts = []
    for turn in np.radians(np.arange(0, 360, STARTS_DEG)):
        turned = frames.apply(placed(np.array([turn, 0.0, 0.0])), seen_m)
        starts.append(np.array([turn, *(100 * (middle_m - _middle_m(turned)))]))
    starts.sort(key=lambda start: cost(start, seen_m[:FEW]))
    steps = np.vstack([np.zeros(3), np.diag([0.05, 0.1, 0.1])])
    ends = [
        minimize(
            cost,
            start,
            args=(seen_m,),
            method="Nelder-Mead",
            options={"initial_simplex": start + steps, "xatol": 1e-4, "fatol": 1e-5},
        )
        for start in starts[:3]
    ]
    return placed(min(ends, key=lambda end: end.fun).x)


def _middle_m(points_m: np.ndarray) -> np.ndarray:
    return (points_m[:, :2].min(axis=0) + points_m[:, :2].max(axis=0)) / 2


def main() -> None:
    """Measure and write both tables."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--objects", nargs="*", default=list(NAMES), help="for scans without poses")
    names = options.parse_args().objects
    sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
    from fuse import scenes

    with tempfile.TemporaryDirectory() as scratch:
        views = layouts.read(record(Path(scratch), "mug"))
        cases = [(f"{mm:g} mm, {deg:g}°", scenes.shaken(views, mm / 1e3, deg, SEED)) for mm, deg in OFF]
        cases.append((f"drift of {1e3 * DRIFT_M:g} mm over the views", drifting(views)))
        axis_m = recording.pose_on_table(recording.generator(SEED, "mug", 0))[:3, 3]
        cases += [
            (f"a turntable's axis {1e3 * off_m:g} mm elsewhere", scenes.off_axis(views, axis_m, off_m))
            for off_m in AXIS_M
        ]
        twelve = agreement.only(views, np.arange(VIEWS) % 3 == 0)
        cases += [
            (f"one of 12 views {1e3 * off_m:g} mm along the table", scenes.one_moved(twelve, off_m))
            for off_m in ASTRAY_M
        ]
        sys.stdout.write("| poses off (at random: an axis) | as given | refined |\n|---|---|---|\n")
        for said, case in cases:
            sys.stdout.write(f"| {said} | {as_given(case, 'mug')} | {refined(case, 'mug')} |\n")
            sys.stdout.flush()
        sys.stdout.write(
            "\n| without poses | surface inside: mean, p95, mm | outside | wall, mm | capacity "
            "| normals of seen points within 10° | roll |\n|---|---|---|---|---|---|---|\n"
        )
        for name in names:
            sys.stdout.write(f"{unposed(Path(scratch), name)}\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
