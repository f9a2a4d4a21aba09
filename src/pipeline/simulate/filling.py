"""A held cup is tilted about its lip above a second container: what ends where?

Each container's liquid is computed in its own frame. A particle that leaves the held cup flies as gravity wants it in the
world, with the momentum that it had. It joins the second's liquid once it is inside the rim's contour and within reach of
the rim; the crest of the rim divides: what comes down below it on the outer side (on the wall, a handle, the table) is
outside for good, and so is what passes the contour from inside. The second sleeps, settled, until the first particle joins.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.geometry.frames import apply
from pipeline.simulate.compiled import compiled, part
from pipeline.simulate.fields import SUPPORT, Vessel
from pipeline.simulate.kernels import LEFT, density_error, step
from pipeline.simulate.lookup import rim_at
from pipeline.simulate.particles import particles
from pipeline.simulate.pouring import (
    QUIET_S,
    QUIET_SPEED,
    TILT_S,
    can_reach,
    motion,
    spill_level,
    turned,
    vector,
)
from pipeline.simulate.rest import GRAVITY, HOLD_S, ITERATIONS, SETTLE_DAMPING, rest, settle, time_step_s

HELD_WAIT_S = 1.5  # the held cup's flux is over then
SECOND_WAIT_S = 1.0  # the longest that the second is watched after the last particle joined or left it
_MOST_S = TILT_S + HELD_WAIT_S + 2 * SECOND_WAIT_S


@dataclass(frozen=True)
class Filling:
    """Where the particles are at the end: in the held cup, in the second, outside of both, or lost through a wall.

    n_particles counts both containers'. density_error: mean |density − 1| over the trial, away from free surfaces.
    spilled_while_settling: the containers do not hold their liquid even at rest; nothing else then has a meaning.
    """

    n_particles: int
    n_retained: int
    n_in_second: int
    n_spilled: int
    n_leaked: int
    density_error: float
    failed: bool
    spilled_while_settling: bool


def fill(
    held: Vessel,
    second: Vessel,
    T_world_held: np.ndarray,
    T_world_second: np.ndarray,
    lip_m: np.ndarray,
    axis_world: np.ndarray,
    tilt_rad: float,
    n_held: int,
    n_second: int,
    seed: int,
) -> Filling:
    """Tilt the held cup with n_held particles about `axis_world` (3,) through its lip (3,), held frame, by `tilt_rad`.

    Poses before the tilt, both containers upright; the second holds n_second particles and stands still. The same
    arguments give the same bits.
    """
    dt = min(time_step_s(held), time_step_s(second))
    p, well_held, kept_held = filled(held, n_held, n_held, seed, 0, dt)
    q, well_second, kept_second = filled(second, n_second, n_second + n_held, seed, 1, dt)
    n = n_held + n_second
    if not (kept_held and kept_second and well_held and well_second):
        settling = not (kept_held and kept_second)
        return Filling(
            n, int(p.count[0]), int(q.count[0]), 0, 0, 0.0, not (well_held and well_second), settling
        )
    flight = np.zeros((2, max(n_held, 1), 3))
    leaked, error, well = _fill(
        p, held.walls, q, second.walls, flight,
        np.asarray(T_world_held, float), vector(apply(T_world_held, np.asarray(lip_m, float))), vector(lip_m),
        np.asarray(T_world_second, float), vector(axis_world), float(tilt_rad), dt, held.cavity.rim_m,
    )  # fmt: skip
    retained, in_second = int(p.count[0]), int(q.count[0])
    spilled = n - retained - in_second - leaked
    return Filling(n, retained, in_second, spilled, leaked, error, not well, False)


def filled(vessel: Vessel, n: int, capacity: int, seed: int, stream: int, dt: float):
    """Return a vessel's particles at rest, whether all went well and whether all stayed."""
    start = settle(vessel, n, (seed, stream))
    p = particles(capacity, vessel.walls)
    p.x[: len(start), :3], p.count[0] = start, len(start)
    left, well = rest(p, vessel.walls, dt, ITERATIONS, int(HOLD_S / dt), SETTLE_DAMPING)
    return p, well, left == 0 and len(start) == n


@part
def _land(q, walls, x, v, before, reach):
    """Return what becomes of a flying particle at x (3,), second's frame, one step after `before`: flies, joins, outside."""
    f = np.float32
    radius, height, out = rim_at(walls.rim_radius, walls.rim_height, walls.opening, f(x[0]), f(x[1]))
    if out > radius:
        return 2 if x[2] < height else 0
    was = rim_at(walls.rim_radius, walls.rim_height, walls.opening, f(before[0]), f(before[1]))[2]
    if was > radius:
        share = min(max((was - radius) / max(was - out, f(1e-9)), f(0.0)), f(1.0))
        if before[2] + share * (x[2] - before[2]) < height:
            return 2
    if x[2] >= height + reach:
        return 0
    k = q.count[0]
    for c in range(3):
        q.x[k, c], q.v[k, c] = x[c], v[c]
    q.impulse[k] = 0.0
    q.count[0] = k + 1
    return 1


