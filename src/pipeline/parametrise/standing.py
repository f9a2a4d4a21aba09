"""How firmly the empty container stands. Lengths in metres, object frame, z up."""

import numpy as np

from pipeline.parametrise.library import parameter

FOOT_M, FOOT_SHARE = (
    0.0015,
    0.005,
)  # what is this near to the table carries, and this share of all points at least


@parameter("rad")
def stability_rad(points_m: np.ndarray, area_m2: np.ndarray) -> float:
    """Tilt at which the empty container tips over: min over the base's edges of atan2(distance to the edge, height).

    Distance and height are the centre of mass's, that of a shell of even thickness: ∑ a p / ∑ a. The base is the convex
    hull, seen from above, of the points within 1.5 mm of the lowest.
    """
    from scipy.spatial import ConvexHull

    centre = area_m2 @ points_m / area_m2.sum()
    low = points_m[:, 2].min()
    foot = max(low + FOOT_M, np.quantile(points_m[:, 2], FOOT_SHARE))
    base = ConvexHull(points_m[points_m[:, 2] <= foot, :2])
    distance = -(base.equations[:, :2] @ centre[:2] + base.equations[:, 2])
    return float(np.arctan2(distance.min(), centre[2] - low))
