"""Open3D's folders: depth/*.png, camera_intrinsic.json, colours in color/ or image/, and poses in trajectory.log (camera→world),
trajectory.json (world→camera), or as ScanNet has them, a file a view in pose/ (camera→world).

Open3D's own readers give an empty camera or trajectory where something is wrong; ours say what.
"""

from pathlib import Path

import numpy as np

from pipeline.errors import PipelineError
from pipeline.fuse import files
from pipeline.fuse.raw import Options
from pipeline.fuse.recordings.frame import Frame, colour
from pipeline.geometry.frames import inverse

COLOUR_FOLDERS = ("color", "image", "rgb")
# The second is where Open3D's reconstruction leaves them. Open3D writes .log and .json of the same poses: one of them is read.
LOGS, JSON, POSE_FOLDER = ("trajectory.log", "scene/trajectory.log"), "trajectory.json", "pose"
POSES = "trajectory.log"


def recognised(folder: Path, names: list[str]) -> bool:
    """Return whether there is a folder of depth images without the lists of another layout."""
    return "depth" in names and "scene_camera.json" not in names and "depth.txt" not in names


def frames(folder: Path, names: list[str], options: Options) -> list[Frame]:
    """Return the views in the order of their file names, which is that of the poses."""
    shown = sorted(
        (path for path in (folder / "depth").glob("*") if not path.name.startswith(".")),
        key=lambda path: files.in_order(path.name),
    )
    depths = [path for path in shown if path.suffix.lower() == ".png"]
    if not depths:
        found = f"{shown[0].name}; export them again" if shown else "none; add them"
        raise PipelineError(f"{folder / 'depth'}: expected depth images *.png of 16 bit, found {found}")
    K, where_K = files.intrinsics(folder, depths[0])
    poses = _poses(folder, depths, options.unit_m or 1.0)
    colours = next((folder / name for name in COLOUR_FOLDERS if name in names), folder / "color")
    scale = options.depth_scale or 1000.0
    return [
        Frame(path, K, str(where_K), scale, T, colour(colours, path.stem))
        for path, T in zip(depths, poses, strict=True)
    ]


def _poses(folder: Path, depths: list[Path], unit_m: float) -> list[np.ndarray] | list[None]:
    path = next((folder / name for name in (*LOGS, JSON, POSE_FOLDER) if (folder / name).exists()), None)
    if path is None:
        return [None] * len(depths)
    if path.name == POSE_FOLDER:
        return [_pose(path / f"{depth.stem}.txt", unit_m) for depth in depths]
    poses = _of_trajectory(path, unit_m) if path.name == JSON else _of_log(path, unit_m)
    if len(poses) != len(depths):
        raise PipelineError(
            f"{path}: expected a pose for each of the {len(depths)} images in depth/, found {len(poses)}; "
            "remove images without pose"
        )
    return poses


def _pose(path: Path, unit_m: float) -> np.ndarray:
    given = files.matrix(path, 4, "the pose camera→world", cure="add it or remove the image")
    return files.pose(given, unit_m, str(path))


def _of_log(path: Path, unit_m: float) -> list[np.ndarray]:
    lines = files.rows(path, "the poses camera→world")
    if len(lines) % 5:
        raise PipelineError(
            f"{path}: expected five lines a pose (numbers of the frame, then 4×4 camera→world), found {len(lines)} lines; "
            "export it again"
        )
    return [
        files.pose(
            files.numbers(lines[i + 1 : i + 5], (4, 4), f"{path}, pose {i // 5}", "the pose camera→world"),
            unit_m,
            f"{path}, pose {i // 5}",
        )
        for i in range(0, len(lines), 5)
    ]


def _of_trajectory(path: Path, unit_m: float) -> list[np.ndarray]:
    """Return the poses of a PinholeCameraTrajectory: its extrinsics are world→camera, by columns."""
    found = files.content(path, "the poses world→camera")
    views = found.get("parameters") if isinstance(found, dict) else None
    if not isinstance(views, list) or not all(
        isinstance(view, dict) and "extrinsic" in view for view in views
    ):
        raise PipelineError(
            f"{path}: expected the key parameters, a list with an extrinsic (16 numbers by columns) for each view, found "
            f"{found!r:.60}; export it again"
        )
    poses = []
    for i, view in enumerate(views):
        where = f"{path}: parameters {i}: extrinsic"
        by_columns = files.numbers(view["extrinsic"], (16,), where, "the pose world→camera")
        poses.append(inverse(files.pose(by_columns.reshape(4, 4).T, unit_m, where, "world→camera")))
    return poses
