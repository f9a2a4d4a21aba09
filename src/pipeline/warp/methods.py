"""The methods of warping by name: `fit(source, target, *, rng, …) -> Warp`, one module each."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.warp import cpd, nearest_neighbour, rigid, shape_space, tps_rpm
from pipeline.warp.clouds import Cloud, subset
from pipeline.warp.foreign import foreign
from pipeline.warp.warp import Warp

METHODS: dict[str, Callable[..., Warp]] = {
    "nearest_neighbour": nearest_neighbour.fit,
    "rigid": rigid.fit,
    "cpd": cpd.fit,
    "tps_rpm": tps_rpm.fit,
    "shape_space": shape_space.fit,
}


def fit(method: str, source: Cloud, target: Cloud, *, rng: np.random.Generator, **own: Any) -> Warp:
    """Return the warp by a method and its own options, fitted to what of the target is not `foreign` to the source."""
    known = ~foreign(target, source)
    seen = target if known.all() else subset(target, np.flatnonzero(known))
    return replace(METHODS[method](source, seen, rng=rng, **own), target=target)
