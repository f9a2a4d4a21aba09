"""Normals where a surface bends, which images and smoothing make round.

In a hollow corner a point faces as the flat side does that it is nearer to. On a tube or a lip nothing is flat: there the mean over
all around is right. Folds of noise face as what is around them.
"""

import numba
import numpy as np
from scipy.sparse import csr_matrix, diags

from pipeline.geometry.sampling import triangle_areas_and_normals

REACH_M = 0.004  # sides are looked for so far around: twice the radius to which a sharp corner is rounded
BENT_M = 0.0002  # the mean height of what is around a point above its tangent plane, or below it, from which on this is a bend
# A vertex speaks for a point that is on its tangent plane and where its own surroundings are flat.
OFF_PLANE_M, ROUGH = 0.0005, 0.15
ALIKE = 0.25  # between normals of one side
FLAT = 0.5  # of the length that the sum of the normals around would have, were all alike: less is a lip, and no normal is wrong
_STEEPEST = 0.6  # cosine between an arc's normal and that of its side; 0.7 where a right angle was made round
_SAME_WALL_COSINE = 0.5  # the other side of a thin wall is near, too
_ROUGH_RINGS, _STEPS = 2, 3


def faced(
    points_m: np.ndarray,
    corners: np.ndarray,
    normals: np.ndarray,
    means: np.ndarray,
    vertices_m: np.ndarray,
    triangles: np.ndarray,
    of_vertices: np.ndarray,
    near: csr_matrix,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the unit normals (N, 3) of points (N, 3) in triangles with these `corners` (N, 3), and what their area counts (N,).

    normals (N, 3): where nothing bends. means (N, 3): where it bends outwards. Where it bends inwards, those of a side, by
    of_vertices (V, 3): unit normals averaged little; near (V, V): 1 at each vertex's neighbours, of which there must be some. It
    is the mode of the normals around: their mean would be neither side's (Fleishman, Cohen-Or & Silva 2005, robust fitting at
    sharp features). Such a point is on an arc, whose area counts as 1/cos² of itself, which is what it covers of the side, seen
    from the arc's centre; elsewhere it counts as 1.
    """
    mean, around = diags(1 / np.diff(near.indptr)) @ near, of_vertices
    for _ in range(_ROUGH_RINGS):
        around = mean @ around
    rough = np.sqrt(np.maximum(1 - (around**2).sum(axis=1), 0.0))
    area, _ = triangle_areas_and_normals(vertices_m, triangles)
    weight = np.bincount(triangles.ravel(), np.repeat(area, 3), len(vertices_m))
    weight *= np.exp(-0.5 * (rough / ROUGH) ** 2)
    found, is_side = _faced(
        points_m, corners, normals, means, vertices_m, of_vertices, weight, near.indptr, near.indices
    )
    cosine = np.clip(np.einsum("nc,nc->n", found, means), _STEEPEST, 1.0)
    return found, np.where(is_side, 1.0 / cosine**2, 1.0)


@numba.njit(cache=True)
def _faced(points, corners, normals, means, vertices, of_vertices, weight, start, neighbour):  # type: ignore[no-untyped-def]
    found, is_side = normals.copy(), np.zeros(len(points), np.bool_)
    asked_by = np.full(len(vertices), -1)
    around, votes = np.zeros(len(vertices), np.int64), np.zeros(len(vertices))
    for i in range(len(points)):
        count = _gathered(i, points, corners, vertices, start, neighbour, asked_by, around)
        near = around[:count]
        height = _height(points[i], normals[i], vertices, near)
        if _folded(normals[i], near, of_vertices, weight, found[i]):
            continue
        if height < -BENT_M:
            found[i] = means[i]
        elif height > BENT_M:
            for a in range(count):
                votes[a] = _vote(points[i], normals[i], vertices, of_vertices, weight, near[a])
            if votes[:count].sum() > 0:
                found[i], is_side[i] = _mode(near, votes[:count], of_vertices), True
    return found, is_side


@numba.njit(cache=True)
def _gathered(i, points, corners, vertices, start, neighbour, asked_by, around):  # type: ignore[no-untyped-def]
    """Write the vertices within reach of point i along the surface to `around`, and return their number."""
    count, done = 0, 0
    for corner in corners[i]:
        around[count], asked_by[corner] = corner, i
        count += 1
    while done < count:
        for j in neighbour[start[around[done]] : start[around[done] + 1]]:
            if asked_by[j] != i:
                asked_by[j] = i
                apart = 0.0
                for k in range(3):
                    apart += (vertices[j, k] - points[i, k]) ** 2
                if apart < REACH_M**2:
                    around[count] = j
                    count += 1
        done += 1
    return count


@numba.njit(cache=True)
def _folded(normal, near, of_vertices, weight, found):  # type: ignore[no-untyped-def]
    """Return whether a normal (3,) is turned away from what is flat around it, as in a fold; if so, write the mean of that."""
    total, mean, cosine = 0.0, np.zeros(3), 0.0
    for j in near:
        total += weight[j]
        for k in range(3):
            mean[k] += weight[j] * of_vertices[j, k]
    length = np.sqrt((mean**2).sum())
    for k in range(3):
        cosine += mean[k] * normal[k]
    folded = cosine < 0 and length > FLAT * total
    if folded:
        for k in range(3):
            found[k] = mean[k] / length
    return folded


@numba.njit(cache=True)
def _height(point, normal, vertices, near):  # type: ignore[no-untyped-def]
    """Return the mean height of the vertices that are near above a tangent plane."""
    total = 0.0
    for j in near:
        for k in range(3):
            total += (vertices[j, k] - point[k]) * normal[k]
    return total / len(near)


@numba.njit(cache=True)
def _vote(point, normal, vertices, of_vertices, weight, j):  # type: ignore[no-untyped-def]
    """Return how much vertex j's normal counts for a point."""
    off, cosine = 0.0, 0.0
    for k in range(3):
        off += of_vertices[j, k] * (point[k] - vertices[j, k])
        cosine += of_vertices[j, k] * normal[k]
    return weight[j] * np.exp(-0.5 * (off / OFF_PLANE_M) ** 2) if cosine > _SAME_WALL_COSINE else 0.0


@numba.njit(cache=True)
def _mode(near, votes, of_vertices):  # type: ignore[no-untyped-def]
    """Return the unit normal that most votes are for: mean shift from the vertex whose like have most."""
    best, mode = -1.0, np.zeros(3)
    for a in range(len(near)):
        if votes[a] > 0:
            support = np.sqrt((_alike(near, votes, of_vertices, of_vertices[near[a]]) ** 2).sum())
            if support > best:
                best, mode = support, of_vertices[near[a]].copy()
    for _ in range(_STEPS):
        mode = _alike(near, votes, of_vertices, mode)
        mode /= np.sqrt((mode**2).sum())
    return mode


@numba.njit(cache=True)
def _alike(near, votes, of_vertices, normal):  # type: ignore[no-untyped-def]
    """Return the sum (3,) of the votes for normals that are like this one."""
    total = np.zeros(3)
    for a in range(len(near)):
        apart = 0.0
        for k in range(3):
            apart += (of_vertices[near[a], k] - normal[k]) ** 2
        share = votes[a] * np.exp(-0.5 * apart / ALIKE**2)
        for k in range(3):
            total[k] += share * of_vertices[near[a], k]
    return total
