"""Closed walls of constant thickness around a lofted middle surface, and the tubes of handles."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

Mesh = tuple[np.ndarray, np.ndarray]
# (x, y, z) of the wall's middle surface at profile points (r, z) and azimuths, all arrays of one shape, metres.
Modifier = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]

_STEP_M = 0.00125
_AZIMUTHS = 160
_CAP_STEPS = 8
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Wall:
    """A closed body: vertices (V, 3), triangles (F, 3) oriented outwards, `inner` (F,) where they face the cavity, and
    the lip's crest (M, 3), the highest line of the rounded lip, ordered by azimuth. Object frame, metres."""

    vertices_m: np.ndarray
    triangles: np.ndarray
    inner: np.ndarray
    lip_edge_m: np.ndarray


def round_section(r: np.ndarray, z: np.ndarray, azimuth_rad: np.ndarray) -> np.ndarray:
    """A surface of revolution about z."""
    return np.stack([r * np.cos(azimuth_rad), r * np.sin(azimuth_rad), z], axis=-1)


def square_section(r: np.ndarray, z: np.ndarray, azimuth_rad: np.ndarray) -> np.ndarray:
    """A square of half width `r` with well rounded corners (a superellipse of exponent 5)."""
    c, s = np.cos(azimuth_rad), np.sin(azimuth_rad)
    return round_section(r / (np.abs(c) ** 5 + np.abs(s) ** 5) ** 0.2, z, azimuth_rad)


def spouted(height_m: float, start_m: float, bulge_m: float, dip_m: float) -> Modifier:
    """A surface of revolution with a spout along +x that grows from height `start_m` and dips at its lip."""

    def section(r: np.ndarray, z: np.ndarray, azimuth_rad: np.ndarray) -> np.ndarray:
        along = np.clip((z - start_m) / (height_m - start_m), 0.0, 1.0)
        across = np.exp(-((np.angle(np.exp(1j * azimuth_rad)) / 0.38) ** 2))
        return round_section(r + bulge_m * across * along**2, z - dip_m * across * along**2, azimuth_rad)

    return section


def wall(controls_m: list[tuple[float, float]], wall_m: float, section: Modifier = round_section) -> Wall:
    """Loft a wall of thickness `wall_m` about the quadratic B-spline with control points (r, z), from the axis to the lip.

    The middle surface is offset by half the wall along its true normals, so the wall is as thick everywhere, corners and
    spout included; the lip is a half circle.
    """
    profile = _profile(np.array(controls_m))
    azimuth = np.linspace(0.0, 2 * np.pi, _AZIMUTHS, endpoint=False)
    middle, normal, edge = _middle_surface(profile, azimuth, section)
    cap, crest = _lip(middle[-1], normal[-1], edge, wall_m)
    outer, inner = middle + wall_m / 2 * normal, middle - wall_m / 2 * normal
    rows = np.concatenate([outer[1:], cap, inner[:0:-1]])
    vertices, triangles, row = _close(rows, outer[0, 0], inner[0, 0])
    return Wall(vertices, triangles, row >= len(outer) - 1 + _CAP_STEPS // 2 - 1, crest)


def _profile(controls: np.ndarray) -> BSpline:
    n = len(controls)
    knots = np.concatenate([[0, 0], np.linspace(0, 1, n - 1), [1, 1]])
    return BSpline(knots, controls, 2)


def _parameters(profile: BSpline) -> np.ndarray:
    """Return parameters of points about `_STEP_M` apart along the profile."""
    u = np.linspace(0, 1, 4001)
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(profile(u), axis=0), axis=1))])
    return np.interp(np.linspace(0, length[-1], int(np.ceil(length[-1] / _STEP_M)) + 1), length, u)


def _middle_surface(
    profile: BSpline, azimuth: np.ndarray, section: Modifier
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points and outward unit normals (S, A, 3), and the unit direction of the lip's edge (A, 3)."""
    u = _parameters(profile)
    step = 1e-6

    def at(u: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
        u, azimuth = np.meshgrid(u, azimuth, indexing="ij")
        r, z = np.moveaxis(profile(u), -1, 0)
        return section(r, z, azimuth)

    along = at(np.minimum(u + step, 1), azimuth) - at(np.maximum(u - step, 0), azimuth)
    across = at(u, azimuth + step) - at(u, azimuth - step)
    normal = np.cross(across, along)
    normal[0] = -_UP
    normal[1:] /= np.linalg.norm(normal[1:], axis=-1, keepdims=True)
    return at(u, azimuth), normal, across[-1] / np.linalg.norm(across[-1], axis=-1, keepdims=True)


def _lip(
    middle: np.ndarray, normal: np.ndarray, edge: np.ndarray, wall_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows of the rounded lip between outside and inside (C - 1, A, 3) and its crest (A, 3)."""
    upward = np.cross(normal, edge)
    crest_angle = np.arctan2(upward[:, 2], normal[:, 2])
    half = np.linspace(0, 1, _CAP_STEPS // 2 + 1)[:, None]
    angle = np.concatenate([half * crest_angle, (crest_angle + half * (np.pi - crest_angle))[1:]])[..., None]
    rows = middle + wall_m / 2 * (np.cos(angle) * normal + np.sin(angle) * upward)
    return rows[1:-1], rows[_CAP_STEPS // 2]


def _close(
    rows: np.ndarray, bottom: np.ndarray, floor: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Join rows of points (S, A, 3) to a surface closed by two poles; also the row below each triangle."""
    n_rows, n = rows.shape[:2]
    vertices = np.concatenate([rows.reshape(-1, 3), [bottom, floor]])
    j = np.arange(n)
    k = (j + 1) % n
    triangles = [np.column_stack([np.full(n, n_rows * n), k, j])]
    for row in np.arange(n_rows - 1) * n:
        triangles.append(np.column_stack([row + j, row + k, row + n + k]))
        triangles.append(np.column_stack([row + j, row + n + k, row + n + j]))
    last = (n_rows - 1) * n
    triangles.append(np.column_stack([last + j, last + k, np.full(n, n_rows * n + 1)]))
    row = np.concatenate([[-1] * n, np.repeat(np.arange(n_rows - 1), 2 * n), [n_rows - 1] * n])
    return vertices, np.concatenate(triangles), row


def tube(path_m: np.ndarray, radius_m: float, sides: int = 32) -> Mesh:
    """Return a closed tube about a path (P, 3) that stays in the plane y = 0."""
    tangent = np.gradient(path_m, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.array([0.0, 1.0, 0.0])
    normal = np.cross(tangent, side)
    angle = np.linspace(0, 2 * np.pi, sides, endpoint=False)[None, :, None]
    rows = path_m[:, None] + radius_m * (np.cos(angle) * side + np.sin(angle) * normal[:, None])
    vertices, triangles, _ = _close(rows, path_m[0], path_m[-1])
    if _volume(vertices, triangles) < 0:
        triangles = triangles[:, ::-1]
    return vertices, triangles


def _volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)
