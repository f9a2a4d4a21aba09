"""A closed surface drawn to what was measured of it: each side of a wall by the pixels that face it, lips by their outlines."""

import numpy as np
from scipy.sparse import csr_matrix, diags

from pipeline.fuse.measuring import offsets, outlines
from pipeline.fuse.planes import Planes
from pipeline.fuse.smoothing import neighbours, smoothed, vertex_normals

ROUNDS = 2
REACH_M = 0.003  # pixels further off show something else
# The shift of a vertex counts as much as this weight of pixels when it is its neighbours' mean.
STIFFNESS, SWEEPS = 1.0, 30
SMOOTHINGS, TAUBIN = 30, (0.6, -0.62)  # keeps waves longer than 7 edges (Taubin 1995, section 3)
_NORMAL_RINGS = 2
# Where the normals of the neighbourhood (so many rings) have a shorter mean, the surface is an edge. There planes are fitted
# across it and count less, and an outline counts as much as half a pixel.
_EDGE_RINGS, EDGE_MEAN, EDGE_PLANES, OUTLINE_WEIGHT = 4, 0.95, 0.1, 0.5
HOLLOW_SMOOTHING = 0.3  # of the steps of smoothing, where it would fill the corner of floor and wall
FLOOR_M = 0.0003  # the least height of what is above the table


def refined(
    vertices_m: np.ndarray, triangles: np.ndarray, base: np.ndarray, excess_m: np.ndarray, seen_by: Planes
) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (V, 3) drawn to the planes that face them, and the sum of the cosines (V,) under which they were seen.

    vertices_m, triangles: closed, object frame, too thick by `excess_m` (V,) at each vertex. base (V,): what stands on the
    table, which stays at its height. What was not seen follows its neighbours.
    """
    near = neighbours(triangles, len(vertices_m))
    mean = diags(1 / np.diff(near.indptr)) @ near
    move = np.stack([np.ones(len(base)), np.ones(len(base)), ~base], axis=1)
    vertices = smoothed(vertices_m, near.indptr, near.indices, move, 10, (0.5, -0.53))
    vertices = vertices - excess_m[:, None] * move * vertex_normals(vertices, triangles, _NORMAL_RINGS)
    for _ in range(ROUNDS):
        normals = vertex_normals(vertices, triangles, _NORMAL_RINGS)
        convex, hollow = _edges(vertices, normals, mean)
        offset, weight, seen = _measured(vertices, normals, convex, seen_by)
        weight[base] = 0.0
        step = offset
        for _ in range(SWEEPS):
            step = (weight * offset + STIFFNESS * (mean @ step)) / (weight + STIFFNESS)
        calm = move * np.where(hollow, HOLLOW_SMOOTHING, 1.0)[:, None]
        drawn = vertices + step[:, None] * move * normals
        vertices = smoothed(drawn, near.indptr, near.indices, calm, SMOOTHINGS, TAUBIN)
    vertices[~base, 2] = np.maximum(vertices[~base, 2], FLOOR_M)
    return vertices, seen


def _edges(vertices: np.ndarray, normals: np.ndarray, mean: csr_matrix) -> tuple[np.ndarray, np.ndarray]:
    """Return which vertices (V,) are at an edge such as a lip, and which at a hollow one, where a floor meets its wall."""
    around, middle = normals, vertices
    for _ in range(_EDGE_RINGS):
        around, middle = mean @ around, mean @ middle
    edge = np.linalg.norm(around, axis=1) < EDGE_MEAN
    convex = np.einsum("vc,vc->v", middle - vertices, normals) < 0
    return edge & convex, edge & ~convex


def _measured(
    vertices: np.ndarray, normals: np.ndarray, edge: np.ndarray, seen_by: Planes
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the measured offset (V,) along the normals, its weight (V,), and that of pixels that face the vertex (V,)."""
    views = seen_by.plane, seen_by.view, seen_by.projection
    by_planes, seen = offsets(vertices, normals, *views, REACH_M)
    by_outlines, count = outlines(vertices, normals, edge, *views, seen_by.eye)
    weight = np.where(edge, EDGE_PLANES, 1.0) * seen
    total = weight + OUTLINE_WEIGHT * count
    offset = weight * by_planes + OUTLINE_WEIGHT * count * by_outlines
    return offset / np.maximum(total, 1e-12), total, seen
