"""How true the bands of motor primitives are: `python benchmarks/primitives.py`; what the numbers mean is in docs/primitives.md.

Pours of known distribution, smooth (six hidden factors) or rough (correlated over a tenth of the phase, each dimension by
itself): share of values of new pours in the 95 % bands, and in the bands after conditioning on where a new pour starts. Beside
it movement_primitives, where it is installed.
"""

import argparse
import sys
from collections.abc import Callable

import numpy as np

from pipeline.motion.promp import ProMP

PHASE = np.linspace(0.0, 1.0, 120)
NOISE = 0.01
NEW = 200
_Z = 1.959964

Draw = Callable[[np.random.Generator], np.ndarray]


def smooth(rng: np.random.Generator) -> Draw:
    """Return what draws pours (T, 4): three bumps in the phase, whose weights share six hidden factors."""
    bumps = np.exp(-0.5 * ((PHASE - np.array([[0.0], [0.5], [1.0]])) / 0.25) ** 2)
    loads, mean = 0.05 * rng.standard_normal((3, 4, 6)), rng.standard_normal((3, 4))

    def draw(rng: np.random.Generator) -> np.ndarray:
        weights = mean + loads @ rng.standard_normal(6)
        return bumps.T @ weights + NOISE * rng.standard_normal((len(PHASE), 4))

    return draw


def rough(rng: np.random.Generator) -> Draw:
    """Return what draws pours (T, 4) that vary more and more, correlated over a tenth of the phase."""
    kernel = np.exp(-0.5 * ((PHASE[:, None] - PHASE) / 0.1) ** 2) + 1e-9 * np.eye(len(PHASE))
    root, spread = np.linalg.cholesky(kernel), 0.02 + 0.1 * PHASE[:, None] ** 2

    def draw(rng: np.random.Generator) -> np.ndarray:
        off = spread * (root @ rng.standard_normal((len(PHASE), 4)))
        return np.sin(3.0 * PHASE)[:, None] + off + NOISE * rng.standard_normal((len(PHASE), 4))

    return draw


def inside(promp: ProMP, new: np.ndarray) -> float:
    """Return the share of values of pours (N, T, 4) in the 95 % bands."""
    return float((np.abs(new - promp.mean(PHASE)) < _Z * promp.deviation(PHASE)).mean())


def given_starts(promp: ProMP, new: np.ndarray) -> tuple[float, float]:
    """Return the share in the bands, and the root mean square error, once each pour's start is known."""
    shares, errors = [], []
    for one in new[:40]:
        known = promp.condition(0.0, one[0], promp.noise_variance)
        shares.append(inside(known, one[None]))
        errors.append(np.mean((one - known.mean(PHASE)) ** 2))
    return float(np.mean(shares)), float(np.sqrt(np.mean(errors)))


def library(pours: np.ndarray, new: np.ndarray) -> tuple[float, float]:
    """Return the share in movement_primitives' 95 % bands, and its noise variance."""
    from movement_primitives.promp import ProMP as Other

    other = Other(n_dims=4, n_weights_per_dim=15)
    other.imitate([PHASE] * len(pours), pours)
    deviation = np.sqrt(other.var_trajectory(PHASE) + other.variance)
    return float((np.abs(new - other.mean_trajectory(PHASE)) < _Z * deviation).mean()), float(other.variance)


def measure(kind: Callable[[np.random.Generator], Draw], count: int, prior: float, seeds: int) -> str:
    """Return one line of the table."""
    rows = []
    for seed in range(seeds):
        rng = np.random.default_rng([seed, count])
        draw = kind(rng)
        pours, new = np.array([draw(rng) for _ in range(count)]), np.array([draw(rng) for _ in range(NEW)])
        promp = ProMP.fit(list(pours), prior_demonstrations=prior)
        row = [inside(promp, new), *given_starts(promp, new), promp.noise_variance.mean() / NOISE**2]
        try:
            share, noise = library(pours, new)
            row += [share, noise / NOISE**2]
        except ImportError:
            row += [np.nan, np.nan]
        rows.append(row)
    values = " ".join(f"{value:9.4f}" for value in np.mean(rows, axis=0))
    return f"{kind.__name__:7} {count:3d} {prior:6.1f} {values}\n"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=20, help="distributions a line")
    parser.add_argument("--priors", type=float, nargs="+", default=[1.0, 5.0, 20.0])
    options = parser.parse_args()
    sys.stdout.write("kind    pours prior    bands  given-start  rmse   noise  library library-noise\n")
    for kind in (smooth, rough):
        for count in (2, 3, 5, 10, 40):
            for prior in options.priors:
                sys.stdout.write(measure(kind, count, prior, options.seeds))
                sys.stdout.flush()


if __name__ == "__main__":
    main()
