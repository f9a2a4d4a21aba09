"""A liquid in a cup that a robot carries along poses, and in the container into which it pours it.

As in `filling`, but the cup's frame moves as the poses do. The arm turns the cup about one axis that is fixed in the cup, the tilt
axis, as a pour asks for; the little that it turns about others enters the poses and the gravity, not the liquid's inertia.
"""

from typing import NamedTuple

import numpy as np

from pipeline.simulate.carrying import Motion
from pipeline.simulate.compiled import compiled, part
from pipeline.simulate.fields import SUPPORT, Vessel
from pipeline.simulate.filling import SECOND_WAIT_S, filled, fly, rotated
from pipeline.simulate.kernels import LEFT, step
from pipeline.simulate.rest import GRAVITY, ITERATIONS, time_step_s


class CarriedLiquid(NamedTuple):
    """The liquid's particles, by the columns of the table "carried".

    overflowed: left the second; early: came down beside it before the lip had arrived above it.
    """

    n_balls: int
    n_poured: int
    n_in_target: int
    n_spilled: int
    n_overflowed: int
    n_early: int
    n_leaked: int
    first_drop_s: float
    first_spill_s: float
    failed: bool


def step_s(held: Vessel, second: Vessel) -> float:
    """Return the time step that a pair's motion must have."""
    return min(time_step_s(held), time_step_s(second))


def carry(
    held: Vessel,
    second: Vessel,
    moving: Motion,
    T_world_second: np.ndarray,
    axis: np.ndarray,
    n: int,
    arrived_s: float,
    seed: int,
) -> CarriedLiquid:
    """Carry n particles along a motion in steps of `step_s`; `axis` (3,): the tilt axis in the cup's frame."""
    p, well, kept = filled(held, n, n, seed, 0, moving.step_s)
    q, _, _ = filled(second, 0, n, seed, 1, moving.step_s)
    if not (well and kept):
        return CarriedLiquid(n, 0, 0, 0, 0, 0, 0, np.nan, np.nan, True)
    flight, counts, times = np.zeros((2, n, 3)), np.zeros(3, np.int64), np.full(2, np.nan)
    speed, growth = moving.turning @ axis, moving.growth @ axis
    well = _carry(
        p, held.walls, q, second.walls, flight, moving.T_world_cup, moving.velocity_world, moving.gravity,
        moving.turning, speed, growth, tuple(float(a) for a in axis), np.asarray(T_world_second, float),
        moving.step_s, float(arrived_s), counts, times,
    )  # fmt: skip
    retained, caught = int(p.count[0]), int(q.count[0])
    leaked, overflowed, early = (int(count) for count in counts)
    spilled = n - retained - caught - leaked
    return CarriedLiquid(
        n,
        n - retained,
        caught,
        spilled,
        overflowed,
        early,
        leaked,
        float(times[0]),
        float(times[1]),
        not well,
    )


@part
def _leave(p, flight, flying, T_world_held, velocity, turning):
    """Turn the particles that left the cup into flying ones (world); return their number and how many leaked."""
    leaked = 0
    for g in range(p.count[1]):
        if p.gone_how[g] != LEFT:
            leaked += 1
            continue
        x = (p.gone_x[g, 0], p.gone_x[g, 1], p.gone_x[g, 2])
        u = (
            p.gone_v[g, 0] + turning[1] * x[2] - turning[2] * x[1],
            p.gone_v[g, 1] + turning[2] * x[0] - turning[0] * x[2],
            p.gone_v[g, 2] + turning[0] * x[1] - turning[1] * x[0],
        )
        x, u = rotated(T_world_held, x), rotated(T_world_held, u)
        for c in range(3):
            flight[0, flying, c] = T_world_held[c, 3] + x[c]
            flight[1, flying, c] = velocity[c] + u[c]
        flying += 1
    return flying, leaked


@compiled
def _carry(
    p, walls, q, second, flight, poses, velocity, gravity, turning, speed, growth, axis, T_world_second, dt, arrived_s,
    counts, times,
):  # fmt: skip
    """Run along all poses and until the second has come to rest; counts: leaked, overflowed, early; times: drop, spill."""
    still, down = (0.0, 0.0, 0.0), (0.0, 0.0, -GRAVITY)
    reach = np.float64(SUPPORT * second.spacing)
    flying, last_event, awake, last = 0, 0.0, False, poses.shape[0] - 1
    for k in range(last + 1 + int(SECOND_WAIT_S / dt)):
        t = k * dt
        if k <= last and p.count[0] > 0:
            fall = (gravity[k, 0], gravity[k, 1], gravity[k, 2])
            if not step(p, walls, dt, ITERATIONS, fall, axis, still, speed[k], growth[k], 0.0):
                return False
            before = flying
            flying, lost = _leave(p, flight, flying, poses[k], velocity[k], turning[k])
            counts[0] += lost
            if flying > before and np.isnan(times[0]):
                times[0] = t
        n = flying
        flying, joined = fly(q, second, flight, n, T_world_second, dt, reach)
        outside = n - flying - joined
        if joined > 0:
            awake, last_event = True, t
        if t < arrived_s:
            counts[2] += outside
        if awake:
            if not step(q, second, dt, ITERATIONS, down, axis, still, 0.0, 0.0, 0.0):
                return False
            for g in range(q.count[1]):
                last_event = t
                if q.gone_how[g] == LEFT:
                    counts[1] += 1
                    outside += 1
                else:
                    counts[0] += 1
            awake = t - last_event < SECOND_WAIT_S
        if outside > 0 and np.isnan(times[1]):
            times[1] = t
        if (k >= last or p.count[0] == 0) and flying == 0 and not awake:
            break
    return True
