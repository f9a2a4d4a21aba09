"""Probabilistic movement primitives (section III-B; Paraschos et al. 2013): a Gaussian over trajectories.

y(phase) = basis(phase) · w + noise, w ~ N(weights_mean, weights_covariance), noise white and apart for each dimension. All
numbers are in the units of the trajectories it was fitted to: metres and radians, or dimensionless (`motion.scaling`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipeline.errors import PipelineError
from pipeline.motion import basis

# Lip of the held cup relative to the centre of the second's opening in the pair's task frame (x horizontal along the pour, y
# across, z up), and the tilt (section II-D).
DIMENSIONS = ("x", "y", "z", "tilt")
UNITS = ("m", "m", "m", "rad")
DIMENSIONLESS = ("1", "1", "1", "1")
# Of the largest variance: keeps square roots of covariances real after conditioning.
_ROUNDING = 1e-12


@dataclass(frozen=True)
class ProMP:
    """A distribution over trajectories of D dimensions.

    weights_mean (D*B,), weights_covariance (D*B, D*B): dimension by dimension; noise_variance (D,); width: standard deviation of a
    basis function in the phase; duration_s: mean of the demonstrations'.
    """

    weights_mean: np.ndarray
    weights_covariance: np.ndarray
    noise_variance: np.ndarray
    n_basis: int
    width: float
    dimensions: tuple[str, ...] = DIMENSIONS
    units: tuple[str, ...] = UNITS
    duration_s: float = 1.0

    @classmethod
    def fit(
        cls, trajectories: Sequence[np.ndarray], phases: Sequence[np.ndarray] | None = None, **settings: Any
    ) -> "ProMP":
        """Learn from trajectories (T_i, D) at phases (T_i,), evenly from 0 to 1 if not given.

        settings: those of `motion.fitting.estimate`, and the fields dimensions, units, duration_s.
        """
        from pipeline.motion import fitting

        about = {key: settings.pop(key) for key in ("dimensions", "units", "duration_s") if key in settings}
        return cls(**fitting.estimate(trajectories, phases, **settings), **about)

    def mean(self, phase: np.ndarray) -> np.ndarray:
        """Return the mean trajectory (T, D) at phases (T,) from 0 to 1."""
        return basis.values(phase, self.n_basis, self.width) @ self._by_dimension(self.weights_mean)

    def covariance(self, phase: np.ndarray) -> np.ndarray:
        """Return the covariance (T, D, D) of a value at each of the phases (T,), noise included.

        The mean ± 1.96 standard deviations holds 95 % of new trajectories' values, also where few were shown.
        """
        H = self._blocks(phase)
        return H @ self.weights_covariance @ H.transpose(0, 2, 1) + np.diag(self.noise_variance)

    def deviation(self, phase: np.ndarray) -> np.ndarray:
        """Return the standard deviations (T, D) at phases (T,), noise included."""
        return np.sqrt(np.diagonal(self.covariance(phase), axis1=1, axis2=2))

    def condition(
        self,
        phase: float,
        value: np.ndarray,
        variance: float | np.ndarray,
        dimensions: Sequence[str] | None = None,
    ) -> "ProMP":
        """Return the primitive given that it passes `value` (K,) at a phase: a start state or a via-point.

        variance: of the value, one or (K,), in squared units; dimensions: the names of the K that are given, all if None.
        """
        names = self.dimensions if dimensions is None else tuple(dimensions)
        unknown = [name for name in names if name not in self.dimensions]
        if unknown or len(names) != np.size(value) or not 0.0 <= phase <= 1.0:
            raise PipelineError(
                f"condition: expected a phase from 0 to 1 and one value for each of some of the dimensions "
                f"{' '.join(self.dimensions)}, found phase {phase:g}, {np.size(value)} values for {' '.join(names)}; correct them"
            )
        H = self._blocks(np.array([phase]))[0][[self.dimensions.index(name) for name in names]]
        return self._given(H, np.atleast_1d(np.asarray(value, float)), np.asarray(variance, float))

    def _given(self, H: np.ndarray, value: np.ndarray, variance: np.ndarray) -> "ProMP":
        cross = self.weights_covariance @ H.T
        gain = np.linalg.solve(H @ cross + np.eye(len(value)) * variance, cross.T).T
        remaining = np.eye(len(self.weights_mean)) - gain @ H
        # Joseph's form stays positive when the variance is nearly nothing.
        covariance = remaining @ self.weights_covariance @ remaining.T + gain * variance @ gain.T
        return replace(
            self,
            weights_mean=self.weights_mean + gain @ (value - H @ self.weights_mean),
            weights_covariance=(covariance + covariance.T) / 2.0,
        )

    def sample(self, phase: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return one trajectory (T, D), drawn from the distribution without the noise: smooth, for a robot to follow."""
        return self.samples(phase, 1, rng)[0]

    def samples(self, phase: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
        """Return trajectories (count, T, D) without noise."""
        n = len(self.weights_mean)
        lift = _ROUNDING * max(self.weights_covariance.diagonal().max(), _ROUNDING)
        root = np.linalg.cholesky(self.weights_covariance + lift * np.eye(n))
        weights = self.weights_mean + rng.standard_normal((count, n)) @ root.T
        return np.einsum(
            "tb,ndb->ntd",
            basis.values(phase, self.n_basis, self.width),
            weights.reshape(count, -1, self.n_basis),
        )

    def scaled(self, factors: np.ndarray, units: tuple[str, ...] | None = None) -> "ProMP":
        """Return the primitive of trajectories times `factors` (D,): from dimensionless to a pair's metres and radians."""
        scale = np.repeat(np.asarray(factors, float), self.n_basis)
        return replace(
            self,
            weights_mean=self.weights_mean * scale,
            weights_covariance=self.weights_covariance * np.outer(scale, scale),
            noise_variance=self.noise_variance * np.asarray(factors, float) ** 2,
            units=units or self.units,
        )

    def to_json(self) -> dict[str, Any]:
        """Return the primitive as `motion.saved.SCHEMA` says it."""
        return {
            "dimensions": list(self.dimensions),
            "units": list(self.units),
            "duration_s": float(self.duration_s),
            "n_basis": int(self.n_basis),
            "width": float(self.width),
            "weights_mean": self.weights_mean.tolist(),
            "weights_covariance": self.weights_covariance.tolist(),
            "noise_variance": self.noise_variance.tolist(),
        }

    @classmethod
    def from_json(cls, content: Any, where: str = "promp.json") -> "ProMP":
        """Return the primitive that `to_json` gave; `where` names the file in errors."""
        from pipeline.motion import saved

        return cls(**saved.fields(content, where))

    def _blocks(self, phase: np.ndarray) -> np.ndarray:
        return basis.blocks(phase, self.n_basis, self.width, len(self.dimensions))

    def _by_dimension(self, weights: np.ndarray) -> np.ndarray:
        return weights.reshape(len(self.dimensions), self.n_basis).T
