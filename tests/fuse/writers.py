"""The same views in every layout that fuse reads."""

import json
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

from pipeline.scan import camera

Recorded = list[tuple[np.ndarray, np.ndarray]]  # depth (H, W) in mm and T_world_camera


def image(path: Path, depth: np.ndarray) -> None:
    """Write a 16-bit depth image."""
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(depth.astype(np.uint16)).save(path, compress_level=1)


def seven_scenes(folder: Path, recorded: Recorded) -> None:
    """Write frame-NNNNNN.depth.png and frame-NNNNNN.pose.txt."""
    _numbered(folder, recorded, "frame-{:06d}.{}")


def underscored(folder: Path, recorded: Recorded) -> None:
    """Write NNNNNN_depth.png and NNNNNN_pose.txt, commas in the intrinsics."""
    _numbered(folder, recorded, "{:06d}_{}")
    np.savetxt(folder / "camera-intrinsics.txt", camera.intrinsics(), delimiter=",")


def _numbered(folder: Path, recorded: Recorded, name: str) -> None:
    for i, (depth, T) in enumerate(recorded):
        image(folder / name.format(i, "depth.png"), depth)
        np.savetxt(folder / name.format(i, "pose.txt"), T, fmt="%.12g")
    np.savetxt(folder / "camera-intrinsics.txt", camera.intrinsics(), fmt="%.12g")


def intrinsics_json(folder: Path) -> None:
    """Write Open3D's camera_intrinsic.json: the matrix by columns."""
    size = {"width": camera.WIDTH, "height": camera.HEIGHT}
    matrix = camera.intrinsics().T.ravel().tolist()
    (folder / "camera_intrinsic.json").write_text(json.dumps({**size, "intrinsic_matrix": matrix}))


def open3d(folder: Path, recorded: Recorded) -> None:
    """Write depth/, camera_intrinsic.json and trajectory.log."""
    lines = []
    for i, (depth, T) in enumerate(recorded):
        image(folder / f"depth/{i:05d}.png", depth)
        lines += [f"{i} {i} {i + 1}", *(" ".join(f"{x:.12g}" for x in row) for row in T)]
    (folder / "trajectory.log").write_text("\n".join(lines) + "\n")
    intrinsics_json(folder)


def tum(folder: Path, recorded: Recorded) -> None:
    """Write depth.txt with images in 1/5000 m, and groundtruth.txt at other times and twice as often."""
    times = 1e9 + 0.1 * np.arange(len(recorded))
    listed = ["# depth maps"]
    for time, (depth, _) in zip(times, recorded, strict=True):
        image(folder / f"depth/{time:.6f}.png", 5 * depth)
        listed.append(f"{time:.6f} depth/{time:.6f}.png")
    (folder / "depth.txt").write_text("\n".join(listed) + "\n")
    poses = ["# timestamp tx ty tz qx qy qz qw"]
    for time, (_, T) in zip(times, recorded, strict=True):
        numbers = " ".join(f"{x:.12g}" for x in [*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_quat()])
        poses += [f"{time - 0.004:.6f} {numbers}", f"{time + 0.004:.6f} {numbers}"]
    (folder / "groundtruth.txt").write_text("\n".join(poses) + "\n")
    intrinsics_json(folder)


def bop(folder: Path, recorded: Recorded) -> None:
    """Write depth/ in tenths of millimetres and scene_camera.json; each view has a principal point of its own."""
    cameras = {}
    for i, (depth, T) in enumerate(recorded):
        crop, T_camera_world = 3 * (i % 3), np.linalg.inv(T)
        image(folder / f"depth/{i:06d}.png", 10 * depth[crop:, 2 * crop :])
        cameras[str(i)] = {
            "cam_K": (camera.intrinsics() - [[0, 0, 2 * crop], [0, 0, crop], [0, 0, 0]]).ravel().tolist(),
            "cam_R_w2c": T_camera_world[:3, :3].ravel().tolist(),
            "cam_t_w2c": (1000 * T_camera_world[:3, 3]).tolist(),
            "depth_scale": 0.1,
        }
    (folder / "scene_camera.json").write_text(json.dumps(cameras))


WRITERS = {"7-scenes": seven_scenes, "numbered": underscored, "open3d": open3d, "tum": tum, "bop": bop}
