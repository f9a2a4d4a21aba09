"""A pot with spheres is tilted about its lip, in its own frame, until nothing more will leave it."""

import numpy as np

from pipeline.geometry import frames
from pipeline.simulate.packing import DOWN
from pipeline.simulate.pouring import BRINK, QUIET_S, QUIET_SPEED, TILT_S
from pipeline.simulate.rest import GRAVITY
from pipeline.simulate.spheres import SPEED_LIMIT, Pot, World
from pipeline.simulate.whereabouts import places

ROLLING = 1.4  # a rolling sphere's energy by that of its centre
Flight = tuple[float, np.ndarray, np.ndarray]  # s, m, m/s


class Tilting:
    """A cup's turn about its lip, in its own frame, and what left it: (time, position, velocity) in that frame."""

    def __init__(
        self, lip_m: np.ndarray, axis: np.ndarray, tilt_rad: float, wait_s: float, patient: bool
    ) -> None:
        self.lip_m, self.axis, self.tilt_rad = lip_m, axis, tilt_rad
        self.wait_s, self.patient = wait_s, patient
        self.gone: list[Flight] = []
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
        """Tilt and wait until nothing leaves, and nothing moves or nothing can reach the rim; at most `wait_s`."""
        last_s = TILT_S
        for k in range(int((TILT_S + self.wait_s) / pot.matter.step_s)):
            time_s = k * pot.matter.step_s
            tilt, speed, growth = self.motion(time_s)
            gravity = frames.rotation_about(self.axis, -tilt) @ DOWN
            world.step(gravity, speed * self.axis, growth * self.axis, self.lip_m)
            x, v = world.state()
            if not sane(world):
                self.failed = True
                return
            where = places(pot, x)
            if where.over.any() or where.through.any():
                last_s = max(last_s, time_s)
                self.gone += [(time_s, *both) for both in zip(x[where.over], v[where.over], strict=True)]
                self.leaked += int(where.through.sum())
                world.remove(where.over | where.through)
            self.history.append((tilt, len(world)))
            if len(world) == 0:
                return
            if not self.patient and self._ended(world, pot, gravity, time_s, last_s):
                return

    def _ended(self, world: World, pot: Pot, gravity: np.ndarray, time_s: float, last_s: float) -> bool:
        if time_s < TILT_S:
            return False
        if not can_reach(world, pot, gravity):
            return True
        quiet = time_s - last_s > QUIET_S and calm(world)
        # One late sphere would change the label: before the first has left, all must be well below the rim.
        return quiet and (bool(self.gone) or not can_reach(world, pot, gravity, BRINK * pot.spacing_m))


def can_reach(world: World, pot: Pot, gravity: np.ndarray, below_m: float = 0.0) -> bool:
    """Return whether any sphere has the energy to rise to `below_m` below the rim."""
    x, v = world.state()
    up = -gravity / GRAVITY
    edge_m = (pot.cavity.rim_m @ up).min() - float(pot.walls.lowered) * max(up[2], 0.0)
    return bool((x @ up + ROLLING * (v**2).sum(axis=1) / (2.0 * GRAVITY) > edge_m - below_m).any())


def calm(world: World) -> bool:
    """Return whether next to nothing moves."""
    _, v = world.state()
    return len(v) == 0 or bool(np.sqrt((v**2).sum(axis=1).mean()) < QUIET_SPEED)


def sane(world: World) -> bool:
    """Return whether all numbers are finite and nothing is faster than is physical."""
    x, v = world.state()
    return bool(np.isfinite(x).all() and (np.abs(v) < SPEED_LIMIT).all())
