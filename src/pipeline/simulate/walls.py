"""A container ready for liquid, calibrated: filled gently until it overflows it keeps its own capacity.

A particle is spacing³ of liquid. How much of it a brimful container keeps depends on how the particles' layers fit below the
rim, by up to half a spacing of level. So the height of the wall that the particles meet at the rim is chosen for each
container such that what it holds before the first particle runs over is the cavity's capacity to within `TOLERANCE`, as near
as layers allow.
"""

import numpy as np

from pipeline.geometry.cavity import Cavity
from pipeline.simulate.fields import Vessel, precompute
from pipeline.simulate.rest import overflows_at, particles_for

__all__ = ["Vessel", "vessel"]

LOWERED = 0.75  # spacings: a particle's centre stays that far above what it flows over
TOLERANCE = 0.005
_RANGE = (0.25, 1.25)
_TRIALS = 3


def vessel(cavity: Cavity, spacing_m: float) -> Vessel:
    """Precompute the wall of a cavity for particles `spacing_m` apart, calibrated by overflow."""
    area = np.pi * np.hypot(*(cavity.rim_m - cavity.opening_m)[:, :2].T).mean() ** 2
    tried: list[tuple[float, Vessel]] = []
    lowered = LOWERED
    for _ in range(_TRIALS):
        candidate = precompute(cavity, spacing_m, lowered)
        target = particles_for(candidate, cavity.capacity_m3)
        excess = overflows_at(candidate) - target
        tried.append((abs(excess), candidate))
        if abs(excess) <= TOLERANCE * target:
            break
        lowered = float(np.clip(lowered + excess * spacing_m**2 / area, *_RANGE))
    return min(tried, key=lambda pair: pair[0])[1]
