"""Where spheres are, seen from their container: still in it, out over its rim, or through its wall."""

from typing import NamedTuple

import numpy as np

from pipeline.simulate.compiled import compiled
from pipeline.simulate.lookup import rim_at, wall_distance
from pipeline.simulate.spheres import Pot

_BELOW_EDGE = 0.5  # radii below the rim at which a sphere may pass over it: it has a step's time to fall
_IN_WALL = 0.25  # a sphere with its centre this many radii beyond the inner surface is no longer inside
_THROWN = 3.0  # spacings above the rim's highest point: nothing comes back from there


class Places(NamedTuple):
    """Of n spheres, (n,) of bool. beyond: further out than the rim's contour; above: high enough to pass over the rim there;
    under: lower than it; thrown: far above; through: too low to pass over it, and beyond the inner surface.
    """

    beyond: np.ndarray
    above: np.ndarray
    under: np.ndarray
    thrown: np.ndarray
    through: np.ndarray

    @property
    def over(self) -> np.ndarray:
        """Those that have left over the rim; looked at after each step, for outside they fall."""
        return (self.beyond & self.above) | self.thrown


def places(pot: Pot, x: np.ndarray) -> Places:
    """Return where spheres at x (n, 3), the container's frame, are."""
    w = pot.walls
    distance, height, radius, out = (np.zeros(len(x), np.float32) for _ in range(4))
    _look_up(
        x.astype(np.float32), w.distance, w.shape, w.origin, w.cell, w.rim_radius, w.rim_height, w.opening,
        distance, height, radius, out,
    )  # fmt: skip
    z, r = x[:, 2], pot.radius_m
    above = z >= height - float(w.lowered) - _BELOW_EDGE * r
    return Places(
        out > radius,
        above,
        z < height,
        z > pot.cavity.rim_m[:, 2].max() + _THROWN * pot.spacing_m,
        ~above & (distance < -_IN_WALL * r),
    )


@compiled
def _look_up(x, wall, shape, origin, cell, radii, heights, opening, distance, height, radius, out):
    """Fill the distance to the wall, the rim's height and radius in a sphere's direction, and how far out it is (n,)."""
    for i in range(len(x)):
        distance[i] = wall_distance(wall, shape, origin, cell, x[i, 0], x[i, 1], x[i, 2])[0]
        radius[i], height[i], out[i] = rim_at(radii, heights, opening, x[i, 0], x[i, 1])
