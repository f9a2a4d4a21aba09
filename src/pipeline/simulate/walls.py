"""A container ready for liquid, calibrated: filled gently until it overflows it keeps its own capacity.

A particle is spacing³ of liquid. How much of it a brimful container keeps depends on how the particles' layers fit below the
rim, by up to half a spacing of level. So the height of the wall that the particles meet at the rim is chosen for each
container such that what it holds before the first particle runs over is the cavity's capacity to within `TOLERANCE`, as near
as layers allow, but never such that less than 99 % of it stay for good.
"""

import numpy as np

from pipeline.geometry.cavity import Cavity
from pipeline.simulate.fields import Vessel, precompute
from pipeline.simulate.rest import overflows_at, particles_for

__all__ = ["Vessel", "vessel"]

LOWERED = 0.75  # spacings: a particle's centre stays that far above what it flows over
TOLERANCE = 0.003
_RANGE = (0.25, 1.25)
_TRIALS = 6
_STEP = 0.01  # spacings: nearer to one that was tried nothing else happens


def vessel(cavity: Cavity, spacing_m: float) -> Vessel:
    """Precompute the wall of a cavity for particles `spacing_m` apart, calibrated by overflow."""
    layer = np.pi * np.hypot(*(cavity.rim_m - cavity.opening_m)[:, :2].T).mean() ** 2 / spacing_m**2
    tried: list[tuple[float, Vessel]] = []
    for _ in range(_TRIALS):
        lowered = _next_lowered(tried, layer)
        if any(abs(lowered - each.lowered) < _STEP for _, each in tried):
            break
        candidate = precompute(cavity, spacing_m, lowered)
        target = particles_for(candidate, cavity.capacity_m3)
        tried.append((overflows_at(candidate) - target, candidate))
        if abs(tried[-1][0]) <= TOLERANCE * target:
            break
    return min(tried, key=lambda pair: abs(pair[0]))[1]


def _next_lowered(tried: list[tuple[float, Vessel]], layer: float) -> float:
    """Return by how much to lower the rim next, from the excess of particles at those tried; a spacing holds one `layer`."""
    over = [(excess, each.lowered) for excess, each in tried if excess > 0]
    under = [(excess, each.lowered) for excess, each in tried if excess <= 0]
    if over and under:  # regula falsi between the nearest two
        (a, low), (b, high) = min(over), max(under)
        return float(low + (high - low) * a / (a - b))
    if not tried:
        return LOWERED
    excess, each = tried[-1]
    return float(np.clip(each.lowered + excess / layer, *_RANGE))
