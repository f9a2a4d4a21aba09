"""Containers from what `simulate` made ready (NPZ): their solids for Bullet and their own rims."""

from pathlib import Path

import numpy as np

from pipeline.artefacts import read_arrays
from pipeline.execute.cell import Solid
from pipeline.geometry.cavity import lowest_point


def solid(name: str, path: Path) -> Solid:
    """Read a container's solid, object frame."""
    arrays = read_arrays(path)
    pieces = np.split(arrays["pieces_m"].astype(float), np.cumsum(arrays["pieces_counts"])[:-1])
    rim_m, opening_m = arrays["cavity_rim_m"], arrays["cavity_opening_m"]
    radius_m = float(np.linalg.norm((rim_m - opening_m)[:, :2], axis=1).mean())
    coarse = arrays["coarse_vertices_m"], arrays["coarse_triangles"]
    return Solid(name, float(arrays["height_m"]), radius_m, opening_m, pieces, coarse)


def opening_m(path: Path) -> np.ndarray:
    """Return the centre (3,) of a container's opening: the mean of its own rim."""
    return read_arrays(path)["cavity_opening_m"]


def lip_m(path: Path, yaw_rad: float) -> np.ndarray:
    """Return the point (3,) of a container's own rim in the direction `yaw_rad` from its opening."""
    arrays = read_arrays(path)
    offset = arrays["cavity_rim_m"] - arrays["cavity_opening_m"]
    turn = np.angle(np.exp(1j * (np.arctan2(offset[:, 1], offset[:, 0]) - yaw_rad)))
    return arrays["cavity_rim_m"][np.argmin(np.abs(turn))]


def spout_yaw_rad(path: Path) -> float:
    """Return where a container pours to, its own frame: its rim's lowest point, of a level rim that furthest along +x."""
    arrays = read_arrays(path)
    out = lowest_point(arrays["cavity_rim_m"]) - arrays["cavity_opening_m"]
    return float(np.arctan2(out[1], out[0]))
