"""SPH forces on Bullet's spheres: pressure and viscosity of a weakly compressible fluid. Frame: the container's.

Density by the cubic spline and, near the wall, by the wall's share of it (`fields`); pressure linear in what the density
exceeds 1 (Müller et al. 2003), its force symmetric (Monaghan 1992, Eq. 3.3) and, at the wall, the gradient of the same
energy; viscosity as Monaghan's Eq. 4.1 without its switch, so that it acts in shear as well. What keeps the spheres
inside is Bullet's contact with the scanned mesh.
"""

from typing import NamedTuple

import numpy as np

from pipeline.simulate.compiled import compiled
from pipeline.simulate.fields import SUPPORT, Walls
from pipeline.simulate.lookup import wall_reach

SOUND_M_S = 4.0  # four times what moves in a cup; 100 mm of depth compress by 6 %
VISCOSITY = 0.1  # Monaghan's alpha; ours, by the reference pour of benchmarks/bullet.py
OPEN_SIDE, IN_THE_AIR = (
    0.2,
    0.75,
)  # gradient (1/spacing) and density that tell the free surface, as for the liquid


class Response(NamedTuple):
    """Of n spheres: acceleration (n, 3) in m/s², density (n,) as a share of the fluid's, inside (n,): no free surface near."""

    acceleration: np.ndarray
    density: np.ndarray
    inside: np.ndarray


def response(walls: Walls, x: np.ndarray, v: np.ndarray) -> Response:
    """Return what the fluid answers to spheres at x (n, 3) with velocities v (n, 3), each of volume spacing³."""
    acceleration, slope, density = np.zeros_like(x), np.zeros_like(x), np.zeros(len(x))
    _respond(
        np.ascontiguousarray(x), np.ascontiguousarray(v), float(walls.spacing),
        walls.reach, walls.shape, walls.origin, walls.cell, acceleration, slope, density,
    )  # fmt: skip
    steep = np.sqrt((slope**2).sum(axis=1)) * float(walls.spacing)
    return Response(acceleration, density, (steep < OPEN_SIDE) & (density > IN_THE_AIR))


@compiled
def _respond(x, v, s, reach, shape, origin, cell, acceleration, slope, density):
    """Fill `acceleration` (n, 3), the density's gradient `slope` (n, 3) and `density` (n,)."""
    n, h = len(x), SUPPORT * s
    norm = 8.0 / np.pi * (s / h) ** 3
    push = np.zeros(n)  # pressure / density²
    for i in range(n):
        px, py, pz = np.float32(x[i, 0]), np.float32(x[i, 1]), np.float32(x[i, 2])
        share, slope[i, 0], slope[i, 1], slope[i, 2] = wall_reach(reach, shape, origin, cell, px, py, pz)
        density[i] = norm + share
    for i in range(n):
        for j in range(i + 1, n):
            dx, dy, dz = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1], x[i, 2] - x[j, 2]
            squared = dx * dx + dy * dy + dz * dz
            if squared < h * h:
                q = np.sqrt(squared) / h
                away, inner = 1.0 - q, max(0.5 - q, 0.0)
                w = norm * (2.0 * away**3 - 8.0 * inner**3)
                density[i] += w
                density[j] += w
    for i in range(n):
        push[i] = SOUND_M_S**2 * max(density[i] - 1.0, 0.0) / density[i] ** 2
        for c in range(3):
            acceleration[i, c] = -push[i] * slope[i, c]
    for i in range(n):
        for j in range(i + 1, n):
            dx, dy, dz = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1], x[i, 2] - x[j, 2]
            squared = dx * dx + dy * dy + dz * dz
            if squared < h * h:
                r = np.sqrt(squared) + 1e-12
                away, inner = 1.0 - r / h, max(0.5 - r / h, 0.0)
                steep = norm / h * (24.0 * inner * inner - 6.0 * away * away) / r
                parting = (v[i, 0] - v[j, 0]) * dx + (v[i, 1] - v[j, 1]) * dy + (v[i, 2] - v[j, 2]) * dz
                drag = VISCOSITY * SOUND_M_S * s * parting / (squared + 0.01 * s * s)
                f = (push[i] + push[j] - 2.0 * drag / (density[i] + density[j])) * steep
                for c, d in ((0, dx), (1, dy), (2, dz)):
                    acceleration[i, c] -= f * d
                    acceleration[j, c] += f * d
                    slope[i, c] += steep * d
                    slope[j, c] -= steep * d
