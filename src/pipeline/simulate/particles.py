"""The particles in one container, and the room that a time step works in."""

from typing import NamedTuple

import numpy as np

from pipeline.simulate.fields import Walls

MAX_PAIRS = 64  # per particle, each pair counted once; at rest there are about 16


class Particles(NamedTuple):
    """State of up to N particles: the first `count[0]` are in the container, sorted by cell.

    x, v (N, 3) in m and m/s; impulse (N,), the pressure's. gone_*: those that left in the last step, the first `count[1]`,
    `gone_how` as in `kernels`. spare_*: room for sorting; bin_of (N,), bin_start (cells + 2,): the sorting. first (N + 1,),
    other, slope (pairs, 3): the pairs of particle i are first[i] to first[i + 1]. density (N,), its gradient `total` and the
    wall's part of that, `wall` (N, 3); squares (N,): of the pairs' slopes; drift (N, 3): of the neighbours; change (N,).
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
    first: np.ndarray
    other: np.ndarray
    slope: np.ndarray
    density: np.ndarray
    total: np.ndarray
    squares: np.ndarray
    wall: np.ndarray
    drift: np.ndarray
    change: np.ndarray


def particles(capacity: int, walls: Walls) -> Particles:
    """Make room for `capacity` particles in a container; none is there yet."""
    n, f, i = max(capacity, 1), np.float32, np.int64
    return Particles(
        np.zeros((n, 3), f), np.zeros((n, 3), f), np.zeros(n, f), np.zeros(2, i),
        np.zeros((n, 3), f), np.zeros((n, 3), f), np.zeros(n, i),
        np.zeros((n, 3), f), np.zeros((n, 3), f), np.zeros(n, f),
        np.zeros(n, i), np.zeros(int(np.prod(walls.bins)) + 2, i), np.zeros(n + 1, i),
        np.zeros(n * MAX_PAIRS, np.uint32), np.zeros((n * MAX_PAIRS, 3), f),
        np.zeros(n, f), np.zeros((n, 3), f), np.zeros(n, f), np.zeros((n, 3), f), np.zeros((n, 3), f), np.zeros(n, f),
    )  # fmt: skip
