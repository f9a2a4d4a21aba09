"""Convex hulls: points inside them, and the tilt that raises half of them above a lip."""

import numpy as np
from scipy.spatial import ConvexHull

# 1/g, 1/g², 1/g³ with g⁴ = g + 1: the steps of the R3 sequence, Roberts 2018, "The unreasonable effectiveness of quasirandom
# sequences", whose points leave no gaps.
_STEPS = 1.2207440846057596 ** -np.arange(1.0, 4.0)
# A hull of so many of a hull's corners is within it, and has most of its inside.
_INNER_CORNERS = 200
_LIPS = 16  # at a time


def points_in_hull(points_m: np.ndarray, n: int) -> np.ndarray:
    """Return about `n` points (M, 3) spread evenly in the convex hull of points (N, 3)."""
    return points_inside(ConvexHull(points_m), n)


def points_inside(hull: ConvexHull, n: int) -> np.ndarray:
    """Return about `n` points (M, 3) spread evenly in a convex hull.

    They are the part inside the hull of a quasirandom sequence in its bounding box: no seed, and the error of a mean over
    them falls almost with 1/n.
    """
    low, extent = hull.min_bound, hull.max_bound - hull.min_bound
    count = int(np.ceil(n * np.prod(extent) / hull.volume))
    candidates = low + extent * ((0.5 + np.arange(1, count + 1)[:, None] * _STEPS) % 1.0)
    corners = hull.points[hull.vertices]
    inner = ConvexHull(corners[:: max(1, len(corners) // _INNER_CORNERS)])
    inside = _within(candidates, inner)
    inside[~inside] = _within(candidates[~inside], hull)
    return candidates[inside]


def _within(points_m: np.ndarray, hull: ConvexHull) -> np.ndarray:
    """Return which of points (N, 3) are in a hull."""
    facets = np.unique(hull.equations.round(9), axis=0)
    inside = np.ones(len(points_m), bool)
    parts = max(1, len(facets) // 64)
    for part in range(parts):
        # Facets of all sides at a time: what is outside drops out soon.
        some, rows = facets[part::parts], np.flatnonzero(inside)
        inside[rows] = (points_m[rows] @ some[:, :3].T + some[:, 3] <= 0.0).all(axis=1)
    return inside


def raising_tilt_rad(points_m: np.ndarray, lip_m: np.ndarray, opening_m: np.ndarray) -> np.ndarray:
    """Return for points (N, 3) the tilt about `lip_m` (3,) that raises each to the lip's height; ≤ 0: above it upright.

    The tilt turns the upright object (z up) about the horizontal axis through the lip that is perpendicular to the
    direction from the opening's centre `opening_m` (3,) to the lip, lip side down. A point at depth d below the lip
    and distance u behind it is level with the lip at the angle atan2(d, u).
    """
    return _raising_tilts_rad(points_m, lip_m[None], opening_m)[0]


def _raising_tilts_rad(points_m: np.ndarray, lips_m: np.ndarray, opening_m: np.ndarray) -> np.ndarray:
    """Return the same about each of several lips (L, 3), as (L, N)."""
    outward = lips_m[:, :2] - opening_m[:2]
    outward = outward / np.linalg.norm(outward, axis=1, keepdims=True)
    behind = np.einsum("lc,lc->l", lips_m[:, :2], outward)[:, None] - outward @ points_m[:, :2].T
    return np.arctan2(lips_m[:, 2:] - points_m[:, 2], behind)


def tilt_reference_rad(inside_m: np.ndarray, lip_m: np.ndarray, opening_m: np.ndarray) -> float:
    """Return the tilt at which half of a body is above its lip (section II-D); `inside_m` (N, 3) fills it evenly.

    A point rises above the lip at its own angle, once, so the tilt that raises half of them is the median.
    """
    return float(_medians(_raising_tilts_rad(inside_m, lip_m[None], opening_m))[0])


def tilt_references_rad(inside_m: np.ndarray, lips_m: np.ndarray, opening_m: np.ndarray) -> np.ndarray:
    """Return `tilt_reference_rad` about each of several lips (L, 3), as (L,)."""
    some = np.array_split(lips_m, -(-len(lips_m) // _LIPS))
    return np.concatenate([_medians(_raising_tilts_rad(inside_m, lips, opening_m)) for lips in some])


def _medians(values: np.ndarray) -> np.ndarray:
    """Return the median of each row (L, N), which is reordered: half of the time of NumPy's, which looks for NaN as well."""
    middle = values.shape[1] // 2
    values.partition(middle)
    upper = values[:, middle]
    return upper if values.shape[1] % 2 else (values[:, :middle].max(axis=1) + upper) / 2.0
