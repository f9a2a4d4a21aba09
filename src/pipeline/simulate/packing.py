"""Spheres at rest in a pot: let fall from a lattice, once for each level of fill, and shared by all trials."""

import numpy as np

from pipeline.simulate.rest import GRAVITY
from pipeline.simulate.spheres import Pot, World
from pipeline.simulate.whereabouts import places

SETTLE_S = 1.0
_LEVELS = 1.1
_JITTER = 0.01  # spacings
_STILL = np.zeros(3)
DOWN = np.array([0.0, 0.0, -GRAVITY])


def settle(pot: Pot, n: int, seed: tuple[int, int]) -> tuple[np.ndarray, int]:
    """Return up to n spheres at rest (n, 3), the lowest of a shared settled state, with a jitter drawn from the seed.

    Also how many went through the wall while that state settled.
    """
    level = 8
    while level < n:
        level = int(np.ceil(level * _LEVELS))
    at_rest, leaked = settled(pot, level)
    lowest = at_rest[np.argsort(at_rest[:, 2], kind="stable")[:n]]
    jitter = np.random.default_rng(seed).normal(0.0, _JITTER * pot.spacing_m, lowest.shape)
    return lowest + jitter, leaked


def settled(pot: Pot, n: int) -> tuple[np.ndarray, int]:
    """Return what stays of n spheres that fall from a lattice (m, 3), and how many leaked; made once a pot and number."""
    if n not in pot.settled:
        with World(pot) as world:
            world.add(placed(pot, n))
            leaked = stand(world, pot, SETTLE_S, pot.matter.calming)
            pot.settled[n] = world.state()[0], leaked
    return pot.settled[n]


def stand(world: World, pot: Pot, seconds: float, calming: float = 0.0) -> int:
    """Let a container stand still; what runs over is gone. Returns how many went through the wall, which are gone as well."""
    leaked = 0
    for _ in range(round(seconds / pot.matter.step_s)):
        still(world, calming)
        where = places(pot, world.state()[0])
        leaked += int(where.through.sum())
        # What lies piled up above the rim is not thrown: it falls back in, or over.
        world.remove((where.beyond & where.above) | where.through)
    heap_m = pot.cavity.rim_m[:, 2].max() + pot.spacing_m
    world.remove(world.state()[0][:, 2] > heap_m)
    return leaked


def still(world: World, calming: float = 0.0) -> None:
    """Advance a container that stands still."""
    world.step(DOWN, _STILL, _STILL, _STILL, calming)


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
