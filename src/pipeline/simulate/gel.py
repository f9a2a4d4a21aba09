"""Gel balls: rigid spheres with friction, as on the paper's robot.

There are as many balls as the liquid has particles, and their radius is such that the container, filled with them, is as full as
with liquid: a ball and the gaps about it are one particle's volume.
"""

from dataclasses import replace

import numpy as np

from pipeline.geometry.cavity import Cavity, room_m3
from pipeline.simulate.containers import decimated
from pipeline.simulate.fields import precompute
from pipeline.simulate.packing import settled
from pipeline.simulate.spheres import Matter, Pot

FRICTION = 0.1  # swollen hydrogel is slippery; ours
RESTITUTION = 0.2  # ours
PACKING = 0.58  # of equal spheres poured into a small cup; where the calibration starts
TOLERANCE = 0.02
GEL = Matter(
    step_s=1.0 / 240.0, friction=FRICTION, restitution=RESTITUTION, collide=True
)  # Bullet's own step
_CALIBRATIONS = 3
_CALIBRATED_AT = 0.7  # of the capacity
_SHARE_OF_TOP_LAYER = 0.6


def prepare(
    cavity: Cavity, vertices_m: np.ndarray, triangles: np.ndarray, spacing_m: float, matter: Matter = GEL
) -> Pot:
    """Return a container for balls that stand for spacing_m³ each, their radius calibrated by the level of a fill."""
    radius_m = spacing_m * (PACKING * 3.0 / (4.0 * np.pi)) ** (1.0 / 3.0)
    walls = precompute(cavity, spacing_m, 0.0).walls
    pot = Pot(cavity, spacing_m, radius_m, *decimated(vertices_m, triangles), walls, matter)
    n = max(8, round(_CALIBRATED_AT * cavity.capacity_m3 / spacing_m**3))
    for _ in range(_CALIBRATIONS):
        filled_m3 = bulk_m3(pot, settled(pot, n)[0])
        wanted_m3 = n * spacing_m**3
        if abs(filled_m3 - wanted_m3) <= TOLERANCE * wanted_m3:
            break
        radius_m *= float(np.clip(wanted_m3 / filled_m3, 0.7, 1.4)) ** (1.0 / 3.0)
        pot = replace(pot, radius_m=radius_m, settled={})
    return pot


def alike(pot: Pot, cavity: Cavity, vertices_m: np.ndarray, triangles: np.ndarray) -> Pot:
    """Return another container for the balls of a pot: prepared for Bullet, vertices (V, 3), triangles (F, 3)."""
    walls = precompute(cavity, pot.spacing_m, 0.0).walls
    return Pot(cavity, pot.spacing_m, pot.radius_m, *decimated(vertices_m, triangles), walls, pot.matter)


def bulk_m3(pot: Pot, x: np.ndarray) -> float:
    """Return the room below the mean top of the uppermost spheres of x (n, 3) at rest."""
    cup, room = pot.cavity, room_m3(pot.cavity)
    below_m3 = room.sum(axis=(0, 1)).cumsum()
    tops = cup.origin_m[2] + cup.cell_m * (np.arange(len(below_m3)) + 0.5)
    area_m2 = np.gradient(below_m3, cup.cell_m)
    height = np.sort(x[:, 2])[::-1]
    surface_m2 = float(np.interp(height[0], tops, area_m2))
    layer = max(1, min(len(x), round(_SHARE_OF_TOP_LAYER * surface_m2 / (2.0 * pot.radius_m) ** 2)))
    return float(np.interp(height[:layer].mean() + pot.radius_m, tops, below_m3))
