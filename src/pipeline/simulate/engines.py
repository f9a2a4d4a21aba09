"""What can simulate a trial's contents: the liquid, or Bullet's spheres, as gel balls or as a fluid.

A trial does not know which of them it asks.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.errors import PipelineError
from pipeline.geometry.cavity import Cavity
from pipeline.simulate import bullet, fluid, gel, liquid


@dataclass(frozen=True)
class Engine:
    """A way to simulate: `prepare` (cavity, vertices, triangles, spacing) makes the container that the others take.

    They answer as `liquid.pour` and `liquid.fill` do. A container has its `cavity` and the particles' `spacing_m`.
    """

    name: str
    prepare: Callable[[Cavity, np.ndarray, np.ndarray, float], Any]
    particles_for: Callable[[Any, float], int]
    pour: Callable[..., liquid.Pour]
    fill: Callable[..., liquid.Filling]


def _liquid(cavity: Cavity, _vertices: np.ndarray, _triangles: np.ndarray, spacing_m: float) -> liquid.Vessel:
    return liquid.vessel(cavity, spacing_m)


ENGINES = {
    "liquid": Engine("liquid", _liquid, liquid.particles_for, liquid.pour, liquid.fill),
    "bullet": Engine("bullet", gel.prepare, bullet.particles_for, bullet.pour, bullet.fill),
    "bullet_fluid": Engine("bullet_fluid", fluid.prepare, bullet.particles_for, bullet.pour, bullet.fill),
}


def engine(name: str) -> Engine:
    """Return an engine by its name; a `PipelineError` says which there are."""
    if name not in ENGINES:
        raise PipelineError(f"--engine {name}: expected one of {' '.join(ENGINES)}; correct simulate.engine")
    return ENGINES[name]
