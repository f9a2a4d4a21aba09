"""Liquid at rest: how many particles a volume is, and where they come to lie.

Settled states are made once a level (levels 10 % apart) and shared: a trial takes the smallest settled state that holds its
particles, takes away those at the top and lets the rest settle for a moment (`HOLD_S`) before it moves.
"""

import numpy as np

from pipeline.simulate.compiled import compiled
from pipeline.simulate.fields import Vessel
from pipeline.simulate.kernels import step
from pipeline.simulate.particles import Particles, particles

GRAVITY = 9.81  # m/s²
STEP_PER_SPACING = 0.5  # s/m: 5 ms at 10 mm
ITERATIONS = 3
SETTLE_S = 1.2
SETTLE_DAMPING = 0.05  # share of the velocity that a step takes away while settling
HOLD_S = 0.1
_LEVELS = 1.1
_OVERFULL = 1.3
_JITTER = 0.01  # spacings


def time_step_s(vessel: Vessel) -> float:
    """Return the time step for a vessel's spacing."""
    return STEP_PER_SPACING * vessel.spacing_m


def particles_for(vessel: Vessel, volume_m3: float) -> int:
    """Return how many particles a volume is."""
    return round(volume_m3 / vessel.spacing_m**3)


def settle(vessel: Vessel, n: int, seed: int | tuple[int, ...]) -> np.ndarray:
    """Return n particles at rest (n, 3), object frame, with a jitter of 1 % of a spacing drawn from the seed.

    Fewer come back when the vessel does not hold as many: what is missing ran over.
    """
    level = 8
    while level < n:
        level = int(np.ceil(level * _LEVELS))
    at_rest = _brimful(vessel) if level > holds(vessel) else _settled(vessel, level)
    if len(at_rest) < n:  # a level just below the rim can splash over it while it settles
        at_rest = _brimful(vessel)
    lowest = at_rest[np.argsort(at_rest[:, 2], kind="stable")[:n]]
    return lowest + np.random.default_rng(seed).normal(0.0, _JITTER * vessel.spacing_m, lowest.shape)


def holds(vessel: Vessel) -> int:
    """Return how many particles stay when the vessel is filled until it overflows."""
    return len(_brimful(vessel))


def _brimful(vessel: Vessel) -> np.ndarray:
    return _settled(vessel, max(int(_OVERFULL * particles_for(vessel, vessel.cavity.capacity_m3)), 8))


def _settled(vessel: Vessel, n: int) -> np.ndarray:
    """Return what stays of n particles that settle from a lattice (m, 3); made once a vessel and number."""
    if n not in vessel.settled:
        p = particles(n, vessel.walls)
        start = _lattice(vessel, n)
        p.x[: len(start)], p.count[0] = start, len(start)
        dt = time_step_s(vessel)
        rest(p, vessel.walls, dt, ITERATIONS, int(SETTLE_S / dt), SETTLE_DAMPING)
        vessel.settled[n] = p.x[: p.count[0]].astype(float)
    return vessel.settled[n]


def _lattice(vessel: Vessel, n: int) -> np.ndarray:
    """Return the n lowest points of a cubic lattice inside, half a spacing from the wall, piled up above the rim if need be."""
    from scipy.ndimage import map_coordinates

    cup, s = vessel.cavity, vessel.spacing_m
    low = cup.origin_m
    high = low + cup.cell_m * np.array(cup.interior.shape)
    opening_m2 = np.pi * np.hypot(*(cup.rim_m - cup.opening_m)[:, :2].T).mean() ** 2
    high[2] = cup.rim_m[:, 2].max() + 2 * s + 2 * n * s**3 / opening_m2
    axes = [np.arange(a + s / 2, b, s) for a, b in zip(low, high, strict=True)]
    floor = low[2] + cup.cell_m * (np.nonzero(cup.interior.any(axis=(0, 1)))[0][0] - 0.5)
    axes[2] = np.arange(floor + s / 2, high[2], s)
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    radius, height = cup.rim_at(points[:, 0], points[:, 1])
    distance = map_coordinates(cup.distance_m, ((points - low) / cup.cell_m).T, order=1, mode="nearest")
    from_axis = np.hypot(points[:, 0] - cup.opening_m[0], points[:, 1] - cup.opening_m[1])
    fits = np.where(points[:, 2] < height, distance, radius - from_axis) > 0.4 * s
    points = points[fits]
    return points[np.argsort(points[:, 2], kind="stable")[:n]]


@compiled
def rest(p: Particles, walls, dt, iterations, steps, damping):
    """Advance a vessel that stands still by some steps; return how many particles left over the rim, and whether all is well."""
    gravity, axis, pivot = (0.0, 0.0, -GRAVITY), (0.0, 1.0, 0.0), (0.0, 0.0, 0.0)
    left = 0
    for _ in range(steps):
        if not step(p, walls, dt, iterations, gravity, axis, pivot, 0.0, 0.0, damping):
            return left, False
        left += p.count[1]
    return left, True
