"""The second engine: gel balls, rigid spheres in Bullet, in the same trials as the liquid and with the same results.

There are as many balls as the liquid has particles, and their radius is such that the container, filled with them, is as full as
with liquid: a ball and the gaps about it are one particle's volume. `prepare`, `pour` and `fill` answer as those of `liquid` do,
density errors aside; a trial in which a ball went through a wall has failed.
"""

import numpy as np

from pipeline.geometry import frames
from pipeline.geometry.cavity import Cavity, room_m3
from pipeline.simulate.filling import HELD_WAIT_S, SECOND_WAIT_S, Filling
from pipeline.simulate.pouring import QUIET_S, QUIET_SPEED, TILT_S, WAIT_S, Pour
from pipeline.simulate.rest import GRAVITY, HOLD_S
from pipeline.simulate.spheres import SPEED_LIMIT, STEP_S, Pot, World, placed, simplified, whereabouts

PACKING = 0.58  # of equal spheres poured into a small cup; where the calibration starts
TOLERANCE = 0.02
_CALIBRATIONS = 3
_CALIBRATED_AT = 0.7  # of the capacity
_SETTLE_S = 1.0
_LEVELS = 1.1
_JITTER = 0.01  # spacings
_SHARE_OF_TOP_LAYER = 0.6
_STILL = np.zeros(3)
_DOWN = np.array([0.0, 0.0, -GRAVITY])


def prepare(cavity: Cavity, vertices_m: np.ndarray, triangles: np.ndarray, spacing_m: float) -> Pot:
    """Return a container for balls that stand for spacing_m³ each, their radius calibrated by the level of a fill."""
    mesh = simplified(vertices_m, triangles)
    radius_m = spacing_m * (PACKING * 3.0 / (4.0 * np.pi)) ** (1.0 / 3.0)
    n = max(8, round(_CALIBRATED_AT * cavity.capacity_m3 / spacing_m**3))
    for _ in range(_CALIBRATIONS):
        pot = Pot(cavity, spacing_m, radius_m, *mesh)
        filled_m3 = bulk_m3(pot, _settled(pot, n))
        wanted_m3 = n * spacing_m**3
        if abs(filled_m3 - wanted_m3) <= TOLERANCE * wanted_m3:
            break
        radius_m *= float(np.clip(wanted_m3 / filled_m3, 0.7, 1.4)) ** (1.0 / 3.0)
    return pot


def bulk_m3(pot: Pot, x: np.ndarray) -> float:
    """Return the room below the mean top of the uppermost balls of x (n, 3) at rest."""
    cup, room = pot.cavity, room_m3(pot.cavity)
    below_m3 = room.sum(axis=(0, 1)).cumsum()
    tops = cup.origin_m[2] + cup.cell_m * (np.arange(len(below_m3)) + 0.5)
    area_m2 = np.gradient(below_m3, cup.cell_m)
    height = np.sort(x[:, 2])[::-1]
    surface_m2 = float(np.interp(height[0], tops, area_m2))
    layer = max(1, min(len(x), round(_SHARE_OF_TOP_LAYER * surface_m2 / (2.0 * pot.radius_m) ** 2)))
    return float(np.interp(height[:layer].mean() + pot.radius_m, tops, below_m3))


def particles_for(pot: Pot, volume_m3: float) -> int:
    """Return how many balls a volume is."""
    return round(volume_m3 / pot.spacing_m**3)


