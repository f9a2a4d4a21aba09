"""Evenly spaced points with normals on a fused surface."""

import numpy as np

from pipeline.columns import Columns
from pipeline.fuse import bends
from pipeline.fuse.smoothing import neighbours, sharpened, vertex_normals
from pipeline.geometry.sampling import even_points, triangle_areas_and_normals

_BENT_ROUNDS = 2  # of averaging the normals of tubes, lips and edges


def cloud(
    vertices_m: np.ndarray,
    triangles: np.ndarray,
    seen: np.ndarray,
    n: int,
    fused: bool,
    rng: np.random.Generator,
) -> Columns:
    """Return n points as table `cloud`: normals averaged with their like around where fused, `seen` from the vertices'.

    A point's area is that of its share of the surface, projected along the normals around: what the noise roughens by adds none.
    In a corner that was made round it is that of the sides.
    """
    points, triangle = even_points(vertices_m, triangles, n, rng)
    around = triangles[triangle]
    weights = _barycentric(points, vertices_m[around])[..., None]
    area, facets = triangle_areas_and_normals(vertices_m, triangles)
    of_vertices = vertex_normals(vertices_m, triangles, int(fused))
    near = neighbours(triangles, len(vertices_m))
    normals = _interpolated(sharpened(of_vertices, near) if fused else of_vertices, around, weights)
    share = np.clip(np.einsum("nc,nc->n", normals, facets[triangle]), 0.0, 1.0)
    if fused:
        means = _interpolated(vertex_normals(vertices_m, triangles, _BENT_ROUNDS), around, weights)
        normals, stands_for = bends.faced(
            points, around, normals, means, vertices_m, triangles, of_vertices, near
        )
        share *= stands_for
    return {
        **dict(zip(("x_m", "y_m", "z_m", "nx", "ny", "nz"), np.hstack([points, normals]).T, strict=True)),
        "area_m2": area.sum() / n * share,
        "seen": (seen[around] * weights[..., 0]).sum(axis=1) > 0.5,
    }


def _interpolated(of_vertices: np.ndarray, around: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the unit mean (N, 3) of values (V, 3) at the corners `around` (N, 3) of each point's triangle."""
    mean = (of_vertices[around] * weights).sum(axis=1)
    return mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)


def _barycentric(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return the weights (N, 3) of the corners (N, 3, 3) that make the points (N, 3)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    normal = np.cross(b - a, c - a)
    square = np.maximum(np.einsum("ij,ij->i", normal, normal), 1e-300)
    u = np.einsum("ij,ij->i", np.cross(c - b, points - b), normal) / square
    v = np.einsum("ij,ij->i", np.cross(a - c, points - c), normal) / square
    return np.clip(np.stack([u, v, 1 - u - v], axis=-1), 0, 1)
