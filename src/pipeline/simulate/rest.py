"""Liquid at rest: how many particles a volume is, and where they come to lie.

Settled states are made once a level (levels 10 % apart) and shared: a trial takes the smallest settled state that holds its
particles, takes away those at the top and lets the rest settle for a moment (`HOLD_S`) before it moves.
"""

from collections.abc import Callable, Iterator

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
BRIMFUL, TOPPED = (
    0,
    -1,
)  # keys among the settled states, of the first one at the brim; the others follow in steps of −2
_LEVELS = 1.1
_TOP_UP_FROM = 0.93  # of the capacity: a lattice that settles above this splashes over, and lies otherwise than liquid topped up
_ROOMS = (5, 10, 15, 20)  # particles of 500 that are missing to the capacity before a trial top-up
_OF = 500
_RUNS, _RUNS_OF_MANY, _MANY = (
    16,
    4,
    1000,
)  # top-ups of a trial's liquid; fewer where a vessel holds many, as one counts for less
# A mean of one top-up a room that is further from the capacity tells enough: a share of it, and particles.
_FAR, _FAR_AT_LEAST = 0.015, 4
_FOR_GOOD = 0.01  # of the capacity: so much of it may run over sooner or later
_TOP_UPS, _STATES = 8, 5  # in a row; the last ones are kept
_PORTIONS = 300  # a portion set down at once is this part of the capacity, one particle at least
_PORTION_S = 0.1
_SHAKES, _CALM_SHAKES, _SHAKE_S = 30, 8, 0.6  # at most; in a row without a loss; how long each
_CALM_S = 0.4  # what would run over sooner or later has done so then
_INNER = 0.6  # of the opening's radius
_ABOVE = 0.8  # spacings from a particle on the surface to one set down on it
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
    rng = np.random.default_rng(seed)
    level = next(level for level in _levels() if level >= n)
    at_rest = _settled(vessel, level) if level <= _highest_level(vessel) else np.zeros((0, 3))
    if len(at_rest) < n:  # a level just below the rim can splash over it while it settles
        at_rest = _full(vessel, n, rng)
    lowest = _lowest(at_rest, n)
    return lowest + rng.normal(0.0, _JITTER * vessel.spacing_m, lowest.shape)


def settle_all(vessel: Vessel) -> None:
    """Make every settled state that `settle` may ask for."""
    for level in _levels():
        if level > _highest_level(vessel):
            break
        _settled(vessel, level)


def _highest_level(vessel: Vessel) -> float:
    """Return up to how many particles a settled state is made of a lattice; above are those at the brim."""
    return min(holds(vessel), _TOP_UP_FROM * particles_for(vessel, vessel.cavity.capacity_m3))


def _levels() -> Iterator[int]:
    level = 8
    while True:
        yield level
        level = int(np.ceil(level * _LEVELS))


def holds(vessel: Vessel) -> int:
    """Return how many particles stay for good when the vessel is filled gently until it overflows, at most."""
    return max(len(state) for state in _brimful(vessel))


def keeps(vessel: Vessel) -> float:
    """Return how many particles stay for good when the vessel is filled gently until it overflows: a mean of its states."""
    return float(np.mean([len(state) for state in _brimful(vessel)]))