def pour(pot: Pot, n: int, lip_m: np.ndarray, axis: np.ndarray, tilt_rad: float, seed: int) -> Pour:
    """Tilt a container with n balls about `axis` (3,) through `lip_m` (3,), object frame; as `liquid.pour`."""
    start = _settle(pot, n, (seed, 0))
    tilting = _Tilting(lip_m, axis, tilt_rad, WAIT_S)
    with World(pot) as world:
        world.add(start)
        _rest(world, pot, HOLD_S)
        tilting.run(world, pot)
        retained = len(world)
    left = n - retained - tilting.leaked
    history = np.array(tilting.history).reshape(-1, 2)
    return Pour(
        n, left, retained, tilting.leaked, np.nan, tilting.failed, history[:, 1] / max(n, 1), history[:, 0]
    )


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
    """Pour n_held balls into a second container with n_second; as `liquid.fill`. Balls do not see the held cup's outside."""
    n = n_held + n_second
    balls, others = _settle(held, n_held, (seed, 0)), _settle(second, n_second, (seed, 1))
    tilting = _Tilting(lip_m, T_world_held[:3, :3].T @ axis_world, tilt_rad, HELD_WAIT_S)
    with World(held) as cup, World(second) as below:
        cup.add(balls)
        below.add(others)
        _rest(cup, held, HOLD_S)
        _rest(below, second, HOLD_S)
        if len(cup) < n_held or len(below) < n_second:
            return Filling(n, len(cup), len(below), 0, 0, np.nan, False, True)
        tilting.run(cup, held)
        flights = [_flight(*gone, T_world_held, T_world_second, tilting) for gone in tilting.gone]
        leaked, failed = _catch(below, second, flights)
        leaked += tilting.leaked
        retained, caught = len(cup), len(below)
    failed = failed or leaked > 0 or tilting.failed
    return Filling(n, retained, caught, n - retained - caught - leaked, leaked, np.nan, failed, False)


class _Tilting:
    """A cup's turn about its lip, in its own frame, and what left it: (time, position, velocity) in that frame."""

    def __init__(self, lip_m: np.ndarray, axis: np.ndarray, tilt_rad: float, wait_s: float) -> None:
        self.lip_m, self.axis, self.tilt_rad, self.wait_s = lip_m, axis, tilt_rad, wait_s
        self.gone: list[tuple[float, np.ndarray, np.ndarray]] = []
        self.history: list[tuple[float, int]] = []
        self.leaked, self.failed = 0, False

    def motion(self, time_s: float) -> tuple[float, float, float]:
        """Return tilt (rad), its speed and its growth: a smoothstep over TILT_S."""
        u = min(max(time_s / TILT_S, 0.0), 1.0)
        if u in (0.0, 1.0):
            return self.tilt_rad * u, 0.0, 0.0
        return (
            self.tilt_rad * u * u * (3.0 - 2.0 * u),
            self.tilt_rad * 6.0 * u * (1.0 - u) / TILT_S,
            self.tilt_rad * (6.0 - 12.0 * u) / TILT_S**2,
        )

    def run(self, world: World, pot: Pot) -> None:
        """Tilt and wait until nothing leaves and nothing moves, at most `wait_s`."""
        last_s = TILT_S
        for k in range(int((TILT_S + self.wait_s) / STEP_S)):
            time_s = k * STEP_S
            tilt, speed, growth = self.motion(time_s)
            gravity = frames.rotation_about(self.axis, -tilt) @ _DOWN
            world.step(gravity, speed * self.axis, growth * self.axis, self.lip_m)
            x, v = world.state()
            if not (np.isfinite(x).all() and (np.abs(v) < SPEED_LIMIT).all()):
                self.failed = True
                return
            over, through = whereabouts(pot, x)
            if over.any() or through.any():
                last_s = max(last_s, time_s)
                self.gone += [(time_s, *both) for both in zip(x[over], v[over], strict=True)]
                self.leaked += int(through.sum())
                self.failed = self.leaked > 0
                world.remove(over | through)
            self.history.append((tilt, len(world)))
            calm = len(v) == 0 or np.sqrt((v**2).sum(axis=1).mean()) < QUIET_SPEED
            if len(world) == 0 or (time_s - last_s > QUIET_S and calm):
                return


