"""Cups of any wall on a table, scanned in memory: for tests, and for `benchmarks/fusion.py`, `arcs.py` and `poses.py`."""

from dataclasses import replace
from functools import lru_cache
from types import SimpleNamespace

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.fuse.raw import Options, Views
from pipeline.geometry import frames
from pipeline.scan import camera, recording
from pipeline.scan.shapes import shape

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


@lru_cache(maxsize=1)
def _all_round(name: str, n: int) -> tuple[Views, np.ndarray]:
    return views(shape(name), n)


def of_one_side(name: str, towards_deg: float, arc_deg: float, n: int = 48) -> Views:
    """Return those of n views of a demonstration object that are from around one direction of its frame; its handle is at 180°."""
    all_round, T_world_object = _all_round(name, n)
    eyes = [frames.apply(frames.inverse(T_world_object), T[:3, 3]) for T in all_round.T_world_cameras]
    off = [(np.degrees(np.arctan2(y, x)) - towards_deg + 180) % 360 - 180 for x, y, _ in eyes]
    kept = np.flatnonzero(np.abs(off) <= arc_deg / 2)
    return replace(
        all_round,
        depths_m=[all_round.depths_m[i] for i in kept],
        T_world_cameras=[all_round.T_world_cameras[i] for i in kept],
        intrinsics=all_round.intrinsics[kept],
        names=[all_round.names[i] for i in kept],
        n_found=len(kept),
    )


def off_axis(given: Views, axis_m: np.ndarray, off_m: float) -> Views:
    """Return the views with poses by which the turntable's upright axis is `off_m` from `axis_m` (3,), away from the first view."""
    eyes = np.array([T[:2, 3] - axis_m[:2] for T in given.T_world_cameras])
    outwards = eyes / np.linalg.norm(eyes, axis=1, keepdims=True)
    shifts = off_m * (outwards - outwards[0])
    poses = [
        frames.transform(np.eye(3), np.array([*shift, 0.0])) @ T
        for shift, T in zip(shifts, given.T_world_cameras, strict=True)
    ]
    return replace(given, T_world_cameras=poses)


def one_moved(given: Views, shift_m: float) -> Views:
    """Return the views with the last one's pose moved along the table."""
    *others, last = given.T_world_cameras
    aside = frames.transform(np.eye(3), np.array([shift_m, 0.0, 0.0]))
    return replace(given, T_world_cameras=[*others, aside @ last])


def shaken(given: Views, shift_m: float, turn_deg: float, seed: int = 3) -> Views:
    """Return the views with poses that are off at random: standard deviations of each coordinate of shift and turn."""
    rng = np.random.default_rng(seed)
    poses = []
    for T in given.T_world_cameras:
        turn = Rotation.from_rotvec(np.radians(rng.normal(0.0, turn_deg, 3))).as_matrix()
        poses.append(frames.transform(turn @ T[:3, :3], T[:3, 3] + rng.normal(0.0, shift_m, 3)))
    return replace(given, T_world_cameras=poses)
