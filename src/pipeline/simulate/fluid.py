"""Bullet's fluid mode: spheres that touch the container alone, without friction, moved by SPH forces between them.

A sphere is half a spacing in radius, so that its centre keeps from the wall what it keeps from a free surface. One that
flows over the rim stands a whole layer higher than liquid would; so Bullet's wall ends below the scanned rim, by as much
as the liquid's before its calibration (`walls`).
"""

from functools import partial

import numpy as np

from pipeline.geometry.cavity import Cavity
from pipeline.simulate.containers import decimated
from pipeline.simulate.fields import precompute
from pipeline.simulate.forces import response
from pipeline.simulate.spheres import Matter, Pot

STEP_PER_SPACING = 0.3  # s/m: 3 ms at 10 mm; at 6 ms the fluid no longer comes to rest
RADIUS = 0.5  # spacings
# Spacings. Chosen for each container by overflow, down to 0.45 in small cups, it would keep them brimful, and hold back at the lip.
LOWERED = 0.75
CALMING = 5.0  # 1/s
_LEAST_M2 = 1e-12


def prepare(
    cavity: Cavity, vertices_m: np.ndarray, triangles: np.ndarray, spacing_m: float, by: float = LOWERED
) -> Pot:
    """Return a container for fluid of which a sphere is spacing_m³, its wall ending `by` spacings below the rim."""
    walls = precompute(cavity, spacing_m, by).walls
    matter = Matter(
        step_s=STEP_PER_SPACING * spacing_m,
        friction=0.0,
        restitution=0.0,
        collide=False,
        calming=CALMING,
        response=partial(response, walls),
    )
    mesh = decimated(*lowered(cavity, vertices_m, triangles, by * spacing_m))
    return Pot(cavity, spacing_m, RADIUS * spacing_m, *mesh, walls, matter)


def lowered(
    cavity: Cavity, vertices_m: np.ndarray, triangles: np.ndarray, by_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return a mesh of which all that is higher than `by_m` below the rim is pressed flat to there."""
    edge_m = cavity.rim_at(vertices_m[:, 0], vertices_m[:, 1])[1] - by_m
    pressed = np.column_stack([vertices_m[:, :2], np.minimum(vertices_m[:, 2], edge_m)])
    a, b, c = (pressed[triangles[:, corner]] for corner in range(3))
    has_area = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 2.0 * _LEAST_M2
    return pressed, triangles[has_area]
