"""Fit a primitive to few demonstrations: expectation maximisation, shrunk correlations, honest variances.

Ten demonstrations span nine directions of the sixty weights. The covariance is that of a normal-inverse-Wishart posterior whose
prior has the demonstrations' own variances at the basis functions' centres, and correlations that fade with the distance in
phase and are none between dimensions; it counts as `prior_demonstrations`. Variances of few demonstrations are uncertain:
the covariance is widened so that ±1.96 standard deviations are the 95 % prediction interval of Student's t.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from pipeline.errors import PipelineError
from pipeline.motion import basis

# Correlation length of the prior in the phase; a Matérn kernel of order 3/2.
CORRELATED = 0.2
# Smallest standard deviation, in units of the trajectories: 10 micrometres, 10 microradians.
_FLOOR = 1e-5
_ROUNDS, _CONVERGED = 200, 1e-6


def estimate(
    trajectories: Sequence[np.ndarray],
    phases: Sequence[np.ndarray] | None = None,
    *,
    n_basis: int = 15,
    width: float | None = None,
    prior_demonstrations: float = 5.0,
) -> dict[str, Any]:
    """Return weights_mean, weights_covariance, noise_variance, n_basis and width of trajectories (T_i, D) at phases (T_i,)."""
    if len(trajectories) < 2:
        raise PipelineError(
            f"expected at least two demonstrations, found {len(trajectories)}; a distribution needs more"
        )
    width = basis.default_width(n_basis) if width is None else width
    phases = [np.linspace(0.0, 1.0, len(one)) for one in trajectories] if phases is None else phases
    values = [basis.values(phase, n_basis, width) for phase in phases]
    shrink = _Shrinkage(n_basis, width, trajectories[0].shape[1], prior_demonstrations)
    mean, covariance, noise = _maximise(values, [np.asarray(one, float) for one in trajectories], shrink)
    return {
        "weights_mean": mean,
        "weights_covariance": covariance * widening(len(trajectories)),
        "noise_variance": noise,
        "n_basis": n_basis,
        "width": width,
    }


def widening(demonstrations: int) -> float:
    """Return the factor on a sample variance for which ±1.96 standard deviations hold 95 % of new values."""
    from scipy.stats import norm, t

    return float((t.ppf(0.975, demonstrations - 1) / norm.ppf(0.975)) ** 2 * (1.0 + 1.0 / demonstrations))


class _Shrinkage:
    """Takes the scatter of weights (D*B, D*B) to their covariance, correlations drawn to the prior's."""

    def __init__(self, n_basis: int, width: float, dimensions: int, prior: float) -> None:
        at = basis.centres(n_basis)
        distance = np.sqrt(3.0) * np.abs(at[:, None] - at) / CORRELATED
        self.kernel = np.kron(np.eye(dimensions), (1.0 + distance) * np.exp(-distance))
        self.to_values = np.kron(np.eye(dimensions), basis.values(at, n_basis, width))
        self.to_weights = np.linalg.inv(self.to_values)
        self.prior = prior

    def covariance(self, scatter: np.ndarray, count: int) -> np.ndarray:
        """Return the covariance of weights whose scatter about their mean over `count` demonstrations is given."""
        sample = self.to_values @ scatter @ self.to_values.T / (count - 1)
        variance = np.diagonal(sample).clip(min=0.0) + _FLOOR**2
        prior = self.kernel * np.sqrt(np.outer(variance, variance))
        weight = self.prior / (count - 1 + self.prior)
        shrunk = (1.0 - weight) * (sample + _FLOOR**2 * np.eye(len(sample))) + weight * prior
        covariance = self.to_weights @ shrunk @ self.to_weights.T
        return (covariance + covariance.T) / 2.0


def _maximise(
    values: list[np.ndarray], trajectories: list[np.ndarray], shrink: _Shrinkage
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return mean (D*B,) and covariance (D*B, D*B) of the weights and the noise (D,), by expectation maximisation."""
    weights = np.array([regressed(*pair) for pair in zip(values, trajectories, strict=True)])
    count, n_basis = len(weights), values[0].shape[1]
    residuals = [
        y - phi @ w.reshape(-1, n_basis).T for phi, y, w in zip(values, trajectories, weights, strict=True)
    ]
    noise = np.maximum(np.vstack(residuals).var(axis=0), _FLOOR**2)
    spread = np.zeros((weights.shape[1],) * 2)
    for _ in range(_ROUNDS):
        mean = weights.mean(axis=0)
        covariance = shrink.covariance((weights - mean).T @ (weights - mean) + spread, count)
        before = noise
        weights, spread, noise = _expect(values, trajectories, mean, covariance, noise)
        if np.abs(noise / before - 1.0).max() < _CONVERGED:
            break
    mean = weights.mean(axis=0)
    return mean, shrink.covariance((weights - mean).T @ (weights - mean) + spread, count), noise


def regressed(phi: np.ndarray, trajectory: np.ndarray) -> np.ndarray:
    """Return the weights (D*B,) of one trajectory (T, D) by least squares on its basis functions (T, B)."""
    n = phi.shape[1]
    gram = phi.T @ phi
    return np.linalg.solve(gram + 1e-6 * np.trace(gram) / n * np.eye(n), phi.T @ trajectory).T.ravel()


def _expect(
    values: list[np.ndarray],
    trajectories: list[np.ndarray],
    mean: np.ndarray,
    covariance: np.ndarray,
    noise: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return each demonstration's expected weights (N, D*B), the sum of their covariances, and the noise (D,) of the rest."""
    n_basis, dimensions = values[0].shape[1], len(noise)
    precision = np.linalg.inv(covariance)
    weights, spread, squares = [], np.zeros_like(covariance), np.zeros(dimensions)
    for phi, y in zip(values, trajectories, strict=True):
        gram = phi.T @ phi
        V = np.linalg.inv(precision + np.kron(np.diag(1.0 / noise), gram))
        # About the mean, so that no digits are lost to the precision's large numbers.
        off = (y - phi @ mean.reshape(dimensions, n_basis).T) / noise
        w = mean + V @ (phi.T @ off).T.ravel()
        rest = y - phi @ w.reshape(dimensions, n_basis).T
        own = V.reshape(dimensions, n_basis, dimensions, n_basis)
        squares += (rest**2).sum(axis=0) + np.einsum("dbdc,bc->d", own, gram)
        weights.append(w)
        spread += (V + V.T) / 2.0
    total = sum(len(y) for y in trajectories)
    return np.array(weights), spread, np.maximum(squares / total, _FLOOR**2)
