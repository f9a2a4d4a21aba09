"""Convex hulls: their volume, points inside them, and the tilt that raises half of them above a lip."""

import numpy as np
from scipy.spatial import ConvexHull
from scipy.stats import qmc


def hull_volume_m3(points_m: np.ndarray) -> float:
    """Return the volume of the convex hull of points (N, 3)."""
    return float(ConvexHull(points_m).volume)


def points_in_hull(points_m: np.ndarray, n: int) -> np.ndarray:
    """Return about `n` points (M, 3) spread evenly in the convex hull of points (N, 3).

    They are the part inside the hull of a Sobol sequence in its bounding box: no seed, and the error of a mean over
    them falls almost with 1/n.
    """
    hull = ConvexHull(points_m)
    low, high = hull.min_bound, hull.max_bound
    share = hull.volume / float(np.prod(high - low))
    exponent = int(np.ceil(np.log2(n / share)))
    candidates = qmc.scale(qmc.Sobol(3, scramble=False).random_base2(exponent), low, high)
    return candidates[_inside(hull, candidates)]


def _inside(hull: ConvexHull, points_m: np.ndarray) -> np.ndarray:
    """Return which points (N, 3) are on the inner side of every facet; a few thousand at a time, to spare memory."""
    outward, offsets_m = hull.equations[:, :3].T, hull.equations[:, 3]
    blocks = np.array_split(points_m, len(points_m) // 4096 + 1)
    return np.concatenate([(block @ outward <= -offsets_m).all(axis=1) for block in blocks])


def raising_tilt_rad(points_m: np.ndarray, lip_m: np.ndarray, opening_m: np.ndarray) -> np.ndarray:
    """Return for points (N, 3) the tilt about `lip_m` (3,) that raises each to the lip's height; ≤ 0: above it upright.

    The tilt turns the upright object (z up) about the horizontal axis through the lip that is perpendicular to the
    direction from the opening's centre `opening_m` (3,) to the lip, lip side down. A point at depth d below the lip
    and distance u behind it is level with the lip at the angle atan2(d, u).
    """
    outward = lip_m[:2] - opening_m[:2]
    outward = outward / np.linalg.norm(outward)
    behind = (lip_m[:2] - points_m[:, :2]) @ outward
    return np.arctan2(lip_m[2] - points_m[:, 2], behind)


def tilt_reference_rad(inside_m: np.ndarray, lip_m: np.ndarray, opening_m: np.ndarray) -> float:
    """Return the tilt at which half of a body is above its lip (section II-D); `inside_m` (N, 3) fills it evenly.

    A point rises above the lip at its own angle, once, so the tilt that raises half of them is the median.
    """
    return float(np.median(raising_tilt_rad(inside_m, lip_m, opening_m)))
