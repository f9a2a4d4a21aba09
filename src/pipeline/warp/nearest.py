"""Nearest neighbours with agreeing normals: point mapping and label mapping (sections II-B and II-C)."""

import numpy as np
from scipy.spatial import cKDTree

FETCH = 2


def agreeing_neighbours(
    query_m: np.ndarray, query_normals: np.ndarray, points_m: np.ndarray, normals: np.ndarray, k: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return, for queries (N, 3), the k nearest points (M, 3) whose normal has n·n' > 0.

    Neighbours are fetched until k agree or there are no more. Returns indices (N, k), -1 where none is left, and
    distances (N, k) in metres, inf there.
    """
    tree = cKDTree(points_m)
    index = np.full((len(query_m), k), -1)
    distance = np.full((len(query_m), k), np.inf)
    open_rows, fetch = np.arange(len(query_m)), min(FETCH * k, len(points_m))
    while len(open_rows):
        near, candidate = tree.query(query_m[open_rows], k=fetch)
        near, candidate = near.reshape(-1, fetch), candidate.reshape(-1, fetch)
        agrees = np.einsum("nkc,nc->nk", normals[candidate], query_normals[open_rows]) > 0.0
        first = np.argsort(~agrees, axis=1, kind="stable")[:, :k]
        found = np.take_along_axis(agrees, first, axis=1)
        index[open_rows] = np.where(found, np.take_along_axis(candidate, first, axis=1), -1)
        distance[open_rows] = np.where(found, np.take_along_axis(near, first, axis=1), np.inf)
        if fetch == len(points_m):
            break
        open_rows, fetch = open_rows[~found.all(axis=1)], min(4 * fetch, len(points_m))
    return index, distance


def mean_of_neighbours(values: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Return the mean (N, C) of rows of values (M, C) at indices (N, k), leaving out -1; rows without any are nan."""
    found = index >= 0
    total = np.einsum("nkc,nk->nc", values[index], found.astype(float))
    count = found.sum(axis=1, keepdims=True)
    return np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)


def majority_of_neighbours(labels: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Return (N, P bool): the labels (M, P bool) that more than half of the neighbours (N, k) have."""
    return np.nan_to_num(mean_of_neighbours(labels.astype(float), index)) > 0.5
