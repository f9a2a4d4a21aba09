"""How often a pour tilts its cup too far while the lip is not above the second container's opening."""

from dataclasses import dataclass

import numpy as np

from pipeline.motion.promp import ProMP

STEPS = 201


@dataclass(frozen=True)
class Safety:
    """Probabilities with standard errors: `way_in` until the lip first comes above the opening, `ever` on the way back, too."""

    way_in: float
    ever: float
    way_in_error: float
    ever_error: float
    samples: int


def safety(
    promp: ProMP,
    rng: np.random.Generator,
    *,
    samples: int = 2000,
    radius: float = 1.0,
    tilt: float = 1.0,
) -> Safety:
    """Return P(tilt > `tilt` while the lip is further than `radius` from the opening's centre), by drawing trajectories.

    radius and tilt are in the primitive's units: one where it is dimensionless, the pair's own where it is in metres and radians.
    """
    drawn = promp.samples(np.linspace(0.0, 1.0, STEPS), samples, rng)
    early, ever = unsafe(drawn, radius, tilt)
    shares = np.array([early.mean(), ever.mean()])
    errors = np.sqrt(shares * (1.0 - shares) / samples)
    return Safety(float(shares[0]), float(shares[1]), float(errors[0]), float(errors[1]), samples)


def unsafe(trajectories: np.ndarray, radius: float = 1.0, tilt: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Return for trajectories (N, T, 4), drawn or executed, whether each tilts too far on its way there (N,), and ever (N,)."""
    outside = np.hypot(trajectories[..., 0], trajectories[..., 1]) > radius
    bad = outside & (trajectories[..., 3] > tilt)
    arrived = np.logical_or.accumulate(~outside, axis=1)
    return (bad & ~arrived).any(axis=1), bad.any(axis=1)
