"""What one thread of a device does: one trial of a batch, from its slices of large arrays."""

from pipeline.simulate.compiled import part
from pipeline.simulate.filling import _fill
from pipeline.simulate.particles import Particles
from pipeline.simulate.pouring import _pour
from pipeline.simulate.rest import HOLD_S, ITERATIONS, SETTLE_DAMPING, rest


@part
def _trial(r, t):
    """Return the particles of trial t, at rest."""
    for i in range(r.count[t, 0]):
        r.impulse[t, i] = 0.0
        for c in range(4):
            r.v[t, i, c] = 0.0
    return Particles(
        r.x[t], r.v[t], r.impulse[t], r.count[t], r.gone_x[t], r.gone_v[t], r.gone_how[t],
        r.spare_x[t], r.spare_v[t], r.spare_impulse[t], r.bin_of[t], r.bin_start[t], r.rows[t], r.first[t],
        r.other[t], r.weight[t], r.factor[t], r.slope[t], r.sums[t], r.wall[t], r.change[t],
    )  # fmt: skip


@part
def _vector(values, t):
    return values[t, 0], values[t, 1], values[t, 2]


def pour_one(t, room, walls, lips, axes, tilts, rim, dt, steps, tilt_s, history, found):
    """Run trial t of a batch of pours; found[t]: left, leaked, all well, density error, time steps, retained."""
    p = _trial(room, t)
    left, leaked, well, error, taken = _pour(
        p,
        walls,
        _vector(lips, t),
        _vector(axes, t),
        tilts[t],
        dt,
        steps,
        tilt_s,
        ITERATIONS,
        False,
        rim,
        history[t],
    )
    found[t, 0], found[t, 1], found[t, 2] = left, leaked, well
    found[t, 3], found[t, 4], found[t, 5] = error, taken, p.count[0]


def fill_one(
    t, held, second, walls, walls_second, flight, T_held, lips_world, lips, T_second, axes, tilts, rim, short, dt, found
):  # fmt: skip
    """Run trial t of a batch of fillings; found[t]: how many spill at rest and all well, held and second; then the result."""
    p, q, steps = _trial(held, t), _trial(second, t), int(HOLD_S / dt)
    over_held, fine_held = rest(p, walls, dt, ITERATIONS, steps, SETTLE_DAMPING)
    over_second, fine_second = rest(q, walls_second, dt, ITERATIONS, steps, SETTLE_DAMPING)
    leaked, error, well = 0, 0.0, fine_held and fine_second
    if well and over_held == 0 and over_second == 0 and not short[t]:
        leaked, error, well = _fill(
            p, walls, q, walls_second, flight[t], T_held[t], _vector(lips_world, t), _vector(lips, t),
            T_second[t], _vector(axes, t), tilts[t], dt, rim,
        )  # fmt: skip
    found[t, 0], found[t, 1], found[t, 2], found[t, 3] = over_held, fine_held, over_second, fine_second
    found[t, 4], found[t, 5], found[t, 6], found[t, 7], found[t, 8] = (
        p.count[0],
        q.count[0],
        leaked,
        error,
        well,
    )
