"""The clouds that a warp joins."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

ARRAYS = ("points_m", "normals", "area_m2", "parts")


@dataclass(frozen=True)
class Cloud:
    """An object's points (N, 3) in metres, unit normals (N, 3), area of each (N,) and parts (N, 3 bool), upright.

    The parts are container, rim and handle.
    """

    name: str
    points_m: np.ndarray
    normals: np.ndarray
    area_m2: np.ndarray
    parts: np.ndarray

    @cached_property
    def link_m(self) -> float:
        """Over what distance points are linked to one piece: twice that to a sixth neighbour."""
        return 2.0 * float(np.median(cKDTree(self.points_m).query(self.points_m, k=[7])[0]))


@dataclass(frozen=True)
class Mapped:
    """A warped cloud O_w in the target's object frame, with the rows of source and target that it joins.

    `distance_m` (N,) is that between the two before they were joined, inf where `valid` is not.
    """

    cloud: Cloud
    source_index: np.ndarray
    target_index: np.ndarray
    valid: np.ndarray
    distance_m: np.ndarray


def subset(cloud: Cloud, rows: np.ndarray | slice) -> Cloud:
    """Return the cloud of some rows."""
    return replace(cloud, **{name: getattr(cloud, name)[rows] for name in ARRAYS})


def thinned(cloud: Cloud, points: int) -> Cloud:
    """Return every so-manieth point, so that at least `points` are left where there are as many."""
    return subset(cloud, slice(None, None, max(1, len(cloud.points_m) // points)))


def drawn(cloud: Cloud, points: int, rng: np.random.Generator) -> Cloud:
    """Return `points` points at random, in their order; all, where there are no more."""
    count = min(points, len(cloud.points_m))
    return subset(cloud, np.sort(rng.choice(len(cloud.points_m), count, replace=False)))
