"""Containers of known geometry, ready for liquid at the default spacing."""

import numpy as np
import pytest
import trimesh
from sharing import made_once

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


def _once(factory: pytest.TempPathFactory, name: str, *shape) -> Vessel:
    """Return `revolved`, which takes seconds, as the first process that tests has made it."""
    return made_once(factory, name, lambda: revolved(name, *shape))


@pytest.fixture(scope="session")
def cylinder(tmp_path_factory) -> Vessel:
    """Inner radius 37 mm, inner depth 97 mm, wall 3 mm: the cup of the reference pour."""
    return _once(tmp_path_factory, "cylinder", [(0.0, 0.0), (0.037, 0.0), (0.037, 0.097)], 0.003, 0.040)


@pytest.fixture(scope="session")
def thin(tmp_path_factory) -> Vessel:
    """The same with a wall of 1.5 mm."""
    return _once(tmp_path_factory, "thin", [(0.0, 0.0), (0.037, 0.0), (0.037, 0.097)], 0.0015, 0.0385)


@pytest.fixture(scope="session")
def cone(tmp_path_factory) -> Vessel:
    """Inner radius from 25 mm to 45 mm over 80 mm."""
    return _once(tmp_path_factory, "cone", [(0.0, 0.0), (0.025, 0.0), (0.045, 0.080)], 0.003, 0.028)


@pytest.fixture(scope="session")
def bowl(tmp_path_factory) -> Vessel:
    """Half a sphere of radius 60 mm inside."""
    angle = np.linspace(0.0, np.pi / 2, 24)
    inner = [(0.06 * np.sin(a), 0.06 * (1 - np.cos(a))) for a in angle]
    return _once(tmp_path_factory, "bowl", inner, 0.003, 0.063)
