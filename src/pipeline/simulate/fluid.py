"""Bullet's fluid mode: spheres that touch the container alone, without friction, moved by SPH forces between them.

A sphere is half a spacing in radius, so that its centre keeps from the wall what it keeps from a free surface. One that
flows over the rim stands a whole layer higher than liquid would; so Bullet's wall ends below the scanned rim. By how
much is chosen for each container, as for the liquid (`walls`): what a container keeps that is filled beyond its brim is
its capacity, as near as layers allow.
"""

from functools import partial

import numpy as np

from pipeline.geometry.cavity import Cavity
from pipeline.simulate.containers import decimated
from pipeline.simulate.fields import precompute
from pipeline.simulate.forces import response
from pipeline.simulate.packing import settled
from pipeline.simulate.spheres import Matter, Pot

STEP_PER_SPACING = 0.3  # s/m: 3 ms at 10 mm; at 6 ms the fluid no longer comes to rest
RADIUS = 0.5  # spacings
LOWERED = 0.75  # spacings; where the calibration starts
TOLERANCE = 0.01  # of the capacity
CALMING = 5.0  # 1/s
_OVERFILL = 1.1
_RANGE = (0.25, 1.0)
_TRIALS = 3
_LEAST_M2 = 1e-12


def prepare(cavity: Cavity, vertices_m: np.ndarray, triangles: np.ndarray, spacing_m: float) -> Pot:
    """Return a container for fluid of which a sphere is spacing_m³, calibrated by overflow."""
    area_m2 = np.pi * np.hypot(*(cavity.rim_m - cavity.opening_m)[:, :2].T).mean() ** 2
    target = round(cavity.capacity_m3 / spacing_m**3)
    tried: list[tuple[int, Pot]] = []
    by = LOWERED
    for _ in range(_TRIALS):
        candidate = pot(cavity, vertices_m, triangles, spacing_m, by)
        excess = len(settled(candidate, round(_OVERFILL * target))[0]) - target
        tried.append((abs(excess), candidate))
        if abs(excess) <= TOLERANCE * target:
            break
        by = float(np.clip(by + excess * spacing_m**2 / area_m2, *_RANGE))
    return min(tried, key=lambda pair: pair[0])[1]


def pot(cavity: Cavity, vertices_m: np.ndarray, triangles: np.ndarray, spacing_m: float, by: float) -> Pot:
    """Return a container whose wall ends `by` spacings below the rim."""
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
