"""A container ready for liquid, calibrated: filled until it overflows it keeps its own capacity.

A particle is spacing³ of liquid. How much of it a brimful container keeps depends on how the particles' layers fit below the
rim, by up to half a spacing of level. So the height of the wall that the particles meet at the rim is chosen for each
container such that what stays after overfilling is the cavity's capacity to within `TOLERANCE`, as near as layers allow.
"""

import numpy as np

from pipeline.geometry.cavity import Cavity
from pipeline.simulate.fields import Vessel, precompute
from pipeline.simulate.rest import holds, particles_for

__all__ = ["Vessel", "vessel"]

LOWERED = 0.5  # spacings: a particle's centre stays half a spacing above what it flows over
TOLERANCE = 0.01
_RANGE = (0.0, 1.25)
_TRIALS = 4


def vessel(cavity: Cavity, spacing_m: float) -> Vessel:
    """Precompute the wall of a cavity for particles `spacing_m` apart, calibrated by overflow."""
    area = np.pi * np.hypot(*(cavity.rim_m - cavity.opening_m)[:, :2].T).mean() ** 2
    tried: list[tuple[float, Vessel]] = []
    lowered, low, high = LOWERED, *_RANGE
    for _ in range(_TRIALS):
        candidate = precompute(cavity, spacing_m, lowered)
        target = particles_for(candidate, cavity.capacity_m3)
        excess = holds(candidate) - target
        tried.append((abs(excess), candidate))
        if abs(excess) <= TOLERANCE * target:
            break
        low, high = (lowered, high) if excess > 0 else (low, lowered)
        step = np.clip(excess * spacing_m**2 / area, -0.5, 0.5)
        lowered = lowered + step if low < lowered + step < high else (low + high) / 2
    return min(tried, key=lambda pair: pair[0])[1]
