"""Open3D's folders: depth/*.png, camera_intrinsic.json, trajectory.log (camera→world), colours in color/ or image/.

Open3D's own readers give an empty camera or trajectory where something is wrong; ours say what.
"""

from pathlib import Path

import numpy as np

from pipeline.errors import PipelineError
from pipeline.fuse import files
from pipeline.fuse.raw import Options
from pipeline.fuse.recordings.frame import Frame, colour

COLOUR_FOLDERS = ("color", "image", "rgb")
LOG = "trajectory.log"


def recognised(folder: Path, names: list[str]) -> bool:
    """Return whether there is a folder of depth images without the lists of another layout."""
    return "depth" in names and "scene_camera.json" not in names and "depth.txt" not in names


def frames(folder: Path, names: list[str], options: Options) -> list[Frame]:
    """Return the views in the order of their file names, which is that of trajectory.log."""
    K, where_K = files.intrinsics(folder)
    shown = sorted(
        (path for path in (folder / "depth").glob("*") if not path.name.startswith(".")),
        key=lambda path: files.in_order(path.name),
    )
    depths = [path for path in shown if path.suffix.lower() == ".png"]
    if not depths:
        found = f"{shown[0].name}; export them again" if shown else "none; add them"
        raise PipelineError(f"{folder / 'depth'}: expected depth images *.png of 16 bit, found {found}")
    poses = _poses(folder / LOG, options.unit_m or 1.0) if (folder / LOG).exists() else [None] * len(depths)
    if len(poses) != len(depths):
        raise PipelineError(
            f"{folder / LOG}: expected a pose for each of the {len(depths)} images in depth/, found {len(poses)}; "
            "remove images without pose"
        )
    colours = next((folder / name for name in COLOUR_FOLDERS if name in names), folder / "color")
    scale = options.depth_scale or 1000.0
    return [
        Frame(path, K, str(where_K), scale, T, colour(colours, path.stem))
        for path, T in zip(depths, poses, strict=True)
    ]


def _poses(path: Path, unit_m: float) -> list[np.ndarray]:
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
