"""Thin-plate splines of three dimensions, fitted to pairs of points."""

import numpy as np

from pipeline.warp.deformation import Kernels, kernel


def fit(
    from_m: np.ndarray,
    to_m: np.ndarray,
    centres_m: np.ndarray,
    stiffness: float,
    weights: np.ndarray | None = None,
) -> Kernels:
    """Return the spline about centres (K, 3) that takes points (N, 3) near points (N, 3).

    It minimises Σ w |f(x) − y|² / Σ w + stiffness · tr(Wᵀ Φ W) / K, the bending energy, over splines that are affine at
    infinity (Σ wₖ = 0, Σ wₖ cₖᵀ = 0). Lengths are in units of the centres' spread, so that `stiffness` has no unit.
    Bookstein 1989; the regression of Rohr et al. 2001, with fewer centres than pairs.
    """
    middle, size = centres_m.mean(axis=0), float(centres_m.std(axis=0).max())
    centres, x, y = ((points - middle) / size for points in (centres_m, from_m, to_m))
    share = np.full(len(x), 1.0 / len(x)) if weights is None else weights / weights.sum()
    free = _affine_at_infinity(centres)
    design = np.hstack([kernel(x, centres, 0.0) @ free, x, np.ones((len(x), 1))])
    bending = free.T @ kernel(centres, centres, 0.0) @ free
    normal = (design * share[:, None]).T @ design
    bends = bending.shape[0]
    normal[:bends, :bends] += stiffness / len(centres) * bending
    right = (design * share[:, None]).T @ (y - x)
    solved = np.linalg.solve(normal + 1e-12 * np.eye(len(normal)), right)
    affine = np.eye(3) + solved[bends : bends + 3].T
    offset_m = middle + size * solved[bends + 3] - affine @ middle
    return Kernels(affine, offset_m, centres_m, free @ solved[:bends])


def _affine_at_infinity(centres: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (K, K − 4) of weights that sum to nothing, as do their moments."""
    polynomials = np.column_stack([np.ones(len(centres)), centres])
    return np.linalg.qr(polynomials, mode="complete")[0][:, 4:]
