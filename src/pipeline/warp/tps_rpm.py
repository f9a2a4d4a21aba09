"""Robust point matching by thin-plate splines (Chui & Rangarajan 2003; Schulman et al. 2013) from the coarse alignment on."""

from dataclasses import replace

import numpy as np
from scipy.spatial.distance import cdist

from pipeline.warp import nearest_neighbour, splines
from pipeline.warp.clouds import Cloud, drawn, subset
from pipeline.warp.deformation import Chain, Kernels
from pipeline.warp.warp import Warp

SOURCE_POINTS, TARGET_POINTS, CENTRES = 500, 700, 150
ROUNDS, SINKHORN = 20, 10
# Both are annealed together, geometrically. Reach: the root of the temperature, in spreads of the target.
REACH, STIFFNESS = (0.5, 0.05), (1.0, 1e-2)
# A point whose counterparts are all further than this many reaches has none.
CUT = 3.0


def fit(source: Cloud, target: Cloud, *, rng: np.random.Generator) -> Warp:
    """Return the coarse alignment bent by a spline through soft correspondences, which sharpen as it gets softer.

    Like coherent point drift it sees points alone, no normals.
    """
    warp = nearest_neighbour.coarse(source, target)
    from_m = drawn(subset(warp.aligned, warp.has_counterpart), SOURCE_POINTS, rng).points_m
    to_m = drawn(target, TARGET_POINTS, rng).points_m
    centres_m = from_m[:: max(1, len(from_m) // CENTRES)]
    size_m = float(np.linalg.norm(to_m.std(axis=0)))
    bent, weights = Kernels(np.eye(3), np.zeros(3), centres_m, np.zeros_like(centres_m)), np.ones(len(from_m))
    for reach, stiffness in zip(np.geomspace(*REACH, ROUNDS), np.geomspace(*STIFFNESS, ROUNDS), strict=True):
        match = correspondence(bent.map(from_m), to_m, reach * size_m)
        weights = match.sum(axis=1)
        inliers = weights > 1e-9
        means_m = match[inliers] @ to_m / weights[inliers, None]
        bent = splines.fit(from_m[inliers], means_m, centres_m, stiffness, weights[inliers])
    diagnostics = {
        "rounds": float(ROUNDS),
        "matched_share": float(weights.mean()),
        "reach_m": REACH[1] * size_m,
    }
    return replace(warp, method="tps_rpm", deformation=Chain(warp.deformation, bent), diagnostics=diagnostics)


def correspondence(from_m: np.ndarray, to_m: np.ndarray, reach_m: float) -> np.ndarray:
    """Return how much (N, M) each of points (N, 3) has to do with each of points (M, 3).

    Gaussian in the distance, then rows are brought to sum to 1 and columns to N/M in turn (Sinkhorn), each with a slack for a
    point that has no counterpart: what is in it is missing from the sum.
    """
    match = np.exp(-cdist(from_m, to_m, "sqeuclidean") / (2.0 * reach_m**2))
    slack = np.exp(-(CUT**2) / 2.0)
    rows, columns = np.full(len(from_m), slack), np.full(len(to_m), slack)
    share = len(from_m) / len(to_m)
    for _ in range(SINKHORN):
        total = match.sum(axis=0) + columns
        match, columns = match * (share / total), columns * (share / total)
        total = match.sum(axis=1) + rows
        match, rows = match / total[:, None], rows / total
    return match
