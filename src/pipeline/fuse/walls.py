"""Walls thinner than the camera can tell: where the two sides of a fused surface meet or cross, the outer one gives way."""

import numpy as np
from scipy.spatial import cKDTree

from pipeline.fuse.smoothing import vertex_normals

LEAST_WALL_M = 0.0008
REACH_M = 0.003  # the other side is no further than this
OPPOSED_COSINE = -0.5  # between the normals of two sides of a wall


def parted(
    vertices_m: np.ndarray, triangles: np.ndarray, inner: np.ndarray, outer: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return vertices (V, 3) with the outer ones (V,) at least `LEAST_WALL_M` from the inner ones (V,) behind them, and the
    share of the outer ones that had to move."""
    own, others = np.flatnonzero(outer), np.flatnonzero(inner)
    if len(own) == 0 or len(others) == 0:
        return vertices_m, 0.0
    normals = vertex_normals(vertices_m, triangles, 1)
    gap_m, nearest = cKDTree(vertices_m[others]).query(vertices_m[own], distance_upper_bound=REACH_M)
    near = np.isfinite(gap_m)
    moved, behind = own[near], others[nearest[near]]
    opposed = np.einsum("vc,vc->v", normals[moved], normals[behind]) < OPPOSED_COSINE
    moved, behind = moved[opposed], behind[opposed]
    thick_m = np.einsum("vc,vc->v", vertices_m[moved] - vertices_m[behind], normals[moved])
    lacking_m = np.maximum(LEAST_WALL_M - thick_m, 0.0)
    vertices_m = vertices_m.copy()
    vertices_m[moved] += lacking_m[:, None] * normals[moved]
    return vertices_m, float(np.count_nonzero(lacking_m) / len(own))
