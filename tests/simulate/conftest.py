"""Containers of known geometry, ready for liquid at the default spacing."""

import numpy as np
import pytest
import trimesh

from pipeline.geometry.cavity import cavity
from pipeline.simulate.liquid import Vessel, vessel

SPACING_M = 0.010


def revolved(name: str, inner_m: list[tuple[float, float]], wall_m: float, foot_m: float) -> Vessel:
    """Return a vessel of revolution: the inside's profile (r, z) above its floor, from the axis out and up, a straight
    outside from a foot of radius `foot_m` to the rim.
    """
    inside = [(r, z + wall_m) for r, z in inner_m]
    r_high, z_high = inside[-1]
    profile = [(0.0, 0.0), (foot_m, 0.0), (r_high + wall_m, z_high), *reversed(inside)]
    mesh = trimesh.creation.revolve(np.array(profile), sections=96)
    return vessel(cavity(np.asarray(mesh.vertices), np.asarray(mesh.faces), name=name), SPACING_M)


@pytest.fixture(scope="session")
def cylinder() -> Vessel:
    """Inner radius 37 mm, inner depth 97 mm, wall 3 mm: the cup of the reference pour."""
    return revolved("cylinder", [(0.0, 0.0), (0.037, 0.0), (0.037, 0.097)], 0.003, 0.040)


@pytest.fixture(scope="session")
def thin() -> Vessel:
    """The same with a wall of 1.5 mm."""
    return revolved("thin", [(0.0, 0.0), (0.037, 0.0), (0.037, 0.097)], 0.0015, 0.0385)


@pytest.fixture(scope="session")
def cone() -> Vessel:
    """Inner radius from 25 mm to 45 mm over 80 mm."""
    return revolved("cone", [(0.0, 0.0), (0.025, 0.0), (0.045, 0.080)], 0.003, 0.028)


@pytest.fixture(scope="session")
def bowl() -> Vessel:
    """Half a sphere of radius 60 mm inside."""
    angle = np.linspace(0.0, np.pi / 2, 24)
    inner = [(0.06 * np.sin(a), 0.06 * (1 - np.cos(a))) for a in angle]
    return revolved("bowl", inner, 0.003, 0.063)