def overflows_at(vessel: Vessel) -> float:
    """Return how many particles are there just before the first runs over when a trial's liquid is topped up: a mean.

    It starts as a trial does, with some free room. Where it is far from the capacity, over fewer. Never more than `_FOR_GOOD`
    above what stays for good: a trial that starts with more is void.
    """
    target = particles_for(vessel, vessel.cavity.capacity_m3)
    rooms = _ROOMS * ((_RUNS if target < _MANY else _RUNS_OF_MANY) // len(_ROOMS))
    found: list[int] = []
    for turn, room in enumerate(rooms):
        if turn == len(_ROOMS) and abs(np.mean(found) - target) > max(_FAR * target, _FAR_AT_LEAST):
            break
        start = settle(vessel, max(target - _scaled(target, room), 1), turn)
        found.append(len(_topped_up(vessel, start, 1 + turn)))
    return min(float(np.mean(found)), holds(vessel) + _FOR_GOOD * target)


def _scaled(target: int, room: int) -> int:
    """Return as large a share of a vessel for more particles as the room is of `_OF`."""
    return round(room * max(1.0, target / _OF))


def _full(vessel: Vessel, n: int, rng: np.random.Generator) -> np.ndarray:
    """Return one of the states at the brim, as drawn, of those that have n particles; the fullest (m, 3) if none has."""
    states = _brimful(vessel) if n <= holds(vessel) else _topped(vessel)
    enough = [state for state in states if len(state) >= n]
    return enough[rng.integers(len(enough))] if enough else max(states, key=len)


def _brimful(vessel: Vessel) -> list[np.ndarray]:
    """Return what of each topped-up state stays for good (m, 3); made once."""
    return _made_once(vessel, BRIMFUL, lambda: [_kept(vessel, state) for state in _topped(vessel)])


def _topped(vessel: Vessel) -> list[np.ndarray]:
    """Return what is there just before the first particle runs over (m, 3), `_STATES` times, one of middle size first; made once.

    The order of the particles near the brim decides how many it takes. So there are several: gentle top-ups, the first from
    a lattice, each other as a trial does, from the last one less the particles at its top. The first few still know of the lattice.
    """

    def chain() -> list[np.ndarray]:
        target = particles_for(vessel, vessel.cavity.capacity_m3)
        n = max(int(_TOP_UP_FROM * target), min(target, 8))
        while n > 1 and len(_settled(vessel, n)) < n:  # it splashed over
            n = max(len(vessel.settled[n]) - 1, 1)
        start, states = _settled(vessel, n), []
        for turn in range(_TOP_UPS):
            states.append(_calmed(vessel, _topped_up(vessel, start, turn), _CALM_S, SETTLE_DAMPING))
            left = len(states[-1]) - _scaled(target, _ROOMS[turn % len(_ROOMS)])
            start = _lowest(states[-1], max(left, 1))
        ordered = sorted(states[-_STATES:], key=len)
        return [ordered.pop(_STATES // 2), *ordered]

    return _made_once(vessel, TOPPED, chain)


def _made_once(vessel: Vessel, first: int, make: Callable[[], list[np.ndarray]]) -> list[np.ndarray]:
    """Return the states at the brim with the keys `first`, `first` − 2, ...; made if they are missing."""
    keys = range(first, first - 2 * _STATES, -2)
    if first not in vessel.settled:
        vessel.settled.update(zip(keys, make(), strict=True))
    return [vessel.settled[key] for key in keys]


def _lowest(at_rest: np.ndarray, n: int) -> np.ndarray:
    return at_rest[np.argsort(at_rest[:, 2], kind="stable")[:n]]


def _topped_up(vessel: Vessel, start: np.ndarray, turn: int) -> np.ndarray:
    """Set particles down on the liquid, without speed, a few at a time, until one runs over; the state before (m, 3).

    Where some run over before any was set down, what then is left.

    They come down on a golden spiral over the inner part of the opening; `turn` says where on it the first one does.
    """
    n, target = len(start), particles_for(vessel, vessel.cavity.capacity_m3)
    p = particles(n + 2 * target + 16, vessel.walls)
    p.x[:n, :3], p.count[0] = start, n
    dt, at_once = time_step_s(vessel), max(1, round(target / _PORTIONS))
    left, well = rest(p, vessel.walls, dt, ITERATIONS, int(HOLD_S / dt), SETTLE_DAMPING)
    before = p.x[: p.count[0], :3].astype(float)
    for place in range(turn * 1000, turn * 1000 + target, at_once):
        if left > 0 or not well:
            break
        for k in range(at_once):
            _set_down(p, vessel, place + k)
        left, well = rest(p, vessel.walls, dt, ITERATIONS, int(_PORTION_S / dt), 0.0)
        if left == 0 and well:
            before = p.x[: p.count[0], :3].astype(float)
    return before


def _kept(vessel: Vessel, at_rest: np.ndarray) -> np.ndarray:
    """Return what stays of a state (m, 3) when nothing damps it and it is shaken a little, again and again, as trials do."""
    calm = 0
    for turn in range(_SHAKES):
        n, rng = len(at_rest), np.random.default_rng(turn)
        shaken = at_rest + rng.normal(0.0, _JITTER * vessel.spacing_m, at_rest.shape)
        at_rest = _calmed(vessel, shaken, _SHAKE_S, 0.0)
        calm = calm + 1 if len(at_rest) == n else 0
        if calm == _CALM_SHAKES:
            break
    return at_rest


def _calmed(vessel: Vessel, start: np.ndarray, seconds: float, damping: float) -> np.ndarray:
    """Return what stays of particles (m, 3) that start without speed."""
    p, dt = particles(len(start), vessel.walls), time_step_s(vessel)
    p.x[: len(start), :3], p.count[0] = start, len(start)
    rest(p, vessel.walls, dt, ITERATIONS, int(seconds / dt), damping)
    return p.x[: p.count[0], :3].astype(float)


def _set_down(p: Particles, vessel: Vessel, place: int) -> None:
    """Add a particle on the liquid, at a place of the golden spiral over the inner part of the opening."""
    opening, s, n = vessel.cavity.opening_m, vessel.spacing_m, p.count[0]
    azimuth, share = place * np.pi * (3 - np.sqrt(5)), _INNER * np.sqrt(place * (np.sqrt(5) - 1) / 2 % 1)
    out = np.array([np.cos(azimuth), np.sin(azimuth)])
    radius = vessel.cavity.rim_at(opening[0] + out[:1], opening[1] + out[1:])[0][0]
    x, y = opening[:2] + share * radius * out
    under = np.hypot(p.x[:n, 0] - x, p.x[:n, 1] - y) < s
    p.x[n, :3] = x, y, p.x[:n][under, 2].max(initial=vessel.cavity.origin_m[2]) + _ABOVE * s
    p.v[n], p.impulse[n], p.count[0] = 0.0, 0.0, n + 1


def _settled(vessel: Vessel, n: int) -> np.ndarray:
    """Return what stays of n particles that settle from a lattice (m, 3); made once a vessel and number."""
    if n not in vessel.settled:
        p = particles(n, vessel.walls)
        start = _lattice(vessel, n)
        p.x[: len(start), :3], p.count[0] = start, len(start)
        dt = time_step_s(vessel)
        rest(p, vessel.walls, dt, ITERATIONS, int(SETTLE_S / dt), SETTLE_DAMPING)
        vessel.settled[n] = p.x[: p.count[0], :3].astype(float)
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
