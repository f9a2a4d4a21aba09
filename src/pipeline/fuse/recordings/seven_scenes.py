"""7-Scenes and its like: frame-NNNNNN.depth.png with frame-NNNNNN.pose.txt, or NNNNNN_depth.png with NNNNNN_pose.txt."""

import re
from pathlib import Path

from pipeline.fuse import files
from pipeline.fuse.raw import Options
from pipeline.fuse.recordings.frame import Frame, colour

POSES = "frame-NNNNNN.pose.txt"
DEPTH = re.compile(r"(?P<stem>.*\d[._-]|.*\d)depth\.(png|PNG)")


def recognised(folder: Path, names: list[str]) -> bool:
    """Return whether there is a depth image of this kind."""
    return any(DEPTH.fullmatch(name) for name in names)


def frames(folder: Path, names: list[str], options: Options) -> list[Frame]:
    """Return the views; poses are camera→world, and none at all is allowed."""
    stems = {match["stem"]: name for name in names if (match := DEPTH.fullmatch(name))}
    K, where_K = files.intrinsics(folder, folder / next(iter(stems.values())))
    posed = any((folder / f"{stem}pose.txt").exists() for stem in stems)
    found = []
    for stem, name in stems.items():
        T = None
        if posed:
            path = folder / f"{stem}pose.txt"
            given = files.matrix(path, 4, "the pose camera→world", cure="add it or remove the frame")
            T = files.pose(given, options.unit_m or 1.0, str(path))
        image = colour(folder, f"{stem}color") or colour(folder, f"{stem}rgb")
        found.append(Frame(folder / name, K, str(where_K), options.depth_scale or 1000.0, T, image))
    return found
