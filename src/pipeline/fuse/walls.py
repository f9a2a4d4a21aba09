"""The two sides of a fused wall: where they meet the outer one gives way, and an unseen one is as far off as others are."""

import numpy as np
from scipy import ndimage
from scipy.sparse import diags
from scipy.spatial import cKDTree

from pipeline.fuse.smoothing import neighbours, vertex_normals

LEAST_WALL_M = 0.0008
REACH_M = 0.003  # the other side is no further than this
OPPOSED_COSINE = -0.5  # between the normals of two sides of a wall
THICKEST_M = 0.012  # what is thicker is no wall
EVENED_M = 0.002  # what is off by more is something else: a handle's root, a foot
# Vertices whose both sides were seen, those nearest in height: their median is the wall's thickness.
AMONG = 201
CALMINGS = 4


def parted(
    vertices_m: np.ndarray, triangles: np.ndarray, inner: np.ndarray, outer: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return vertices (V, 3) with the outer ones (V,) at least `LEAST_WALL_M` from the inner ones (V,) behind them, and the
    share of the outer ones that had to move."""
    normals = vertex_normals(vertices_m, triangles, 1)
    moved, _, thick_m = _through(vertices_m, normals, outer, inner, REACH_M)
    if len(moved) == 0:
        return vertices_m, 0.0
    lacking_m = np.maximum(LEAST_WALL_M - thick_m, 0.0)
    vertices_m = vertices_m.copy()
    vertices_m[moved] += lacking_m[:, None] * normals[moved]
    return vertices_m, float(np.count_nonzero(lacking_m) / np.count_nonzero(outer))


def evened(
    vertices_m: np.ndarray, triangles: np.ndarray, inner: np.ndarray, outer: np.ndarray, seen: np.ndarray
) -> np.ndarray:
    """Return vertices (V, 3), the unseen outer ones (V,) moved along their normals where the inner one behind them was seen.

    The wall is then as thick there as where both its sides were seen at that height.
    """
    normals, height_m = vertex_normals(vertices_m, triangles, 1), vertices_m[:, 2]
    told, behind, thick_m = _through(vertices_m, normals, outer, inner, THICKEST_M)
    both, alone = seen[told] & seen[behind], ~seen[told] & seen[behind]
    moved, moved_thick_m = told[alone], thick_m[alone]
    told, thick_m = told[both], thick_m[both]
    if len(told) < AMONG:
        return vertices_m
    upwards = np.argsort(height_m[told], kind="stable")
    usual_m = ndimage.median_filter(thick_m[upwards], AMONG, mode="nearest")
    step_m = np.zeros(len(vertices_m))
    lacking_m = np.interp(height_m[moved], height_m[told[upwards]], usual_m) - moved_thick_m
    step_m[moved] = np.where(np.abs(lacking_m) < EVENED_M, lacking_m, 0.0)
    near = neighbours(triangles, len(vertices_m))
    mean = diags(1 / np.diff(near.indptr)) @ near
    for _ in range(CALMINGS):
        step_m = np.where(outer & ~seen, mean @ step_m, 0.0)
    return vertices_m + step_m[:, None] * normals


def _through(
    vertices_m: np.ndarray, normals: np.ndarray, own: np.ndarray, others: np.ndarray, reach_m: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which own vertices (K,) have others within reach as their opposite side, which, and how thick (K,) the wall is."""
    own, others = np.flatnonzero(own), np.flatnonzero(others)
    if len(own) == 0 or len(others) == 0:
        return own[:0], others[:0], np.zeros(0)
    gap_m, nearest = cKDTree(vertices_m[others]).query(vertices_m[own], distance_upper_bound=reach_m)
    near = np.isfinite(gap_m)
    own, behind = own[near], others[nearest[near]]
    opposed = np.einsum("vc,vc->v", normals[own], normals[behind]) < OPPOSED_COSINE
    own, behind = own[opposed], behind[opposed]
    return own, behind, np.einsum("vc,vc->v", vertices_m[own] - vertices_m[behind], normals[own])
