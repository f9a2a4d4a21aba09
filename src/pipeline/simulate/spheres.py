"""Rigid spheres in one container, moved by Bullet in the container's frame, where gravity turns and the wall stands still.

The container is its scanned mesh (a concave one may not move in Bullet, and spheres leak from one that is teleported).
A world is made for each run and thrown away, so that a run depends on its arguments alone.
"""

from dataclasses import dataclass, field

import numpy as np
import pybullet

from pipeline.geometry.cavity import Cavity
from pipeline.simulate.containers import decimated

STEP_S = 1.0 / 240.0  # Bullet's own default
SOLVER_ITERATIONS = 10
FRICTION = 0.1  # swollen hydrogel is slippery; ours
RESTITUTION = 0.2  # ours
DENSITY_KG_M3 = 1000.0
SPEED_LIMIT = 8.0  # m/s, as for the liquid
_MARGIN_M = 0.0005  # Bullet's skin about the container's triangles


@dataclass(frozen=True, eq=False)
class Pot:
    """A container for spheres of one radius, each of which stands for spacing_m³ of contents. Object frame, metres.

    `settled` remembers states at rest by their number of spheres; it is no part of the pot's value.
    """

    cavity: Cavity
    spacing_m: float
    radius_m: float
    vertices_m: np.ndarray
    triangles: np.ndarray
    settled: dict[int, np.ndarray] = field(default_factory=dict, repr=False)


