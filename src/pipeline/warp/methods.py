"""The methods of warping by name: `fit(source, target, *, rng, …) -> Warp`, one module each."""

from collections.abc import Callable

from pipeline.warp import cpd, nearest_neighbour, rigid, shape_space, tps_rpm
from pipeline.warp.warp import Warp

METHODS: dict[str, Callable[..., Warp]] = {
    "nearest_neighbour": nearest_neighbour.fit,
    "rigid": rigid.fit,
    "cpd": cpd.fit,
    "tps_rpm": tps_rpm.fit,
    "shape_space": shape_space.fit,
}
