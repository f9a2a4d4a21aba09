"""A cup alone is tilted about its lip: who leaves? Everything is computed in the cup's frame, where gravity turns.

Motion: at rest for `HOLD_S`, tilted to the final angle by a smoothstep over `TILT_S`, whatever the angle, the lip fixed in the
world; then held until the flux has ended (nothing has left for `QUIET_S` and nothing moves or nothing has the energy to
reach the rim), at most `WAIT_S`.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.simulate.compiled import compiled, part
from pipeline.simulate.fields import Vessel
from pipeline.simulate.kernels import LEFT, density_error, step
from pipeline.simulate.particles import particles
from pipeline.simulate.rest import GRAVITY, HOLD_S, ITERATIONS, SETTLE_DAMPING, settle, time_step_s

TILT_S = 1.0
WAIT_S = 1.5
QUIET_S = 0.25
QUIET_SPEED = 0.05  # m/s, root of the mean square
BRINK = 0.3  # spacings: liquid that stands no lower than this below the rim may still begin to pour


@dataclass(frozen=True)
class Pour:
    """What became of the particles. density_error: mean |density − 1| over the trial, away from the free surface."""

    n_particles: int
    n_left: int
    n_retained: int
    n_leaked: int
    density_error: float
    failed: bool
    retained: np.ndarray  # share kept at each time step of the tilting and waiting
    tilts_rad: np.ndarray  # tilt at each of these


def pour(
    vessel: Vessel,
    n: int,
    lip_m: np.ndarray,
    axis: np.ndarray,
    tilt_rad: float,
    seed: int,
    *,
    tilt_s: float = TILT_S,
    wait_s: float = WAIT_S,
    substeps: int = 1,
    iterations: int = ITERATIONS,
    patient: bool = False,
) -> Pour:
    """Tilt a vessel with n particles about `axis` (3,) through `lip_m` (3,), object frame, by `tilt_rad`.

    The same arguments give the same bits. `tilt_s` is the motion's duration, `wait_s` the longest wait after it; a
    patient trial waits as long even when the flux has ended. `substeps` divides the time step.
    """
    start = settle(vessel, n, seed)
    p = particles(n, vessel.walls)
    p.x[: len(start), :3], p.count[0] = start, len(start)
    dt = time_step_s(vessel) / substeps
    steps = int((HOLD_S + tilt_s + wait_s) / dt) + 1
    history = np.zeros((steps, 2))
    left, leaked, well, error, taken = _pour(
        p, vessel.walls, vector(lip_m), vector(axis), float(tilt_rad), dt,
        steps, tilt_s, iterations, patient, vessel.cavity.rim_m, history,
    )  # fmt: skip
    left += n - len(start)
    retained = int(p.count[0])
    return Pour(
        n, left, retained, leaked, error, not well, history[:taken, 1] / max(n, 1), history[:taken, 0]
    )


def vector(values: np.ndarray) -> tuple[float, float, float]:
    """Return (3,) numbers as the compiled code takes a vector."""
    x, y, z = (float(value) for value in values)
    return x, y, z


@part
def motion(t, tilt_rad, tilt_s):
    """Return tilt (rad), its speed and its growth at time t (s) of a smoothstep that lasts `tilt_s`."""
    u = min(max(t / tilt_s, 0.0), 1.0)
    turning = 0.0 < t < tilt_s
    speed = tilt_rad * 6.0 * u * (1.0 - u) / tilt_s if turning else 0.0
    growth = tilt_rad * (6.0 - 12.0 * u) / (tilt_s * tilt_s) if turning else 0.0
    return tilt_rad * u * u * (3.0 - 2.0 * u), speed, growth


@part
def turned(x, axis, angle):
    """Return a vector (x, y, z) rotated about a unit axis by the right-hand rule."""
    c, s = np.cos(angle), np.sin(angle)
    along = (axis[0] * x[0] + axis[1] * x[1] + axis[2] * x[2]) * (1.0 - c)
    return (
        x[0] * c + (axis[1] * x[2] - axis[2] * x[1]) * s + axis[0] * along,
        x[1] * c + (axis[2] * x[0] - axis[0] * x[2]) * s + axis[1] * along,
        x[2] * c + (axis[0] * x[1] - axis[1] * x[0]) * s + axis[2] * along,
    )


@part
def spill_level(rim, lowered, up):
    """Return the height along `up` of the lowest point of the rim, lowered along z by `lowered`."""
    level = np.inf
    for k in range(rim.shape[0]):
        h = rim[k, 0] * up[0] + rim[k, 1] * up[1] + (rim[k, 2] - lowered) * up[2]
        level = min(level, h)
    return level


@part
def can_reach(p, up, level):
    """Return whether any particle has the energy to rise to `level` along `up`, and the mean square speed."""
    reach, squares = False, 0.0
    for i in range(p.count[0]):
        vv = p.v[i, 0] ** 2 + p.v[i, 1] ** 2 + p.v[i, 2] ** 2
        h = p.x[i, 0] * up[0] + p.x[i, 1] * up[1] + p.x[i, 2] * up[2]
        reach = reach or h + vv / (2.0 * GRAVITY) > level
        squares += vv
    return reach, squares / max(p.count[0], 1)


@compiled
def _pour(p, walls, lip, axis, tilt_rad, dt, steps, tilt_s, iterations, patient, rim, history):
    left = leaked = 0
    error, dense, taken = 0.0, 0, 0
    last = 0.0
    for k in range(steps):
        t = k * dt - HOLD_S
        tilt, speed, growth = motion(t, tilt_rad, tilt_s)
        up = turned((0.0, 0.0, 1.0), axis, -tilt)
        gravity = (-GRAVITY * up[0], -GRAVITY * up[1], -GRAVITY * up[2])
        damping = SETTLE_DAMPING if t < 0 else 0.0
        if not step(p, walls, dt, iterations, gravity, axis, lip, speed, growth, damping):
            return left, leaked, False, error / max(dense, 1), taken
        for g in range(p.count[1]):
            if p.gone_how[g] == LEFT:
                left += 1
                last = t
            else:
                leaked += 1
        total, count = density_error(p, walls)
        error += total
        dense += count
        if t >= 0:
            history[taken, 0], history[taken, 1] = tilt, p.count[0]
            taken += 1
        if p.count[0] == 0:
            break
        if t >= tilt_s and k % 4 == 0 and not patient:
            level = spill_level(rim, np.float64(walls.lowered), up)
            reach, squares = can_reach(p, up, level)
            quiet = t - max(last, tilt_s) > QUIET_S and squares < QUIET_SPEED**2
            if quiet and left == 0:  # one late drop would change the label
                quiet = not can_reach(p, up, level - BRINK * walls.spacing)[0]
            if not reach or quiet:
                break
    return left, leaked, True, error / max(dense, 1), taken
