"""Clouds and meshes that hold the table as well as the object: the table is cut away."""

from typing import Any

import numpy as np

from pipeline.errors import PipelineError
from pipeline.fuse import placement, table
from pipeline.fuse.table import INLIER_M, Placement, Plane
from pipeline.geometry import frames
from pipeline.geometry.surface import Surface

TABLE_M = 0.002  # what is lower counts as table
SLIGHTLY_M = 1e-6
SLAB_M = 0.05  # a ground modelled as a slab is thinner
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


def open_above(points_m: np.ndarray, surface: Surface, name: str, rng: np.random.Generator) -> np.ndarray:
    """Return which points (N, 3) of a surface have nothing close above them, as the underside of a table's slab has its top."""
    plane = next(iter(table.planes(points_m, points_m.mean(axis=0)[None], name, rng)))
    height = plane.height(points_m)  # the table's own thickness is less than what stands on it
    up = np.broadcast_to(plane.normal if height.max() > -height.min() else -plane.normal, points_m.shape)
    return surface.hit(points_m + SLIGHTLY_M * up, up) > SLAB_M


def belongs(points_m: np.ndarray, place: Placement) -> np.ndarray:
    """Return which points (N, 3) of the world are the object's, not the table's."""
    points = frames.apply(place.T_object_world, points_m)
    low = (points[:, 2] > TABLE_M) & (points[:, 2] < place.bounds_m[1, 2])
    return low & place.covers(points[:, 0], points[:, 1])


def cut(mesh: Any, place: Placement) -> Any:
    """Return the part of a trimesh that is the object's: long triangles of a wall that goes over into the table are cut at it.

    What is as low as the table but does not reach beyond the object, such as a thin floor, stays.
    """
    import trimesh

    to_world = frames.inverse(place.T_object_world)
    vertices, faces = frames.apply(place.T_object_world, np.asarray(mesh.vertices)), np.asarray(mesh.faces)
    own = place.covers(vertices[:, 0], vertices[:, 1])
    flat = _reaching_beyond(vertices[:, 2] < TABLE_M, faces, own)
    kept = trimesh.Trimesh(vertices, faces[~flat & own[faces].all(axis=1)], process=False)
    vertices, faces, _ = trimesh.intersections.slice_faces_plane(
        vertices, faces[flat], np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, TABLE_M])
    )
    at_cut = vertices[:, 2] < TABLE_M + SLIGHTLY_M
    own = place.covers(vertices[:, 0], vertices[:, 1])
    vertices[at_cut, 2] = 0.0
    upper = trimesh.Trimesh(vertices, faces[own[faces].all(axis=1)], process=False)
    return trimesh.util.concatenate([kept, upper]).apply_transform(to_world)


def _reaching_beyond(low: np.ndarray, faces: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Return which triangles (F,) have low vertices (V,) that hang together with some that are not the object's own (V,)."""
    from trimesh.graph import connected_component_labels

    edges = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    label = connected_component_labels(edges[low[edges].all(axis=1)], node_count=len(low))
    beyond = np.zeros(label.max() + 1, bool)
    beyond[label[low & ~own]] = True
    return (low & beyond[label])[faces].any(axis=1)


def _is_wide(points_m: np.ndarray, plane: Plane, place: Placement) -> bool:
    flat = frames.apply(place.T_object_world, points_m[np.abs(plane.height(points_m)) < INLIER_M])[:, :2]
    spread = np.prod(np.diff(np.quantile(flat, [0.02, 0.98], axis=0), axis=0))
    return bool(spread > WIDER * np.prod(np.ptp(place.bounds_m, axis=0)[:2]))
