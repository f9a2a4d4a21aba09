"""What the neighbourhood of a point looks like (section II-B)."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

BLOCK = 500  # points whose neighbourhoods are held at a time: more leave the processor's cache
LEAF = 32  # points of a leaf of the tree, which for hundreds of neighbours may be large


def neighbourhood_features(points_m: np.ndarray, neighbours: Sequence[int]) -> np.ndarray:
    """Return features (N, 4 × len(neighbours)) of points (N, 3) that sample a surface uniformly.

    For each number k of neighbours: the square roots of the eigenvalues of the covariance matrix of the k nearest
    points, in falling order, and the distance from the point to their mean; all divided by the distance to the
    furthest of them. On a uniform cloud of a fixed number of points, k points are a fixed share of the surface: the
    neighbourhoods grow with the object and the features are free of units.
    """
    tree, found = cKDTree(points_m, leafsize=LEAF), []
    for some_m in np.array_split(points_m, -(-len(points_m) // BLOCK)):
        distance, index = tree.query(some_m, k=max(neighbours))
        around_m = points_m[index] - some_m[:, None]
        columns = [_features(around_m[:, :k], distance[:, k - 1 : k]) for k in neighbours]
        found.append(np.hstack(columns))
    return np.concatenate(found)


def _features(around_m: np.ndarray, radius_m: np.ndarray) -> np.ndarray:
    """Return the features of points whose neighbours (N, k, 3) are given as seen from each."""
    mean = around_m.mean(axis=1)
    second = around_m.transpose(0, 2, 1) @ around_m / around_m.shape[1]
    covariance = second - mean[:, :, None] * mean[:, None]
    spread = np.sqrt(np.clip(np.linalg.eigvalsh(covariance)[:, ::-1], 0.0, None))
    return np.hstack([spread, np.linalg.norm(mean, axis=1, keepdims=True)]) / radius_m
