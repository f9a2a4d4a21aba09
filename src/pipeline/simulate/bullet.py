"""Trials by Bullet: its spheres, gel balls or fluid, in the same trials as the liquid and with the same results.

`pour` and `fill` answer as those of `liquid` do; a trial in which a sphere went through a wall has failed.
"""

import numpy as np

from pipeline.geometry import frames
from pipeline.simulate.filling import HELD_WAIT_S, SECOND_WAIT_S, Filling
from pipeline.simulate.packing import DOWN, settle, stand, still
from pipeline.simulate.pouring import QUIET_S, TILT_S, WAIT_S, Pour
from pipeline.simulate.rest import HOLD_S
from pipeline.simulate.spheres import Pot, World
from pipeline.simulate.tilting import Flight, Tilting, calm, can_reach, sane
from pipeline.simulate.whereabouts import places


def particles_for(pot: Pot, volume_m3: float) -> int:
    """Return how many spheres a volume is."""
    return round(volume_m3 / pot.spacing_m**3)


def pour(
    pot: Pot,
    n: int,
    lip_m: np.ndarray,
    axis: np.ndarray,
    tilt_rad: float,
    seed: int,
    *,
    wait_s: float = WAIT_S,
    patient: bool = False,
) -> Pour:
    """Tilt a container with n spheres about `axis` (3,) through `lip_m` (3,), object frame; as `liquid.pour`."""
    start, leaked = settle(pot, n, (seed, 0))
    if leaked:
        return Pour(n, 0, len(start), leaked, np.nan, True, np.zeros(0), np.zeros(0))
    tilting = Tilting(lip_m, axis, tilt_rad, wait_s, patient)
    with World(pot) as world:
        world.add(start)
        leaked = stand(world, pot, HOLD_S)
        tilting.run(world, pot)
        retained, error = len(world), world.density_error
    leaked += tilting.leaked
    history = np.array(tilting.history).reshape(-1, 2)
    failed = tilting.failed or leaked > 0
    kept = history[:, 1] / max(n, 1)
    return Pour(n, n - retained - leaked, retained, leaked, error, failed, kept, history[:, 0])


def fill(
    held: Pot,
    second: Pot,
    T_world_held: np.ndarray,
    T_world_second: np.ndarray,
    lip_m: np.ndarray,
    axis_world: np.ndarray,
    tilt_rad: float,
    n_held: int,
    n_second: int,
    seed: int,
) -> Filling:
    """Pour n_held spheres into a second container with n_second; as `liquid.fill`. They do not see the held cup's outside."""
    n = n_held + n_second
    (above, lost), (others, lost_too) = settle(held, n_held, (seed, 0)), settle(second, n_second, (seed, 1))
    if lost or lost_too:
        return Filling(n, len(above), len(others), 0, lost + lost_too, np.nan, True, False)
    tilting = Tilting(lip_m, T_world_held[:3, :3].T @ axis_world, tilt_rad, HELD_WAIT_S, patient=False)
    with World(held) as cup, World(second) as below:
        cup.add(above)
        below.add(others)
        leaked = stand(cup, held, HOLD_S) + stand(below, second, HOLD_S)
        if len(cup) < n_held or len(below) < n_second:
            return Filling(n, len(cup), len(below), 0, leaked, np.nan, leaked > 0, True)
        tilting.run(cup, held)
        flights = [_flight(*gone, T_world_held, T_world_second, tilting) for gone in tilting.gone]
        lost, well = _catch(below, second, flights)
        leaked += tilting.leaked + lost
        retained, caught, error = len(cup), len(below), below.density_error
    failed = not well or leaked > 0 or tilting.failed
    return Filling(n, retained, caught, n - retained - caught - leaked, leaked, error, failed, False)


def _flight(
    time_s: float,
    x: np.ndarray,
    v: np.ndarray,
    T_world_held: np.ndarray,
    T_world_second: np.ndarray,
    tilting: Tilting,
) -> Flight:
    """Return when, where and how fast a sphere that left the held cup is, in the second's frame."""
    tilt, speed, _ = tilting.motion(time_s)
    R = T_world_held[:3, :3] @ frames.rotation_about(tilting.axis, tilt)
    arm = x - tilting.lip_m
    x_world = frames.apply(T_world_held, tilting.lip_m) + R @ arm
    v_world = R @ (v + speed * np.cross(tilting.axis, arm))
    T_second_world = frames.inverse(T_world_second)
    return time_s, frames.apply(T_second_world, x_world), frames.rotate(T_second_world, v_world)


def _catch(world: World, pot: Pot, flights: list[Flight]) -> tuple[int, bool]:
    """Let spheres fly into the second container; return how many leaked and whether all is well. Those outside are gone."""
    if not flights:
        return 0, True
    time_s, leaked, waiting = flights[0][0], 0, list(flights)
    last_s, end_s = time_s, time_s + TILT_S + HELD_WAIT_S + 2 * SECOND_WAIT_S
    landed = np.ones(len(world), bool)
    while time_s < end_s:
        while waiting and waiting[0][0] <= time_s:
            _, x, v = waiting.pop(0)
            world.add(x[None], v[None])
            landed, last_s = np.append(landed, False), time_s
        still(world)
        time_s += pot.matter.step_s
        x, v = world.state()
        if not sane(world):
            return leaked, False
        where = places(pot, x)
        landed |= where.under & ~where.beyond
        # A rim's crest divides: what comes down on its outer side never was inside.
        outside = np.where(landed, where.beyond & where.above, where.beyond & where.under)
        through = where.through & landed & ~outside
        leaked += int(through.sum())
        if outside.any() or through.any():
            world.remove(outside | through)
            landed, last_s = landed[~(outside | through)], time_s
        quiet = time_s - last_s > QUIET_S and calm(world)
        if not waiting and landed.all() and (quiet or not can_reach(world, pot, DOWN)):
            break
    return leaked, True