def _flight(
    time_s: float,
    x: np.ndarray,
    v: np.ndarray,
    T_world_held: np.ndarray,
    T_world_second: np.ndarray,
    tilting: _Tilting,
) -> tuple[float, np.ndarray, np.ndarray]:
    """Return when, where and how fast a ball that left the held cup is, in the second's frame."""
    tilt, speed, _ = tilting.motion(time_s)
    R = T_world_held[:3, :3] @ frames.rotation_about(tilting.axis, tilt)
    arm = x - tilting.lip_m
    x_world = frames.apply(T_world_held, tilting.lip_m) + R @ arm
    v_world = R @ (v + speed * np.cross(tilting.axis, arm))
    T_second_world = frames.inverse(T_world_second)
    return time_s, frames.apply(T_second_world, x_world), frames.rotate(T_second_world, v_world)


def _catch(world: World, pot: Pot, flights: list[tuple[float, np.ndarray, np.ndarray]]) -> tuple[int, bool]:
    """Let balls fly into the second container; return how many leaked and whether it failed. Those outside are gone."""
    cup, leaked = pot.cavity, 0
    if not flights:
        return 0, False
    time_s = flights[0][0]
    end_s, waiting = time_s + TILT_S + HELD_WAIT_S + 2 * SECOND_WAIT_S, list(flights)
    last_s = time_s
    while time_s < end_s:
        while waiting and waiting[0][0] <= time_s:
            _, x, v = waiting.pop(0)
            world.add(x[None], v[None])
            last_s = time_s
        world.step(_DOWN, _STILL, _STILL, _STILL)
        time_s += STEP_S
        x, v = world.state()
        if not (np.isfinite(x).all() and (np.abs(v) < SPEED_LIMIT).all()):
            return leaked, True
        radius, height = cup.rim_at(x[:, 0], x[:, 1])
        beyond = np.hypot(x[:, 0] - cup.opening_m[0], x[:, 1] - cup.opening_m[1]) > radius
        outside = beyond & (x[:, 2] < height)
        through = whereabouts(pot, x)[1] & ~beyond
        leaked += int(through.sum())
        if outside.any() or through.any():
            world.remove(outside | through)
            last_s = time_s
        calm = len(v) == 0 or np.sqrt((v**2).sum(axis=1).mean()) < QUIET_SPEED
        flying = (x[:, 2] > cup.rim_m[:, 2].max() + 3 * pot.spacing_m).any()
        if not waiting and not flying and time_s - last_s > QUIET_S and calm:
            break
    return leaked, False


def _settle(pot: Pot, n: int, seed: tuple[int, int]) -> np.ndarray:
    """Return up to n balls at rest (n, 3), the lowest of a shared settled state, with a jitter drawn from the seed."""
    level = 8
    while level < n:
        level = int(np.ceil(level * _LEVELS))
    at_rest = _settled(pot, level)
    lowest = at_rest[np.argsort(at_rest[:, 2], kind="stable")[:n]]
    return lowest + np.random.default_rng(seed).normal(0.0, _JITTER * pot.spacing_m, lowest.shape)


def _settled(pot: Pot, n: int) -> np.ndarray:
    """Return what stays of n balls that fall from a lattice (m, 3); made once a pot and number."""
    if n not in pot.settled:
        with World(pot) as world:
            world.add(placed(pot, n))
            _rest(world, pot, _SETTLE_S)
            pot.settled[n] = world.state()[0]
    return pot.settled[n]


def _rest(world: World, pot: Pot, seconds: float) -> None:
    """Let a container stand still; what runs over is gone."""
    for _ in range(round(seconds / STEP_S)):
        world.step(_DOWN, _STILL, _STILL, _STILL)
    x, _ = world.state()
    cup = pot.cavity
    radius, height = cup.rim_at(x[:, 0], x[:, 1])
    beyond = np.hypot(x[:, 0] - cup.opening_m[0], x[:, 1] - cup.opening_m[1]) > radius
    world.remove(beyond | (x[:, 2] > height + pot.spacing_m) | whereabouts(pot, x)[1])
