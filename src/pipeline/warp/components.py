"""Points that were chosen by their labels, as connected pieces."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pipeline.warp.clouds import Cloud


def components(cloud: Cloud, chosen: np.ndarray) -> list[np.ndarray]:
    """Return the rows of a cloud's chosen points (N,) as connected pieces, largest first; see `Cloud.link_m`."""
    rows = np.flatnonzero(chosen)
    if len(rows) == 0:
        return []
    pairs = cKDTree(cloud.points_m[rows]).query_pairs(cloud.link_m, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(rows), len(rows)))
    count, label = connected_components(graph, directed=False)
    order = np.argsort(-np.bincount(label, minlength=count), kind="stable")
    return [rows[label == component] for component in order]
