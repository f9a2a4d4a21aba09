"""Coarse alignment by parts, and scaling by variances (section II-B, first stage)."""

from dataclasses import dataclass

import numpy as np

from pipeline.errors import PipelineError
from pipeline.geometry import frames
from pipeline.warp.clouds import Cloud
from pipeline.warp.ring import rim_rings
from pipeline.warp.roll import rim_low_m, roll

UPRIGHT_MAX_RAD = np.radians(30.0)


@dataclass(frozen=True)
class PartFrame:
    """An object's part frame: origin at the mean of the container, first axis to the rim, second to the handle.

    `T_object_part` is 4×4, metres. `spread_m` (3,) is the standard deviation of the container along its axes. How many second
    axes are equally right is `roll_symmetry`, 0 where all are; how many handles were seen, `handles`; how high the rim begins,
    object frame, `rim_low_m`.
    """

    T_object_part: np.ndarray
    spread_m: np.ndarray
    roll_symmetry: int
    handles: int
    rim_low_m: float

    @property
    def roll_observable(self) -> bool:
        """Whether the second axis is the only right one: errors of the roll mean something."""
        return self.roll_symmetry == 1


def part_frame(cloud: Cloud) -> PartFrame:
    """Return the part frame of an upright object.

    Raises PipelineError when no rim is found, or when the rim is not on top of the container.
    """
    container_m = cloud.points_m[cloud.parts[:, 0]]
    if len(container_m) < 100:
        raise PipelineError(
            f"{cloud.name}: expected a container, but only {len(container_m)} of its points look like one; look at the scan"
        )
    origin_m = container_m.mean(axis=0)
    ring_m = _rim_ring(cloud)
    first = _first_axis(ring_m.mean(axis=0) - origin_m, name=cloud.name)
    turned = roll(cloud, origin_m, ring_m)
    second = turned.axis - first * (turned.axis @ first)
    second = second / np.linalg.norm(second)
    rotation = np.column_stack([first, second, np.cross(first, second)])
    spread_m = ((container_m - origin_m) @ rotation).std(axis=0)
    T_object_part = frames.transform(rotation, origin_m)
    return PartFrame(T_object_part, spread_m, turned.symmetry, turned.handles, rim_low_m(ring_m))


def scale(source: PartFrame, target: PartFrame) -> np.ndarray:
    """Return the factors (3,) along the part axes that give the source's container the target's variances."""
    return target.spread_m / source.spread_m


def _first_axis(to_rim: np.ndarray, *, name: str) -> np.ndarray:
    """Return +z where the direction to the rim agrees: the table knows it better than the initial labels do."""
    tilt_rad = np.arccos(to_rim[2] / np.linalg.norm(to_rim))
    if tilt_rad > UPRIGHT_MAX_RAD:
        lies = "lying on its side" if tilt_rad < np.radians(135.0) else "upside down"
        lies = "leaning" if tilt_rad < np.radians(60.0) else lies
        raise PipelineError(
            f"{name}: expected an upright container, but it is {lies}: its rim lies {np.degrees(tilt_rad):.0f}° from the top; "
            "scan it standing on its base, or give `up` in its scan.yaml"
        )
    return np.array([0.0, 0.0, 1.0])


def _rim_ring(cloud: Cloud) -> np.ndarray:
    """Return the points (M, 3) of the ring that looks most like that of an opening."""
    rings = rim_rings(cloud)
    if not rings:
        raise PipelineError(
            f"{cloud.name}: expected a rim around an opening, but no ring of its points looks like one; "
            "see that the whole rim was scanned and nothing covers the opening, or put the object in objects.exclude"
        )
    return rings[0].points_m
