"""Normalised radial basis functions of the phase, and the step from weights to values at their centres."""

import numpy as np

# Standard deviation of a basis function, in distances between centres: neighbours overlap, and the centres' values still tell
# the weights apart (condition number about 15).
WIDTH_SPACINGS = 0.75


def centres(n_basis: int) -> np.ndarray:
    """Return the centres (B,) in the phase: even, from 0 to 1."""
    return np.linspace(0.0, 1.0, n_basis)


def default_width(n_basis: int) -> float:
    """Return the standard deviation of a basis function in the phase."""
    return WIDTH_SPACINGS / (n_basis - 1)


def values(phase: np.ndarray, n_basis: int, width: float) -> np.ndarray:
    """Return the basis functions (T, B) at phases (T,); they sum to one at each phase (Paraschos et al. 2013, section 3)."""
    exponent = -0.5 * ((np.asarray(phase, float)[:, None] - centres(n_basis)) / width) ** 2
    # Far outside all would underflow to zero.
    raised = np.exp(exponent - exponent.max(axis=1, keepdims=True))
    return raised / raised.sum(axis=1, keepdims=True)


def blocks(phase: np.ndarray, n_basis: int, width: float, dimensions: int) -> np.ndarray:
    """Return the matrix (T, D, D*B) that takes all weights, dimension by dimension, to the values of all dimensions."""
    return np.einsum("tb,de->tdeb", values(phase, n_basis, width), np.eye(dimensions)).reshape(
        len(phase), dimensions, dimensions * n_basis
    )
