"""Cups of any wall on a table, scanned in memory: for tests of thin walls and for `benchmarks/fusion.py`."""

from types import SimpleNamespace

import numpy as np

from pipeline.fuse.raw import Options, Views
from pipeline.scan import camera, recording

SEED, DISTANCE_M = 1, 0.6


def views(body: SimpleNamespace, n: int = 36, noise: float = 1.0) -> tuple[Views, np.ndarray]:
    """Return n views of a body (name, vertices_m, triangles, height_m) as `fuse` reads them, and T_world_object."""
    T_world_object = recording.pose_on_table(recording.generator(SEED, body.name, 0))
    pairs = recording.views(body, T_world_object, n, DISTANCE_M, noise, SEED)
    depths = [(depth_mm / np.float32(1000)).astype(np.float32) for depth_mm, _ in pairs]
    found = Views(
        depths_m=depths,
        T_world_cameras=[pose for _, pose in pairs],
        intrinsics=np.stack([camera.intrinsics()] * n),
        names=[f"frame-{number:06d}" for number in range(n)],
        layout="7-scenes",
        options=Options(),
        colours=[],
        depth_scale=1000.0,
        n_found=n,
    )
    return found, T_world_object
