"""Vessels whose hydrostatics can be written down: a cylinder, a cone and a bowl, turned on a lathe, with walls as wanted."""

from dataclasses import dataclass

import numpy as np

from pipeline.geometry.cavity import Cavity, cavity

THIN_M = 0.0015
_SECTIONS = 128
_LEVELS = 2001


@dataclass(frozen=True)
class Reference:
    """A vessel of revolution: its inside (K, 2) as radius and height above its floor, from the axis out and up, metres."""

    name: str
    inner_m: np.ndarray
    wall_m: float

    def cavity(self) -> Cavity:
        """Return its cavity, found in its mesh as in any scan; the floor is at z = wall_m."""
        import trimesh

        inside = self.inner_m + [0.0, self.wall_m]
        foot_m = self.inner_m[self.inner_m[:, 1] <= 0.0, 0].max() + self.wall_m
        outside = [(0.0, 0.0), (foot_m, 0.0)] if foot_m > self.wall_m else self._shell()
        high = inside[-1] + [self.wall_m, 0.0]
        mesh = trimesh.creation.revolve(np.vstack([outside, high, inside[::-1]]), sections=_SECTIONS)
        return cavity(np.asarray(mesh.vertices), np.asarray(mesh.faces), name=self.name)

    def _shell(self) -> np.ndarray:
        """Return the outside (K - 1, 2) of a vessel that is round below: the inside, grown from its rim's centre."""
        centre = np.array([0.0, self.inner_m[-1, 1]])
        offset = self.inner_m[:-1] - centre
        grown = offset * (1.0 + self.wall_m / np.linalg.norm(offset, axis=1, keepdims=True))
        return grown + centre + [0.0, self.wall_m]

    def level_m(self, volume_m3: np.ndarray | float) -> np.ndarray:
        """Return the height above the floor to which volumes of any shape fill it, upright."""
        height = np.linspace(0.0, self.inner_m[-1, 1], _LEVELS)
        wall = self.inner_m[np.searchsorted(self.inner_m[:, 1], 0.0, side="right") - 1 :]
        area = np.pi * np.interp(height, wall[:, 1], wall[:, 0]) ** 2
        volume = np.concatenate([[0.0], np.cumsum((area[1:] + area[:-1]) / 2 * np.diff(height))])
        return np.asarray(np.interp(volume_m3, volume, height))

    def radius_m(self, level_m: np.ndarray | float) -> np.ndarray:
        """Return the inner radius at heights above the floor."""
        wall = self.inner_m[np.searchsorted(self.inner_m[:, 1], 0.0, side="right") - 1 :]
        return np.asarray(np.interp(level_m, wall[:, 1], wall[:, 0]))


def references(wall_m: float = 0.003) -> list[Reference]:
    """Return a cylinder (37 × 97 mm inside), a cone (25 to 45 mm over 80 mm) and a bowl (half a sphere of 60 mm)."""
    turn = np.linspace(0.0, np.pi / 2, 48)
    insides = {
        "cylinder": np.array([(0.0, 0.0), (0.037, 0.0), (0.037, 0.097)]),
        "cone": np.array([(0.0, 0.0), (0.025, 0.0), (0.045, 0.080)]),
        "bowl": 0.060 * np.column_stack([np.sin(turn), 1.0 - np.cos(turn)]),
    }
    return [Reference(name, inside, wall_m) for name, inside in insides.items()]
