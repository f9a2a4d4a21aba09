"""Values on a mesh's vertices, drawn to those of their neighbours: normals, and the vertices themselves."""

import numba
import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from pipeline.geometry.sampling import crossed

# Rounds of, and width of, the bilateral filter of normals (Zheng et al. 2011): a corner's two sides do not mix.
SHARPENINGS, ALIKE = 5, 0.1


def neighbours(triangles: np.ndarray, n: int) -> csr_matrix:
    """Return the matrix (V, V) that is 1 at the vertices next to each; the mesh is closed."""
    rows, columns = triangles.ravel(), np.roll(triangles, 1, axis=1).ravel()
    # Every edge of a closed surface belongs to two triangles, which run it in opposite directions.
    return coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(n, n)).tocsr()


def vertex_normals(vertices_m: np.ndarray, triangles: np.ndarray, smooth: int) -> np.ndarray:
    """Return unit normals (V, 3): of the triangles around each vertex by area, then averaged `smooth` times."""
    vectors = _around(triangles, crossed(vertices_m, triangles), len(vertices_m))
    for _ in range(smooth):
        vectors = _around(triangles, _of_corners(triangles, vectors), len(vertices_m))
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)


@numba.njit(cache=True)
def _around(triangles, values, n):  # type: ignore[no-untyped-def]
    """Return the sums (n, 3) over the triangles around each vertex of their values (F, 3)."""
    total = np.zeros((n, 3))
    for f in range(len(triangles)):
        for corner in range(3):
            for k in range(3):
                total[triangles[f, corner], k] += values[f, k]
    return total


@numba.njit(cache=True)
def _of_corners(triangles, values):  # type: ignore[no-untyped-def]
    """Return the sums (F, 3) over the corners of each triangle of the vertices' values (V, 3)."""
    total = np.zeros((len(triangles), 3))
    for f in range(len(triangles)):
        for corner in range(3):
            for k in range(3):
                total[f, k] += values[triangles[f, corner], k]
    return total


def sharpened(normals: np.ndarray, near: csr_matrix) -> np.ndarray:
    """Return unit normals (V, 3) averaged with like neighbours'; near (V, V): 1 at neighbours of a closed mesh."""
    for _ in range(SHARPENINGS):
        normals = _alike(near.indptr, near.indices, normals, ALIKE)
    return normals


@numba.njit(cache=True)
def _alike(start, neighbour, normals, width):  # type: ignore[no-untyped-def]
    """Return the normalised means over each vertex and its neighbours, by Gaussian weights of the differences."""
    mean = np.zeros_like(normals)
    for i in range(len(normals)):
        for k in range(3):
            mean[i, k] = normals[i, k]
        for j in neighbour[start[i] : start[i + 1]]:
            apart = 0.0
            for k in range(3):
                apart += (normals[i, k] - normals[j, k]) ** 2
            weight = np.exp(-0.5 * apart / width**2)
            for k in range(3):
                mean[i, k] += weight * normals[j, k]
        length = np.sqrt(mean[i, 0] ** 2 + mean[i, 1] ** 2 + mean[i, 2] ** 2)
        for k in range(3):
            mean[i, k] /= length
    return mean


@numba.njit(cache=True)
def smoothed(vertices, start, neighbour, move, rounds, factors):  # type: ignore[no-untyped-def]
    """Return vertices (V, 3) with short waves smoothed away and volumes kept (Taubin 1995); move (V, 3) weighs the steps."""
    now, after = vertices.copy(), np.zeros_like(vertices)
    # Unsigned: numba then asks of no index whether it counts from the end, which costs a fifth of the time.
    start, neighbour = start.astype(np.uint32), neighbour.astype(np.uint32)
    for step in range(rounds * len(factors)):
        _step(now, after, start, neighbour, move, factors[step % len(factors)])
        now, after = after, now
    return now


@numba.njit(cache=True)
def _step(now, after, start, neighbour, move, factor):  # type: ignore[no-untyped-def]
    """Write vertices (V, 3) moved by a share of the way to the mean of their neighbours to `after`."""
    for i in range(len(now)):
        x, y, z = 0.0, 0.0, 0.0
        for k in range(start[i], start[i + 1]):
            near = neighbour[k]
            x, y, z = x + now[near, 0], y + now[near, 1], z + now[near, 2]
        share = 1.0 / (start[i + 1] - start[i])
        after[i, 0] = now[i, 0] + factor * (x * share - now[i, 0]) * move[i, 0]
        after[i, 1] = now[i, 1] + factor * (y * share - now[i, 1]) * move[i, 1]
        after[i, 2] = now[i, 2] + factor * (z * share - now[i, 2]) * move[i, 2]
