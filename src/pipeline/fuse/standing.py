"""Clouds and meshes that hold the table as well as the object: the table is cut away."""

from typing import Any

import numpy as np

from pipeline.errors import PipelineError
from pipeline.fuse import placement
from pipeline.fuse.table import INLIER_M, Placement, Plane
from pipeline.geometry import frames

TABLE_M = 0.002  # what is lower counts as table
SLIGHTLY_M = 1e-7
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


def cut(mesh: Any, place: Placement) -> Any:
    """Return the part of a trimesh that is the object's, down to the table: long triangles of a wall are cut at it."""
    import trimesh

    vertices = frames.apply(place.T_object_world, np.asarray(mesh.vertices))
    vertices, faces, _ = trimesh.intersections.slice_faces_plane(
        vertices, np.asarray(mesh.faces), np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, TABLE_M])
    )
    own = place.covers(vertices[:, 0], vertices[:, 1])
    at_cut = vertices[:, 2] < TABLE_M + SLIGHTLY_M
    vertices[at_cut, 2] = 0.0
    vertices = frames.apply(frames.inverse(place.T_object_world), vertices)
    return trimesh.Trimesh(vertices, faces[own[faces].all(axis=1)], process=False)


def _is_wide(points_m: np.ndarray, plane: Plane, place: Placement) -> bool:
    flat = frames.apply(place.T_object_world, points_m[np.abs(plane.height(points_m)) < INLIER_M])[:, :2]
    spread = np.prod(np.diff(np.quantile(flat, [0.02, 0.98], axis=0), axis=0))
    return bool(spread > WIDER * np.prod(np.ptp(place.bounds_m, axis=0)[:2]))
