"""Clouds of demonstration objects for the tests of warping: with true parts, moved, scaled."""

from dataclasses import replace

import numpy as np
from conftest import PARTS, sampled

from pipeline.artefacts import normals, points
from pipeline.geometry.frames import rotation_about
from pipeline.warp.clouds import Cloud


def cloud(name: str, n: int = 6000) -> Cloud:
    """Return a demonstration object with its true parts."""
    table = sampled(name, n)
    parts = table[PARTS].to_numpy()
    return Cloud(name, points(table), normals(table), table["area_m2"].to_numpy(), parts)


def moved(body: Cloud, yaw_rad: float, scale: float, shift_m: tuple[float, float, float]) -> Cloud:
    """Return a body turned about the vertical, scaled and shifted."""
    return turned(body, rotation_about(np.array([0.0, 0.0, 1.0]), yaw_rad), scale, np.array(shift_m))


def turned(body: Cloud, R: np.ndarray, scale: float, shift_m: np.ndarray) -> Cloud:
    """Return a body after a rotation (3, 3), scaled and shifted."""
    return replace(
        body,
        points_m=scale * body.points_m @ R.T + shift_m,
        normals=body.normals @ R.T,
        area_m2=scale**2 * body.area_m2,
    )


def iou(found: np.ndarray, true: np.ndarray) -> float:
    """Return intersection over union of two choices of points (N,)."""
    return float((found & true).sum() / (found | true).sum())
