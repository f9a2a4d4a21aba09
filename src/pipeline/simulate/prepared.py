"""A container made ready for trials, once: what every trial with it needs and what costs more than a trial to find out.

Its cavity, its shape for Bullet, and the liquid's view of it: walls, calibration, states at rest at every level.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any

import numpy as np

from pipeline.command import untold
from pipeline.geometry.cavity import (
    Cavity,
    Quadrature,
    cavity,
    quadrature,
    retained_volume_m3,
    under_rim_m3,
)
from pipeline.simulate import liquid
from pipeline.simulate.containers import decimated, wall_pieces
from pipeline.simulate.engines import ENGINES, Engine
from pipeline.simulate.fields import Walls

Arrays = dict[str, np.ndarray]
_TILTS_RAD = np.linspace(0.0, np.pi, 181)


@dataclass(frozen=True)
class Container:
    """A container ready for trials; object frame, metres.

    height_m: extent of the whole mesh along z. coarse: vertices (V, 3) and triangles (F, 3) for Bullet, of a container that
    stands; pieces: convex ones of its wall, of one that moves. vessel: how an engine sees it.
    """

    name: str
    height_m: float
    coarse: tuple[np.ndarray, np.ndarray]
    pieces: list[np.ndarray]
    vessel: Any
    engine: Engine
    _kept_m3: dict[bytes, np.ndarray] = field(default_factory=dict, repr=False, compare=False)

    @property
    def cavity(self) -> Cavity:
        """The room for liquid, object frame."""
        return self.vessel.cavity

    @property
    def depth_m(self) -> float:
        """The extent of the cavity along z."""
        return float(np.count_nonzero(self.cavity.interior.any(axis=(0, 1))) * self.cavity.cell_m)

    @property
    def particle_m3(self) -> float:
        """The volume of one particle."""
        return self.vessel.spacing_m**3

    @cached_property
    def _blocks(self) -> Quadrature:
        return quadrature(self.cavity)

    def under_rim_m3(self, axis: np.ndarray, tilt_rad: float) -> float:
        """Return the room below the rim's lowest point when tilted about `axis` (object frame): no less than what is kept."""
        return under_rim_m3(self.cavity, axis, tilt_rad, self._blocks)

    def kept_m3(self, lip_m: np.ndarray, axis: np.ndarray, tilt_rad: float) -> float:
        """Return what the cup keeps when tilted slowly about `axis` (object frame); a lip's curve is remembered, as lips recur."""
        key = lip_m.tobytes()
        if key not in self._kept_m3:
            self._kept_m3[key] = retained_volume_m3(self.cavity, lip_m, axis, _TILTS_RAD, self._blocks)
        return float(np.interp(tilt_rad, _TILTS_RAD, self._kept_m3[key]))


def container(
    name: str,
    vertices_m: np.ndarray,
    triangles: np.ndarray,
    spacing_m: float,
    engine: Engine = ENGINES["liquid"],
    tell: Callable[[str], None] = untold,
) -> Container:
    """Prepare a fused mesh (V, 3), (F, 3) for trials; a `PipelineError` names the object if it cannot hold liquid."""
    tell("its cavity")
    room = cavity(vertices_m, triangles, name=name)
    coarse = decimated(vertices_m, triangles)
    tell("its walls, and how much it holds before it overflows")
    vessel = engine.prepare(room, *coarse, spacing_m)
    tell("convex pieces of its wall")
    pieces = wall_pieces(vertices_m, triangles, room.opening_m)
    return Container(name, float(np.ptp(vertices_m[:, 2])), coarse, pieces, vessel, engine)


def to_arrays(ready: Container) -> Arrays:
    """Return all of a container for liquid as arrays, its states at rest with it."""
    vessel: liquid.Vessel = ready.vessel
    liquid.settle_all(vessel)
    keys = sorted(vessel.settled)
    return {
        "height_m": np.array(ready.height_m),
        **{"coarse_vertices_m": ready.coarse[0], "coarse_triangles": ready.coarse[1]},
        **{"spacing_m": np.array(vessel.spacing_m), "lowered": np.array(vessel.lowered)},
        **{f"cavity_{part.name}": np.asarray(getattr(ready.cavity, part.name)) for part in fields(Cavity)},
        **{f"walls_{name}": np.asarray(value) for name, value in vessel.walls._asdict().items()},
        "settled_keys": np.array(keys, dtype=np.int64),
        **_joined("settled", [vessel.settled[key].astype(np.float32) for key in keys]),
        **_joined("pieces", ready.pieces),
    }


def _joined(name: str, parts: list[np.ndarray]) -> Arrays:
    """Return arrays (n, 3) as one, and how long each is."""
    return {f"{name}_m": np.concatenate(parts), f"{name}_counts": np.array([len(part) for part in parts])}


def _parts(name: str, arrays: Mapping[str, np.ndarray]) -> list[np.ndarray]:
    return np.split(arrays[f"{name}_m"].astype(float), np.cumsum(arrays[f"{name}_counts"])[:-1])


def from_arrays(name: str, arrays: Mapping[str, np.ndarray], engine: Engine = ENGINES["liquid"]) -> Container:
    """Return the container that `to_arrays` told of; another engine than the liquid prepares its own view of it."""
    room = Cavity(**{part.name: _value(arrays[f"cavity_{part.name}"]) for part in fields(Cavity)})
    coarse = arrays["coarse_vertices_m"], arrays["coarse_triangles"]
    spacing_m = float(arrays["spacing_m"])
    vessel = _vessel(room, arrays) if engine.name == "liquid" else engine.prepare(room, *coarse, spacing_m)
    pieces = _parts("pieces", arrays)
    return Container(name, float(arrays["height_m"]), coarse, pieces, vessel, engine)


def _vessel(room: Cavity, arrays: Mapping[str, np.ndarray]) -> liquid.Vessel:
    walls = Walls(*(_scalar(arrays[f"walls_{name}"]) for name in Walls._fields))
    settled = dict(zip(arrays["settled_keys"].tolist(), _parts("settled", arrays), strict=True))
    return liquid.Vessel(room, float(arrays["spacing_m"]), float(arrays["lowered"]), walls, settled)


def _value(array: np.ndarray) -> Any:
    return array if array.ndim else array.item()


def _scalar(array: np.ndarray) -> Any:
    """Return a 0-dimensional array as the scalar of its own type that the compiled code was compiled for."""
    return array if array.ndim else array[()]
