"""Points that were chosen by their labels, as connected pieces."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree


def components(points_m: np.ndarray, chosen: np.ndarray) -> list[np.ndarray]:
    """Return the rows of the chosen points (N, 3), (N,) as connected pieces, largest first.

    Points are linked over twice the distance to a sixth neighbour.
    """
    rows = np.flatnonzero(chosen)
    if len(rows) == 0:
        return []
    link_m = 2.0 * np.median(cKDTree(points_m).query(points_m, k=7)[0][:, 6])
    pairs = cKDTree(points_m[rows]).query_pairs(link_m, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(rows), len(rows)))
    count, label = connected_components(graph, directed=False)
    order = np.argsort(-np.bincount(label, minlength=count), kind="stable")
    return [rows[label == component] for component in order]
