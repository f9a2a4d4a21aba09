"""TUM RGB-D: depth.txt lists depth images by time, groundtruth.txt poses camera→world by time; depth in 1/5000 m."""

from pathlib import Path

import numpy as np

from pipeline.errors import PipelineError
from pipeline.fuse import files
from pipeline.fuse.raw import Options
from pipeline.fuse.recordings.frame import Frame
from pipeline.geometry import frames as rigid

NEAREST_S = 0.02  # a view without a pose within this time is left out, as in the benchmark's own tools
POSES = TRAJECTORY = "groundtruth.txt"


def recognised(folder: Path, names: list[str]) -> bool:
    """Return whether there is the list of depth images."""
    return "depth.txt" in names


def frames(folder: Path, names: list[str], options: Options) -> list[Frame]:
    """Return the views that have a pose at their time, or all of them when there are no poses."""
    times, images = _list(folder / "depth.txt")
    K, where_K = files.intrinsics(folder, folder / images[0])
    poses: list[np.ndarray | None] = [None] * len(images)
    if (folder / TRAJECTORY).exists():
        poses = _at(times, *_trajectory(folder / TRAJECTORY, options.unit_m or 1.0))
        if not any(T is not None for T in poses):
            raise PipelineError(
                f"{folder / TRAJECTORY}: expected poses at the times of depth.txt ({times[0]:.3f} to {times[-1]:.3f} s), found "
                f"none within {NEAREST_S} s of any; the two files belong to different recordings"
            )
    colours = _colours(folder, times)
    kept = [i for i, T in enumerate(poses) if T is not None or not (folder / TRAJECTORY).exists()]
    scale = options.depth_scale or 5000.0
    return [Frame(folder / images[i], K, str(where_K), scale, poses[i], colours[i]) for i in kept]


def _list(path: Path) -> tuple[np.ndarray, list[str]]:
    lines = files.rows(path, "a list of images: time, file")
    for line in lines:
        if len(line) != 2 or line[1].startswith("/") or ".." in line[1]:
            raise PipelineError(
                f"{path}: expected lines of a time and a file in the folder, found '{' '.join(line):.60}'; correct it"
            )
    if not lines:
        raise PipelineError(f"{path}: expected a list of images, found none; export it again")
    times = files.numbers([line[0] for line in lines], (len(lines),), str(path), "the times")
    return times, [line[1] for line in lines]


def _colours(folder: Path, times: np.ndarray) -> list[Path | None]:
    """Return for each time the colour image that is nearest to it."""
    if not (folder / "rgb.txt").exists():
        return [None] * len(times)
    taken, images = _list(folder / "rgb.txt")
    nearest = [int(np.argmin(np.abs(taken - time))) for time in times]
    return [
        folder / images[j] if abs(taken[j] - t) < 2 * NEAREST_S else None
        for j, t in zip(nearest, times, strict=True)
    ]


def _trajectory(path: Path, unit_m: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times (M,), positions (M, 3) in metres and quaternions (M, 4) x y z w, sorted by time."""
    lines = files.rows(path, "poses: time tx ty tz qx qy qz qw")
    if not lines:
        raise PipelineError(
            f"{path}: expected poses, found none; remove the file to have the views registered"
        )
    table = files.numbers(lines, (len(lines), 8), str(path), "poses: time tx ty tz qx qy qz qw")
    lengths = np.linalg.norm(table[:, 4:], axis=1)
    if np.abs(lengths - 1).max() > 0.01:
        i = int(np.argmax(np.abs(lengths - 1)))
        raise PipelineError(
            f"{path}: expected unit quaternions qx qy qz qw, found length {lengths[i]:.3g} at {table[i, 0]:.4f} s; correct it"
        )
    table = table[np.unique(table[:, 0], return_index=True)[1]]
    return table[:, 0], table[:, 1:4] * unit_m, table[:, 4:]


def _at(
    wanted: np.ndarray, times: np.ndarray, positions: np.ndarray, quaternions: np.ndarray
) -> list[np.ndarray | None]:
    """Return T_world_camera at each time, between the poses before and after; None where none is near."""
    from scipy.spatial.transform import Rotation, Slerp

    gap = np.abs(wanted[:, None] - times).min(axis=1)
    if len(times) == 1:
        rotations = Rotation.from_quat(np.repeat(quaternions, len(wanted), axis=0))
        places = np.repeat(positions, len(wanted), axis=0)
    else:
        inside = np.clip(wanted, times[0], times[-1])
        rotations = Slerp(times, Rotation.from_quat(quaternions))(inside)
        places = np.stack([np.interp(inside, times, axis) for axis in positions.T], axis=-1)
    matrices = rotations.as_matrix()
    return [
        rigid.transform(R, t) if near <= NEAREST_S else None
        for R, t, near in zip(matrices, places, gap, strict=True)
    ]
