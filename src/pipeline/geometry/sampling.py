"""Points on triangle meshes: uniform, and evenly spaced."""

import numba
import numpy as np
from scipy.sparse import coo_matrix
from scipy.spatial import cKDTree

_CANDIDATES = 5  # candidates a point kept, Yuksel 2015, section 4
_EXPONENT = 8  # of the weight, Yuksel 2015, equation 2


def triangle_areas_and_normals(
    vertices_m: np.ndarray, triangles: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return areas (F,) in m² and unit normals (F, 3) of triangles (F, 3); the normal of an empty triangle is zero."""
    cross = crossed(vertices_m, triangles)
    double = np.sqrt(cross[:, 0] ** 2 + cross[:, 1] ** 2 + cross[:, 2] ** 2)
    return double / 2, cross / np.maximum(double, 1e-300)[:, None]


def crossed(vertices_m: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return vectors (F, 3) along the normals of triangles (F, 3), twice as long as their areas in m²."""
    return _crossed(np.ascontiguousarray(vertices_m, float), np.ascontiguousarray(triangles, np.int64))


@numba.njit(cache=True)
def _crossed(vertices, triangles):  # type: ignore[no-untyped-def]
    cross = np.empty((len(triangles), 3))
    for f in range(len(triangles)):
        a, b, c = vertices[triangles[f, 0]], vertices[triangles[f, 1]], vertices[triangles[f, 2]]
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            cross[f, k] = (b[i] - a[i]) * (c[j] - a[j]) - (b[j] - a[j]) * (c[i] - a[i])
    return cross


def uniform_points(
    vertices_m: np.ndarray, triangles: np.ndarray, n: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return n points (n, 3) uniform on the surface and their triangles (n,).

    The triangles are drawn by stratified sampling of the area, which leaves fewer gaps than independent draws.
    """
    area, _ = triangle_areas_and_normals(vertices_m, triangles)
    cumulated = np.cumsum(area)
    places = (np.arange(n) + rng.random(n)) / n * cumulated[-1]
    triangle = np.minimum(np.searchsorted(cumulated, places, side="right"), len(triangles) - 1)
    root, v = np.sqrt(rng.random(n))[:, None], rng.random(n)[:, None]
    a, b, c = np.moveaxis(vertices_m[triangles[triangle]], 1, 0)
    return (1 - root) * a + root * (1 - v) * b + root * v * c, triangle


def even_points(
    vertices_m: np.ndarray, triangles: np.ndarray, n: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return n points (n, 3) spaced evenly on the surface and their triangles (n,).

    Sample elimination (Yuksel, "Sample elimination for generating Poisson disk sample sets", 2015) of uniform points; the
    two sides of a thin wall are spaced on their own.
    """
    points, triangle = uniform_points(vertices_m, triangles, _CANDIDATES * n, rng)
    area, normals = triangle_areas_and_normals(vertices_m, triangles)
    radius = np.sqrt(area.sum() / (2 * np.sqrt(3) * n))
    pairs = cKDTree(points).query_pairs(2 * radius, output_type="ndarray")
    weight = _weights(points, normals[triangle], pairs, 2 * radius)
    one_way = coo_matrix((weight, pairs.T), shape=(len(points), len(points))).tocsr()
    both = (one_way + one_way.T).tocsr()
    both.sort_indices()
    kept = _eliminate(both.indptr.astype(np.int64), both.indices.astype(np.int64), both.data, n)
    return points[kept], triangle[kept]


@numba.njit(cache=True)
def _weights(points, normals, pairs, reach):  # type: ignore[no-untyped-def]
    """Return how much the points of each pair (P, 2) crowd each other: the nearer the more, not at all on opposite sides."""
    weights = np.zeros(len(pairs))
    for p in range(len(pairs)):
        i, j = pairs[p]
        cosine, square = 0.0, 0.0
        for k in range(3):
            cosine += normals[i, k] * normals[j, k]
            square += (points[i, k] - points[j, k]) ** 2
        if cosine > 0:
            weights[p] = (1 - min(np.sqrt(square) / reach, 1)) ** _EXPONENT
    return weights


@numba.njit(cache=True)
def _eliminate(start, neighbour, weight, n):  # type: ignore[no-untyped-def]
    """Remove the most crowded point until n remain: a binary heap of points with the sums of their pairs' weights."""
    count = len(start) - 1
    crowding = np.zeros(count)
    for i in range(count):
        for k in range(start[i], start[i + 1]):
            crowding[i] += weight[k]
    heap, place = np.arange(count), np.arange(count)
    size = count
    for i in range(size // 2 - 1, -1, -1):
        _sink(heap, place, crowding, i, size)
    kept = np.ones(count, dtype=np.bool_)
    while size > n:
        top = heap[0]
        kept[top] = False
        size -= 1
        heap[0] = heap[size]
        place[heap[0]] = 0
        _sink(heap, place, crowding, 0, size)
        for k in range(start[top], start[top + 1]):
            other = neighbour[k]
            if kept[other]:
                crowding[other] -= weight[k]
                _sink(heap, place, crowding, place[other], size)
    return np.nonzero(kept)[0]


@numba.njit(cache=True)
def _sink(heap, place, crowding, i, size):  # type: ignore[no-untyped-def]
    while True:
        child = 2 * i + 1
        if child >= size:
            return
        if child + 1 < size and crowding[heap[child + 1]] > crowding[heap[child]]:
            child += 1
        if crowding[heap[child]] <= crowding[heap[i]]:
            return
        heap[i], heap[child] = heap[child], heap[i]
        place[heap[i]], place[heap[child]] = i, child
        i = child
