"""What the paper reads off the hull: volume, height, tilt reference. Lengths in metres, object frame, z up."""

import numpy as np
from scipy.spatial import ConvexHull

from pipeline.geometry import hulls
from pipeline.parametrise.library import ingredient, parameter


@ingredient
def hull(container_even_m: np.ndarray) -> ConvexHull:
    """The container points' convex hull, metres.

    Hulls go by the outermost points, and grow with noise: the points are those that `cloud.evened` has averaged.
    """
    return ConvexHull(container_even_m)


@parameter("m3")
def volume_m3(hull: ConvexHull) -> float:
    """Volume of the container: that of its points' convex hull, V = |conv P|."""
    return float(hull.volume)


@parameter("m")
def height_m(points_m: np.ndarray) -> float:
    """Height of the container: h = max z - min z over all points of a part, the range along the first dimension (up)."""
    return float(np.ptp(points_m[:, 2]))


@ingredient
def hull_inside_m(hull: ConvexHull, hull_points: int) -> np.ndarray:
    """Points (M, 3) that fill the container points' hull evenly."""
    return hulls.points_inside(hull, hull_points)


@parameter("rad")
def tilt_reference_rad(hull_inside_m: np.ndarray, lip_m: np.ndarray, opening_m: np.ndarray) -> float:
    """Tilt reference of the cup alone: the tilt about the lip at which half of the hull's volume is above the lip.

    A point at depth d below the lip and distance u behind it comes level with it at atan2(d, u): the median of these.
    """
    return hulls.tilt_reference_rad(hull_inside_m, lip_m, opening_m)


@ingredient
def tilt_references_rad(hull_inside_m: np.ndarray, rim_m: np.ndarray, opening_m: np.ndarray) -> np.ndarray:
    """Tilt reference with the lip at each of the rim points, in their order (N,)."""
    return hulls.tilt_references_rad(hull_inside_m, rim_m, opening_m)
