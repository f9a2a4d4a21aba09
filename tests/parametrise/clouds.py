"""Warped clouds whose labels are the truth, for parameters that are to be found in them."""

from functools import cache

import numpy as np
from conftest import sampled

from pipeline.artefacts import normals, points
from pipeline.geometry.frames import rotation_about
from pipeline.parametrise.cloud import Cloud, warped


@cache
def cloud(name: str, scale: float = 1.0, yaw_rad: float = 0.0) -> Cloud:
    """Return a demonstration object's cloud, as large and as turned as is said."""
    table = sampled(name).assign(valid=True)
    R = rotation_about(np.array([0.0, 0.0, 1.0]), yaw_rad)
    table[["x_m", "y_m", "z_m"]] = scale * points(table) @ R.T
    table[["nx", "ny", "nz"]] = normals(table) @ R.T
    table["area_m2"] *= scale**2
    return warped(table, name=name)
