"""Primitives conditioned on the objects (section IV-C): the warped parameters as further dimensions of the distribution.

Weights and logarithms of parameters are jointly Gaussian. Given a pair's parameters, what is left is a primitive of that pair: its
mean is linear in the logarithms, its covariance that of the demonstrations about this mean, and more the further the
pair is from those shown.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from pipeline.errors import PipelineError
from pipeline.motion import basis, fitting, saved
from pipeline.motion.promp import ProMP

CONDITIONED = "conditioned"
HELD = ("radius_m", "height_m", "tilt_reference_rad", "volume_m3")
TARGET = ("radius_m", "height_m")
# Standard deviation with which a logarithm of a warped parameter is known; a warp is within a few per cent.
KNOWN_TO = 0.03


def log_parameters(parameters: pd.DataFrame, mapping: str, held: str, target: str) -> np.ndarray:
    """Return the logarithms (K,) of a pair's warped parameters: `HELD` of the held container, `TARGET` of the second."""
    table = parameters[parameters["mapping"] == mapping].set_index("object")
    missing = [name for name in (held, target) if name not in table.index]
    if missing:
        raise PipelineError(
            f"{missing[0]}: expected its warped parameters by {mapping}, found none; is it in data/raw?"
        )
    values = [*(table.loc[held, list(HELD)]), *(table.loc[target, list(TARGET)])]
    return np.log(np.array(values, float))


@dataclass(frozen=True)
class ConditionedProMP:
    """A primitive for any pair. slope (D*B, K): of the weights by log parameters; centre, spread (K, K): of the pairs shown."""

    residual: ProMP
    slope: np.ndarray
    centre: np.ndarray
    spread: np.ndarray

    @classmethod
    def fit(
        cls,
        trajectories: Sequence[np.ndarray],
        contexts: np.ndarray,
        phases: Sequence[np.ndarray] | None = None,
        **settings: Any,
    ) -> "ConditionedProMP":
        """Learn from trajectories (T_i, D) of pairs with log parameters `contexts` (N, K); settings as of `ProMP.fit`.

        Errors: fewer than two pairs.
        """
        contexts = np.asarray(contexts, float)
        if len(np.unique(contexts, axis=0)) < 2:
            raise PipelineError(
                "conditioned primitives: expected demonstrations with at least two pairs, found one; scale a primitive instead"
            )
        first = ProMP.fit(trajectories, phases, **settings)
        phases = [np.linspace(0.0, 1.0, len(one)) for one in trajectories] if phases is None else phases
        values = [basis.values(phase, first.n_basis, first.width) for phase in phases]
        weights = np.array(
            [
                fitting.regressed(phi, np.asarray(y, float))
                for phi, y in zip(values, trajectories, strict=True)
            ]
        )
        centre = contexts.mean(axis=0)
        off = contexts - centre
        scatter = off.T @ off + len(contexts) * KNOWN_TO**2 * np.eye(off.shape[1])
        slope = np.linalg.solve(scatter, off.T @ (weights - weights.mean(axis=0))).T
        about = [
            np.asarray(y, float) - phi @ (slope @ c).reshape(-1, first.n_basis).T
            for phi, y, c in zip(values, trajectories, off, strict=True)
        ]
        residual = ProMP.fit(about, phases, **settings)
        # What the slopes have fitted away is missing about them, as in any regression's residual variance.
        fitted = float(np.trace(np.linalg.solve(scatter, off.T @ off)))
        wider = len(contexts) / (len(contexts) - fitted)
        residual = replace(residual, weights_covariance=wider * residual.weights_covariance)
        return cls(residual, slope, centre, scatter)

    def given(self, context: np.ndarray) -> ProMP:
        """Return the primitive of the pair with these log parameters (K,)."""
        off = np.asarray(context, float) - self.centre
        # Of a regression's prediction: what the demonstrations leave open grows with the distance from them.
        further = 1.0 + float(off @ np.linalg.solve(self.spread, off))
        return replace(
            self.residual,
            weights_mean=self.residual.weights_mean + self.slope @ off,
            weights_covariance=self.residual.weights_covariance * further,
        )

    def to_json(self) -> dict[str, Any]:
        """Return what `from_json` reads: the primitive of what is left, and the regression of the weights."""
        arrays = {"slope": self.slope, "centre": self.centre, "spread": self.spread}
        return {
            "residual": self.residual.to_json(),
            **{key: value.tolist() for key, value in arrays.items()},
        }

    @classmethod
    def from_json(cls, content: Any, where: str = "promp.json") -> "ConditionedProMP":
        """Return the primitive that `to_json` gave; `where` names the file in errors."""
        keys = ("residual", "slope", "centre", "spread")
        if not isinstance(content, dict) or not set(keys) <= set(content):
            raise PipelineError(
                f"{where}: expected a conditioned primitive with {' '.join(keys)}, found something else; make it again"
            )
        residual, n = ProMP.from_json(content["residual"], where), np.size(content["centre"])
        shapes = {"slope": (len(residual.weights_mean), n), "centre": (n,), "spread": (n, n)}
        arrays = {key: saved.array(content[key], where, key) for key in shapes}
        for key, shape in shapes.items():
            if arrays[key].shape != shape or not np.isfinite(arrays[key]).all():
                raise PipelineError(
                    f"{where}: expected {key} of shape {shape} without gaps, found {arrays[key].shape}; make it again"
                )
        return cls(residual, **arrays)
