"""Clouds and meshes that hold the table as well as the object: the table is cut away."""

import numpy as np

from pipeline.errors import PipelineError
from pipeline.fuse import placement
from pipeline.fuse.table import INLIER_M, Placement, Plane
from pipeline.geometry import frames

TABLE_M = 0.002  # what is lower counts as table
WIDER = 2.5  # a plane that covers so many times the object's area is a table


def found(
    points_m: np.ndarray, on_table: bool | None, name: str, rng: np.random.Generator
) -> Placement | None:
    """Return where the object stands when the points (N, 3) hold a table, too; `on_table` says so, or None: look."""
    if on_table is False:
        return None
    try:
        plane, place = placement.on_a_plane(points_m, name, rng)
    except PipelineError:
        if on_table:
            raise
        return None
    return place if on_table or _is_wide(points_m, plane, place) else None


def belongs(points_m: np.ndarray, place: Placement) -> np.ndarray:
    """Return which points (N, 3) of the world are the object's, not the table's."""
    points = frames.apply(place.T_object_world, points_m)
    low = (points[:, 2] > TABLE_M) & (points[:, 2] < place.bounds_m[1, 2])
    return low & place.covers(points[:, 0], points[:, 1])


def _is_wide(points_m: np.ndarray, plane: Plane, place: Placement) -> bool:
    flat = frames.apply(place.T_object_world, points_m[np.abs(plane.height(points_m)) < INLIER_M])[:, :2]
    spread = np.prod(np.diff(np.quantile(flat, [0.02, 0.98], axis=0), axis=0))
    return bool(spread > WIDER * np.prod(np.ptp(place.bounds_m, axis=0)[:2]))
