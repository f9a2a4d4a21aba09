"""Evenly spaced points with normals on a fused surface."""

import numpy as np
import pandas as pd
from scipy.sparse import coo_matrix

from pipeline.geometry.sampling import even_points, triangle_areas_and_normals


def cloud(
    vertices_m: np.ndarray,
    triangles: np.ndarray,
    seen: np.ndarray,
    n: int,
    smooth: int,
    rng: np.random.Generator,
) -> pd.DataFrame:
    """Return n points as table `cloud`: normals averaged over `smooth` rings of neighbours, `seen` from the vertices'.

    A point's area is that of its share of the surface, projected along its normal: what the noise roughens by adds none.
    """
    points, triangle = even_points(vertices_m, triangles, n, rng)
    corners = triangles[triangle]
    weights = _barycentric(points, vertices_m[corners])[..., None]
    area, facets = triangle_areas_and_normals(vertices_m, triangles)
    normals = (vertex_normals(vertices_m, triangles, smooth)[corners] * weights).sum(axis=1)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    frame = pd.DataFrame(np.hstack([points, normals]), columns=["x_m", "y_m", "z_m", "nx", "ny", "nz"])
    projected = np.clip(np.einsum("nc,nc->n", normals, facets[triangle]), 0.0, 1.0)
    return frame.assign(
        area_m2=area.sum() / n * projected, seen=(seen[corners] * weights[..., 0]).sum(axis=1) > 0.5
    )


def vertex_normals(vertices_m: np.ndarray, triangles: np.ndarray, smooth: int) -> np.ndarray:
    """Return unit normals (V, 3): of the triangles around each vertex by area, then averaged `smooth` times."""
    area, normals = triangle_areas_and_normals(vertices_m, triangles)
    n = len(vertices_m)
    rows, faces = triangles.ravel(), np.repeat(np.arange(len(triangles)), 3)
    around = coo_matrix((np.ones(len(rows)), (rows, faces)), shape=(n, len(triangles))).tocsr()
    vectors = around @ (normals * area[:, None])
    for _ in range(smooth):
        corners = vectors[triangles].sum(axis=1)
        vectors = around @ corners
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)


def _barycentric(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return the weights (N, 3) of the corners (N, 3, 3) that make the points (N, 3)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    normal = np.cross(b - a, c - a)
    square = np.maximum(np.einsum("ij,ij->i", normal, normal), 1e-300)
    u = np.einsum("ij,ij->i", np.cross(c - b, points - b), normal) / square
    v = np.einsum("ij,ij->i", np.cross(a - c, points - c), normal) / square
    return np.clip(np.stack([u, v, 1 - u - v], axis=-1), 0, 1)
