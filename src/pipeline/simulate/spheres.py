"""Spheres in one container, moved by Bullet in the container's frame, where gravity turns and the wall stands still.

The container is its scanned mesh (a concave one may not move in Bullet, and spheres leak from one that is teleported).
A world is made for each run and thrown away, so that a run depends on its arguments alone.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pybullet

from pipeline.geometry import bodies
from pipeline.geometry.cavity import Cavity
from pipeline.simulate.fields import Walls
from pipeline.simulate.forces import Response

SOLVER_ITERATIONS = 20  # with 10 what lies at the bottom of a full jug is pressed through its floor
DENSITY_KG_M3 = 1000.0
SPEED_LIMIT = 8.0  # m/s, as for the liquid
_MARGIN_M = 0.0005  # Bullet's skin about the container's triangles
_LOOK_AHEAD = 0.3  # spacings: Bullet's contacts begin that far off; its own 20 mm costs four times as much
_FARTHEST = 0.6  # radii that a sphere moves between two looks at contacts: beyond 1 its centre could pass a wall unseen
_FINEST = 16
_WALL, _SPHERES = 1, 2  # collision groups


@dataclass(frozen=True)
class Matter:
    """What the spheres are. `response` gives the forces between them (x, v) that are not contacts; `collide`: whether
    they touch each other; `calming` (1/s) damps them while they settle.
    """

    step_s: float
    friction: float
    restitution: float
    collide: bool
    calming: float = 0.0
    response: Callable[[np.ndarray, np.ndarray], Response] | None = None


@dataclass(frozen=True, eq=False)
class Pot:
    """A container for spheres of one radius, each of which stands for spacing_m³ of contents. Object frame, metres.

    `settled` remembers states at rest, and what leaked on the way, by their number of spheres; no part of the pot's value.
    """

    cavity: Cavity
    spacing_m: float
    radius_m: float
    vertices_m: np.ndarray
    triangles: np.ndarray
    walls: Walls
    matter: Matter
    settled: dict[int, tuple[np.ndarray, int]] = field(default_factory=dict, repr=False)


class World:
    """One Bullet world with a container at the origin and spheres; use as a context manager."""

    def __init__(self, pot: Pot) -> None:
        self._client = pybullet.connect(pybullet.DIRECT)
        self._pot = pot
        self._spheres: list[int] = []
        self._state: tuple[np.ndarray, np.ndarray] | None = None
        self._errors = np.zeros(2)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=pot.matter.step_s,
            numSolverIterations=SOLVER_ITERATIONS,
            deterministicOverlappingPairs=1,
            contactBreakingThreshold=_LOOK_AHEAD * pot.spacing_m,
            physicsClientId=self._client,
        )
        wall = bodies.concave(pot.vertices_m, pot.triangles, self._client)
        self._body(0.0, wall, [0.0, 0.0, 0.0], _WALL, _SPHERES)
        self._sphere = pybullet.createCollisionShape(
            pybullet.GEOM_SPHERE, radius=pot.radius_m, physicsClientId=self._client
        )

    def __enter__(self) -> "World":
        return self

    def __exit__(self, *_: object) -> None:
        pybullet.disconnect(physicsClientId=self._client)

    def __len__(self) -> int:
        return len(self._spheres)

    @property
    def density_error(self) -> float:
        """Mean |density − 1| over all steps, away from the free surface; NaN where there is no density."""
        return float(self._errors[0] / self._errors[1]) if self._errors[1] else np.nan

    def _body(self, mass_kg: float, shape: int, at: list[float], group: int, others: int) -> int:
        # Maximal coordinates: a rigid body, not a chain of links with a single one.
        body = pybullet.createMultiBody(
            mass_kg, shape, -1, at, useMaximalCoordinates=1, physicsClientId=self._client
        )
        # Bullet multiplies the two bodies' coefficients.
        pybullet.changeDynamics(
            body,
            -1,
            lateralFriction=float(np.sqrt(self._pot.matter.friction)),
            restitution=float(np.sqrt(self._pot.matter.restitution)),
            linearDamping=0.0,
            angularDamping=0.0,
            collisionMargin=_MARGIN_M,
            activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            physicsClientId=self._client,
        )
        pybullet.setCollisionFilterGroupMask(body, -1, group, others, physicsClientId=self._client)
        return body

    def add(self, x: np.ndarray, v: np.ndarray | None = None) -> None:
        """Add spheres at x (n, 3) with velocities v (n, 3)."""
        mass_kg = DENSITY_KG_M3 * self._pot.spacing_m**3
        touched = _WALL | _SPHERES if self._pot.matter.collide else _WALL
        for number, point in enumerate(x):
            body = self._body(mass_kg, self._sphere, point.tolist(), _SPHERES, touched)
            if v is not None:
                pybullet.resetBaseVelocity(body, v[number].tolist(), physicsClientId=self._client)
            self._spheres.append(body)
        self._state = None

    def remove(self, gone: np.ndarray) -> None:
        """Take spheres (n,) out of the world."""
        if not gone.any():
            return
        for body in np.array(self._spheres, dtype=int)[gone]:
            pybullet.removeBody(int(body), physicsClientId=self._client)
        self._spheres = [body for body, left in zip(self._spheres, gone, strict=True) if not left]
        self._state = None

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """Return positions and velocities (n, 3)."""
        if self._state is None:
            client = self._client
            x = [pybullet.getBasePositionAndOrientation(body, client)[0] for body in self._spheres]
            v = [pybullet.getBaseVelocity(body, client)[0] for body in self._spheres]
            self._state = np.reshape(x, (-1, 3)), np.reshape(v, (-1, 3))
        return self._state

    def step(
        self,
        gravity: np.ndarray,
        turning: np.ndarray,
        growth: np.ndarray,
        pivot: np.ndarray,
        calming: float = 0.0,
    ) -> None:
        """Advance by a time step in a frame that turns about `pivot` with `turning` (rad/s), growing by `growth` (rad/s²).

        `calming` (1/s) takes speed away.
        """
        pybullet.setGravity(*gravity.tolist(), physicsClientId=self._client)
        x, v = self.state()
        turns = turning.any() or growth.any()
        if len(self) and (turns or calming or self._pot.matter.response):
            acceleration = -calming * v
            if turns:
                spin = _crossed(turning)
                acceleration += (x - pivot) @ (_crossed(growth) - spin @ spin) + 2.0 * v @ spin
            if self._pot.matter.response:
                answer = self._pot.matter.response(x, v)
                acceleration += answer.acceleration
                error = np.abs(answer.density[answer.inside] - 1.0)
                self._errors += error.sum(), len(error)
            self._apply(DENSITY_KG_M3 * self._pot.spacing_m**3 * acceleration, x)
        pybullet.setPhysicsEngineParameter(numSubSteps=self._substeps(v), physicsClientId=self._client)
        pybullet.stepSimulation(physicsClientId=self._client)
        self._state = None

    def _substeps(self, v: np.ndarray) -> int:
        """Return into how many steps under the same forces Bullet divides one, 0 for none: a power of 2, exact in time."""
        way_m = np.sqrt((v**2).sum(axis=1).max(initial=0.0)) * self._pot.matter.step_s
        steps = 1
        while way_m > _FARTHEST * self._pot.radius_m * steps and steps < _FINEST:
            steps *= 2
        return steps if steps > 1 else 0

    def _apply(self, forces: np.ndarray, x: np.ndarray) -> None:
        for body, force, at in zip(self._spheres, forces.tolist(), x.tolist(), strict=True):
            pybullet.applyExternalForce(body, -1, force, at, pybullet.WORLD_FRAME, self._client)


def _crossed(b: np.ndarray) -> np.ndarray:
    """Return the matrix K (3, 3) for which a @ K is a × b."""
    x, y, z = b
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
