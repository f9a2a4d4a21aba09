"""A demonstration object on its table, recorded from a turntable into a folder in 7-Scenes layout."""

from pathlib import Path
from zlib import crc32

import numpy as np

from pipeline.artefacts import replacing
from pipeline.command import progress
from pipeline.errors import PipelineError
from pipeline.geometry import frames
from pipeline.scan import camera
from pipeline.scan.lofts import Mesh
from pipeline.scan.shapes import Shape

TABLE_HALF_M = 0.4
TABLE_HEIGHT_M = 0.7
LEAST_DISTANCE_M = 0.4  # the Kinect measures from here on (Khoshelham & Elberink 2012)


def generator(seed: int, name: str, stream: int) -> np.random.Generator:
    """Return the random numbers of one object and one purpose, the same on every machine."""
    return np.random.default_rng([seed, crc32(name.encode()), stream])


def pose_on_table(rng: np.random.Generator) -> np.ndarray:
    """Return T_world_object (4, 4): somewhere near the middle of the table, at any yaw."""
    position = np.array([*rng.uniform(-0.08, 0.08, 2), TABLE_HEIGHT_M])
    return frames.transform(
        frames.rotation_about(np.array([0.0, 0.0, 1.0]), rng.uniform(0, 2 * np.pi)), position
    )


def table() -> Mesh:
    """Return the table's top as a square mesh in the world."""
    corners = TABLE_HALF_M * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]])
    return corners + [0, 0, TABLE_HEIGHT_M], np.array([[0, 1, 2], [0, 2, 3]])


def views(
    shape: Shape, T_world_object: np.ndarray, n: int, distance_m: float, noise: float, seed: int
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return n pairs of a depth image (H, W) in mm and its pose T_world_camera (4, 4)."""
    if n < camera.LEAST_VIEWS:
        raise PipelineError(
            f"--views: expected at least {camera.LEAST_VIEWS}, found {n}; set scan.views to more"
        )
    if distance_m < LEAST_DISTANCE_M:
        raise PipelineError(
            f"--distance-m: expected at least {LEAST_DISTANCE_M}, found {distance_m}; set scan.distance_m"
        )
    scene = camera.Scene([(frames.apply(T_world_object, shape.vertices_m), shape.triangles), table()])
    target = T_world_object[:3, 3] + [0, 0, shape.height_m / 2]
    poses = camera.turntable(n, target, distance_m)
    sensor = camera.Noise(noise)
    return [
        (camera.depth_image(scene, pose, sensor, generator(seed, shape.name, 1 + i)), pose)
        for i, pose in enumerate(progress(poses, n, f"scanning {shape.name}: views"))
    ]


def write(folder: Path, recorded: list[tuple[np.ndarray, np.ndarray]]) -> None:
    """Write images, poses and intrinsics in 7-Scenes layout; frames of an earlier recording are removed."""
    from PIL import Image

    folder.mkdir(parents=True, exist_ok=True)
    for old in sorted(folder.glob("frame-*")):
        old.unlink()
    for i, (depth_mm, T_world_camera) in enumerate(recorded):
        with replacing(folder / f"frame-{i:06d}.depth.png") as path:
            Image.fromarray(depth_mm).save(path, compress_level=1)
        with replacing(folder / f"frame-{i:06d}.pose.txt") as path:
            np.savetxt(path, T_world_camera, fmt="%.12g")
    with replacing(folder / "camera-intrinsics.txt") as path:
        np.savetxt(path, camera.intrinsics(), fmt="%.12g")
