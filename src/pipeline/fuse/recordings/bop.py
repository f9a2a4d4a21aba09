"""BOP: depth/NNNNNN.png and scene_camera.json with each view's camera, depth scale and pose world→camera in millimetres."""

from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import PipelineError
from pipeline.fuse import files
from pipeline.fuse.raw import Options
from pipeline.fuse.recordings.frame import Frame, colour
from pipeline.geometry.frames import inverse

CAMERAS = POSES = "scene_camera.json"


def recognised(folder: Path, names: list[str]) -> bool:
    """Return whether there are cameras of this kind."""
    return CAMERAS in names


def frames(folder: Path, names: list[str], options: Options) -> list[Frame]:
    """Return the views of scene_camera.json, in the order of their numbers."""
    path = folder / CAMERAS
    views = files.content(path, "a camera for each view")
    if not isinstance(views, dict) or not views or not all(_numbered(key) for key in views):
        raise PipelineError(
            f"{path}: expected a camera for each view's number, found {views!r:.60}; export it again"
        )
    posed = any(isinstance(view, dict) and "cam_R_w2c" in view for view in views.values())
    order = sorted(views, key=int)
    return [_frame(folder, key, views[key], f"{path}, view {key}", posed, options) for key in order]


def _numbered(key: str) -> bool:
    return key.isascii() and key.isdigit() and len(key) < 10


def _frame(folder: Path, key: str, view: Any, where: str, posed: bool, options: Options) -> Frame:
    if not isinstance(view, dict):
        raise PipelineError(f"{where}: expected cam_K and depth_scale, found {view!r:.60}; export it again")
    K = files.camera(_numbers(view, "cam_K", (3, 3), where), where)
    mm = float(_numbers(view, "depth_scale", (1,), where)[0]) if "depth_scale" in view else 1.0
    if not 0 < mm < 1e6:
        raise PipelineError(
            f"{where}: expected a positive depth_scale (millimetres a unit), found {mm}; correct it"
        )
    scale = options.depth_scale or 1000.0 / mm
    T = None
    if posed:
        T_camera_world = np.eye(4)
        T_camera_world[:3, :3] = _numbers(view, "cam_R_w2c", (3, 3), where)
        T_camera_world[:3, 3] = _numbers(view, "cam_t_w2c", (3,), where)
        T = inverse(files.pose(T_camera_world, options.unit_m or 0.001, where, "world→camera"))
    name = f"{int(key):06d}"
    image = colour(folder / "rgb", name) or colour(folder / "gray", name)
    return Frame(folder / "depth" / f"{name}.png", K, where, scale, T, image)


def _numbers(view: dict, key: str, shape: tuple[int, ...], where: str) -> np.ndarray:
    if key not in view:
        raise PipelineError(f"{where}: expected the key {key}, found {' '.join(sorted(view)):.80}; add it")
    return files.numbers(view[key], shape, f"{where}: {key}", f"{key}")