def simplified(vertices_m: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a mesh that Bullet handles fast."""
    return decimated(vertices_m, triangles)


class World:
    """One Bullet world with a container at the origin and spheres; use as a context manager."""

    def __init__(self, pot: Pot) -> None:
        self._client = pybullet.connect(pybullet.DIRECT)
        self._pot = pot
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=STEP_S,
            numSolverIterations=SOLVER_ITERATIONS,
            deterministicOverlappingPairs=1,
            physicsClientId=self._client,
        )
        wall = pybullet.createCollisionShape(
            pybullet.GEOM_MESH,
            vertices=pot.vertices_m.tolist(),
            indices=pot.triangles.ravel().tolist(),
            flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
            physicsClientId=self._client,
        )
        self._touching(pybullet.createMultiBody(0.0, wall, physicsClientId=self._client))
        self._sphere = pybullet.createCollisionShape(
            pybullet.GEOM_SPHERE, radius=pot.radius_m, physicsClientId=self._client
        )
        self._spheres: list[int] = []

    def __enter__(self) -> "World":
        return self

    def __exit__(self, *_: object) -> None:
        pybullet.disconnect(physicsClientId=self._client)

    def __len__(self) -> int:
        return len(self._spheres)

    def _touching(self, body: int) -> None:
        # Bullet multiplies the two bodies' coefficients.
        pybullet.changeDynamics(
            body,
            -1,
            lateralFriction=float(np.sqrt(FRICTION)),
            restitution=float(np.sqrt(RESTITUTION)),
            linearDamping=0.0,
            angularDamping=0.0,
            collisionMargin=_MARGIN_M,
            physicsClientId=self._client,
        )

    def add(self, x: np.ndarray, v: np.ndarray | None = None) -> None:
        """Add spheres at x (n, 3) with velocities v (n, 3)."""
        mass_kg = DENSITY_KG_M3 * self._pot.spacing_m**3
        for number, point in enumerate(x):
            body = pybullet.createMultiBody(
                mass_kg, self._sphere, -1, point.tolist(), physicsClientId=self._client
            )
            self._touching(body)
            if v is not None:
                pybullet.resetBaseVelocity(body, v[number].tolist(), physicsClientId=self._client)
            self._spheres.append(body)

    def remove(self, gone: np.ndarray) -> None:
        """Take spheres (n,) out of the world."""
        for body in np.array(self._spheres, dtype=int)[gone]:
            pybullet.removeBody(int(body), physicsClientId=self._client)
        self._spheres = [body for body, left in zip(self._spheres, gone, strict=True) if not left]

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """Return positions and velocities (n, 3)."""
        x = [
            pybullet.getBasePositionAndOrientation(b, physicsClientId=self._client)[0] for b in self._spheres
        ]
        v = [pybullet.getBaseVelocity(b, physicsClientId=self._client)[0] for b in self._spheres]
        return np.reshape(x, (-1, 3)), np.reshape(v, (-1, 3))

    def step(self, gravity: np.ndarray, turning: np.ndarray, growth: np.ndarray, pivot: np.ndarray) -> None:
        """Advance by STEP_S in a frame that turns about `pivot` with `turning` (rad/s), growing by `growth` (rad/s²)."""
        pybullet.setGravity(*gravity.tolist(), physicsClientId=self._client)
        if turning.any() or growth.any():
            x, v = self.state()
            arm = x - pivot
            inertial = (
                np.cross(arm, growth) + np.cross(np.cross(turning, arm), turning) + 2.0 * np.cross(v, turning)
            )
            forces = DENSITY_KG_M3 * self._pot.spacing_m**3 * inertial
            for body, force, at in zip(self._spheres, forces.tolist(), x.tolist(), strict=True):
                pybullet.applyExternalForce(
                    body, -1, force, at, pybullet.WORLD_FRAME, physicsClientId=self._client
                )
        pybullet.stepSimulation(physicsClientId=self._client)


def placed(pot: Pot, n: int) -> np.ndarray:
    """Return the n lowest points of a lattice on which spheres fit inside, piled up above the opening if need be."""
    from scipy.ndimage import map_coordinates

    cup, pitch = pot.cavity, 2.02 * pot.radius_m
    low, high = cup.origin_m, cup.origin_m + cup.cell_m * np.array(cup.interior.shape)
    opening_m2 = np.pi * np.hypot(*(cup.rim_m - cup.opening_m)[:, :2].T).mean() ** 2
    top = cup.rim_m[:, 2].max() + 4 * pitch + 3 * n * pitch**3 / opening_m2
    axes = [np.arange(a, b, pitch) for a, b in zip(low, (high[0], high[1], top), strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    radius, height = cup.rim_at(points[:, 0], points[:, 1])
    distance = map_coordinates(cup.distance_m, ((points - low) / cup.cell_m).T, order=1, mode="nearest")
    room = map_coordinates(
        cup.interior.astype(float), ((points - low) / cup.cell_m).T, order=1, mode="constant"
    )
    from_axis = np.hypot(points[:, 0] - cup.opening_m[0], points[:, 1] - cup.opening_m[1])
    above = points[:, 2] >= height + pot.radius_m
    inside = (points[:, 2] < height) & (room > 0.5) & (distance > 1.05 * pot.radius_m)
    points = points[inside | (above & (radius - from_axis > 1.3 * pot.radius_m))]
    return points[np.argsort(points[:, 2], kind="stable")[:n]]


def whereabouts(pot: Pot, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which spheres (n,) are outside over the rim, and which are beyond the wall below it."""
    from scipy.ndimage import map_coordinates

    cup = pot.cavity
    radius, height = cup.rim_at(x[:, 0], x[:, 1])
    from_axis = np.hypot(x[:, 0] - cup.opening_m[0], x[:, 1] - cup.opening_m[1])
    beyond = from_axis > radius
    over = (beyond & (x[:, 2] >= height - 0.5 * pot.radius_m)) | (
        x[:, 2] > cup.rim_m[:, 2].max() + 3 * pot.spacing_m
    )
    at = (x - cup.origin_m) / cup.cell_m
    distance = map_coordinates(cup.distance_m, at.T, order=1, mode="nearest")
    low = (at < 0).any(axis=1)
    through = ~over & (x[:, 2] < height) & ((distance < -0.25 * pot.radius_m) | low)
    return over, through