@part
def _take_off(p, walls, flight, flying, T_world_held, lip_world, lip, axis, tilt, speed):
    """Turn the particles that left the held cup into flying ones (world); return their number and how many leaked."""
    leaked = 0
    for g in range(p.count[1]):
        if p.gone_how[g] != LEFT:
            leaked += 1
            continue
        r = (p.gone_x[g, 0] - lip[0], p.gone_x[g, 1] - lip[1], p.gone_x[g, 2] - lip[2])
        r, u = (
            rotated(T_world_held, r),
            rotated(T_world_held, (p.gone_v[g, 0], p.gone_v[g, 1], p.gone_v[g, 2])),
        )
        u = (
            u[0] + speed * (axis[1] * r[2] - axis[2] * r[1]),
            u[1] + speed * (axis[2] * r[0] - axis[0] * r[2]),
            u[2] + speed * (axis[0] * r[1] - axis[1] * r[0]),
        )
        r, u = turned(r, axis, tilt), turned(u, axis, tilt)
        for c in range(3):
            flight[0, flying, c], flight[1, flying, c] = lip_world[c] + r[c], u[c]
        flying += 1
    return flying, leaked


@part
def rotated(T, x):
    """Return T's rotation of a vector (x, y, z)."""
    return (
        T[0, 0] * x[0] + T[0, 1] * x[1] + T[0, 2] * x[2],
        T[1, 0] * x[0] + T[1, 1] * x[1] + T[1, 2] * x[2],
        T[2, 0] * x[0] + T[2, 1] * x[1] + T[2, 2] * x[2],
    )


@part
def _rotated_back(T, x):
    """Return the inverse of T's rotation of a vector (x, y, z)."""
    return (
        T[0, 0] * x[0] + T[1, 0] * x[1] + T[2, 0] * x[2],
        T[0, 1] * x[0] + T[1, 1] * x[1] + T[2, 1] * x[2],
        T[0, 2] * x[0] + T[1, 2] * x[1] + T[2, 2] * x[2],
    )


@part
def fly(q, walls, flight, flying, T_world_second, dt, reach):
    """Advance the flying particles; return how many still fly and how many joined the second."""
    still = joined = 0
    here, there = T_world_second[:3, 3], flight[0]
    for k in range(flying):
        u, v, w = flight[1, k, 0], flight[1, k, 1], flight[1, k, 2]
        x, y, z = there[k, 0] - here[0], there[k, 1] - here[1], there[k, 2] - here[2]
        before = _rotated_back(T_world_second, (x, y, z))
        x, y, z = x + dt * u, y + dt * v, z + dt * (w - 0.5 * dt * GRAVITY)
        w -= dt * GRAVITY
        after = _rotated_back(T_world_second, (x, y, z))
        what = _land(q, walls, after, _rotated_back(T_world_second, (u, v, w)), before, reach)
        if what == 0:
            there[still, 0], there[still, 1], there[still, 2] = x + here[0], y + here[1], z + here[2]
            flight[1, still, 0], flight[1, still, 1], flight[1, still, 2] = u, v, w
            still += 1
        joined += what == 1
    return still, joined


@compiled
def _fill(p, walls, q, second, flight, T_world_held, lip_world, lip, T_world_second, axis, tilt_rad, dt, rim):
    """Run the trial; return the number that leaked, the density error and whether all went well."""
    up_world, still = (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
    axis_held, up_second = _rotated_back(T_world_held, axis), _rotated_back(T_world_second, up_world)
    fall_second = (-GRAVITY * up_second[0], -GRAVITY * up_second[1], -GRAVITY * up_second[2])
    level = np.float64(second.lowest_edge)
    reach, lowered = np.float64(SUPPORT * second.spacing), np.float64(walls.lowered)
    flying = leaked = dense = 0
    error, last_left, last_event = 0.0, TILT_S, 0.0
    pouring, awake = p.count[0] > 0, False
    for k in range(int(_MOST_S / dt)):
        t = k * dt
        tilt, speed, growth = motion(t, tilt_rad, TILT_S)
        if pouring:
            up = _rotated_back(T_world_held, turned(up_world, axis, -tilt))
            fall = (-GRAVITY * up[0], -GRAVITY * up[1], -GRAVITY * up[2])
            if not step(p, walls, dt, ITERATIONS, fall, axis_held, lip, speed, growth, 0.0):
                return leaked, error / max(dense, 1), False
            if p.count[1] > 0:
                last_left = max(t, TILT_S)
            flying, lost = _take_off(
                p, walls, flight, flying, T_world_held, lip_world, lip, axis, tilt, speed
            )
            leaked += lost
            total, count = density_error(p, walls)
            error, dense = error + total, dense + count
            if t >= TILT_S and k % 4 == 0:
                can, squares = can_reach(p, up, spill_level(rim, lowered, up))
                quiet = t - last_left > QUIET_S and squares < QUIET_SPEED**2
                pouring = can and not quiet and t < TILT_S + HELD_WAIT_S
            pouring = pouring and p.count[0] > 0
        flying, joined = fly(q, second, flight, flying, T_world_second, dt, reach)
        if joined > 0:
            awake, last_event = True, t
        if awake:
            if not step(q, second, dt, ITERATIONS, fall_second, axis, still, 0.0, 0.0, 0.0):
                return leaked, error / max(dense, 1), False
            for g in range(q.count[1]):
                leaked += q.gone_how[g] != LEFT
                last_event = t
            total, count = density_error(q, second)
            error, dense = error + total, dense + count
            if k % 4 == 0:
                can, squares = can_reach(q, up_second, level)
                quiet = t - last_event > QUIET_S and squares < QUIET_SPEED**2
                awake = can and not quiet and t - last_event < SECOND_WAIT_S
        if not pouring and not awake and flying == 0:
            break
    return leaked, error / max(dense, 1), True
