"""The particles in one container, and the room that a time step works in."""

from typing import NamedTuple

import numpy as np

from pipeline.simulate.fields import Walls

MAX_PAIRS = 64  # per particle, each pair counted once; at rest there are about 16


class Particles(NamedTuple):
    """State of up to N particles: the first `count[0]` are in the container, sorted by cell.

    x, v (N, 4) in m and m/s; impulse (N,), the pressure's. gone_*: those that left in the last step, the first `count[1]`,
    `gone_how` as in `kernels`. spare_*: room for sorting; bin_of (N,), bin_start (cells + 2,): the sorting. rows (5, 2): where a
    cell's partners are. first (N + 1,), other (pairs,): the pairs of particle i are first[i] to first[i + 1]; their weight
    (pairs,), the kernel, and slope (pairs, 4), its gradient: the way apart times the factor (pairs,), which holds the square of
    the distance before. sums (N, 8): the density's gradient (3), density, the change of velocity (3). wall (N, 4): the part of
    gradient and density that no other particle makes. change (N,): of the impulse. Rows of x, v, sums, wall and slope have four
    numbers or eight, 0 the last of a vector's: so they run in vectors.
    """

    x: np.ndarray
    v: np.ndarray
    impulse: np.ndarray
    count: np.ndarray  # type: ignore[assignment]  # tuples have a method of that name
    gone_x: np.ndarray
    gone_v: np.ndarray
    gone_how: np.ndarray
    spare_x: np.ndarray
    spare_v: np.ndarray
    spare_impulse: np.ndarray
    bin_of: np.ndarray
    bin_start: np.ndarray
    rows: np.ndarray
    first: np.ndarray
    other: np.ndarray
    weight: np.ndarray
    factor: np.ndarray
    slope: np.ndarray
    sums: np.ndarray
    wall: np.ndarray
    change: np.ndarray


def particles(capacity: int, walls: Walls) -> Particles:
    """Make room for `capacity` particles in a container; none is there yet."""
    n, f, i = max(capacity, 1), np.float32, np.int64
    pairs = n * MAX_PAIRS
    return Particles(
        np.zeros((n, 4), f), np.zeros((n, 4), f), np.zeros(n, f), np.zeros(2, i),
        np.zeros((n, 3), f), np.zeros((n, 3), f), np.zeros(n, i),
        np.zeros((n, 4), f), np.zeros((n, 4), f), np.zeros(n, f),
        np.zeros(n, i), np.zeros(int(np.prod(walls.bins)) + 2, i), np.zeros((5, 2), i), np.zeros(n + 1, i),
        np.zeros(pairs, np.uint32), np.zeros(pairs, f), np.zeros(pairs, f), np.zeros((pairs, 4), f),
        np.zeros((n, 8), f), np.zeros((n, 4), f), np.zeros(n, f),
    )  # fmt: skip
