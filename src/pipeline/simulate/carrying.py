"""Gel balls in a cup that a robot carries along poses, and in the container into which it pours them.

As in the trials, each container's balls move in its own frame, where its wall stands still: the cup's frame accelerates and turns
as the poses do. Balls do not see the held cup's outside.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from pipeline.geometry import frames
from pipeline.simulate.packing import DOWN, settle, stand, still
from pipeline.simulate.pouring import QUIET_S
from pipeline.simulate.rest import HOLD_S
from pipeline.simulate.spheres import Pot, World
from pipeline.simulate.tilting import calm, can_reach, sane
from pipeline.simulate.whereabouts import places

CATCH_S = 3.0  # how long the second container is watched after the last ball has left the cup
Watch = Callable[[float, np.ndarray], None]  # is told the time (s) and the balls' places (n, 3) in the world
UNWATCHED = (None, None)


@dataclass(frozen=True)
class Motion:
    """A cup's motion in steps of `step_s`: poses (K, 4, 4) in the world; the rest (K, 3) in the cup's own frame.

    gravity includes what the frame's acceleration adds; turning (rad/s) and growth (rad/s²) are its rotation.
    """

    step_s: float
    T_world_cup: np.ndarray
    velocity_world: np.ndarray
    gravity: np.ndarray
    turning: np.ndarray
    growth: np.ndarray


def motion(T_world_cup: np.ndarray, every_s: float, step_s: float) -> Motion:
    """Return the motion through poses (T, 4, 4) that are `every_s` apart, smooth between them."""
    times = np.arange(len(T_world_cup)) * every_s
    fine = np.arange(0.0, times[-1] + 1e-9, step_s)
    place = CubicSpline(times, T_world_cup[:, :3, 3], bc_type="clamped")
    R = RotationSpline(times, Rotation.from_matrix(T_world_cup[:, :3, :3]))(fine).as_matrix()
    poses = np.tile(np.eye(4), (len(fine), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = R, place(fine)
    after, before = np.roll(R, -1, axis=0), np.roll(R, 1, axis=0)
    turning = Rotation.from_matrix(np.swapaxes(before, 1, 2) @ after).as_rotvec() / (2.0 * step_s)
    turning[[0, -1]] = 0.0
    gravity = np.einsum("kij,ki->kj", R, DOWN - place(fine, 2))
    return Motion(step_s, poses, place(fine, 1), gravity, turning, np.gradient(turning, step_s, axis=0))


@dataclass
class Ball:
    """A ball that left the cup: when (s), where and how fast in the world; what became of it."""

    time_s: float
    x_world: np.ndarray
    v_world: np.ndarray
    landed: bool = False  # has been in the second container
    outside: bool = False


@dataclass
class Carried:
    """What happened: n balls at first, `balls` that left the cup, in order, how many are left in it, and failures."""

    n: int
    balls: list[Ball] = field(default_factory=list)
    n_retained: int = 0
    n_leaked: int = 0
    failed: bool = False

    @property
    def n_in_target(self) -> int:
        """How many came to rest in the second container."""
        return sum(not ball.outside for ball in self.balls)


def carry(
    held: Pot,
    second: Pot,
    moving: Motion,
    T_world_second: np.ndarray,
    n: int,
    seed: int,
    watch: tuple[Watch | None, Watch | None] = UNWATCHED,
) -> Carried:
    """Carry n balls along a motion, pour, and look at the second container until it is calm.

    `watch`: who is told of the balls in the cup, and of those that left it.
    """
    result = Carried(n)
    start, result.n_leaked = settle(held, n, (seed, 0))
    with World(held) as cup:
        cup.add(start)
        result.n_leaked += stand(cup, held, HOLD_S)
        _empty(cup, held, moving, result, watch[0])
        result.n_retained = len(cup)
    if result.balls and not result.failed:
        with World(second) as below:
            _catch(below, second, T_world_second, result, watch[1])
    result.failed |= result.n_leaked > 0
    return result


def _empty(cup: World, pot: Pot, moving: Motion, result: Carried, watch: Watch | None) -> None:
    for k, T_world_cup in enumerate(moving.T_world_cup):
        if watch:
            watch(k * moving.step_s, frames.apply(T_world_cup, cup.state()[0]))
        cup.step(moving.gravity[k], moving.turning[k], moving.growth[k], np.zeros(3))
        if not sane(cup):
            result.failed = True
            return
        x, v = cup.state()
        where = places(pot, x)
        for number in np.flatnonzero(where.over):
            v_body = v[number] + np.cross(moving.turning[k], x[number])
            v_world = moving.velocity_world[k] + T_world_cup[:3, :3] @ v_body
            result.balls.append(Ball(k * moving.step_s, frames.apply(T_world_cup, x[number]), v_world))
        result.n_leaked += int(where.through.sum())
        cup.remove(where.over | where.through)
        if len(cup) == 0 and not watch:
            return


def _catch(below: World, pot: Pot, T_world_second: np.ndarray, result: Carried, watch: Watch | None) -> None:
    """Let the balls fly; those that pass the second container's rim on its outside are outside, and gone."""
    T_second_world = frames.inverse(T_world_second)
    waiting, flying = list(result.balls), []
    time_s = last_s = waiting[0].time_s
    end_s = waiting[-1].time_s + CATCH_S
    while time_s < end_s:
        while waiting and waiting[0].time_s <= time_s:
            ball = waiting.pop(0)
            x = frames.apply(T_second_world, ball.x_world)[None]
            below.add(x, frames.rotate(T_second_world, ball.v_world)[None])
            flying.append(ball)
        still(below)
        time_s += pot.matter.step_s
        if not sane(below):
            result.failed = True
            return
        x, _ = below.state()
        if watch:
            watch(time_s, frames.apply(T_world_second, x))
        where = places(pot, x)
        landed = np.array([ball.landed for ball in flying], dtype=bool) | (where.under & ~where.beyond)
        # A rim's crest divides: what comes down on its outer side never was inside.
        outside = np.where(landed, where.beyond & where.above, where.beyond & where.under)
        through = where.through & landed & ~outside
        for ball, in_, out in zip(flying, landed, outside | through, strict=True):
            ball.landed, ball.outside = bool(in_), bool(out)
        result.n_leaked += int(through.sum())
        if (outside | through).any():
            below.remove(outside | through)
            flying, last_s = [ball for ball in flying if not ball.outside], time_s
        quiet = time_s - last_s > QUIET_S and calm(below)
        done = quiet or (not watch and not can_reach(below, pot, DOWN))
        if not waiting and all(ball.landed for ball in flying) and done:
            return
