"""Warp a source object to a target: align, scale, map (section II-B and II-C)."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pipeline.geometry import frames
from pipeline.warp.alignment import PartFrame, part_frame, scale
from pipeline.warp.nearest import agreeing_neighbours, majority_of_neighbours, mean_of_neighbours
from pipeline.warp.stretch import Stretch, between_extents, linear

REFINEMENT_POINTS = 4000
WALL_COSINE = (
    0.8  # a point is on a wall, not on a lip or floor, where its normal is this near to the horizontal
)


@dataclass(frozen=True)
class Cloud:
    """An object's points (N, 3) in metres, unit normals (N, 3), area of each (N,) and parts (N, 3 bool), upright."""

    name: str
    points_m: np.ndarray
    normals: np.ndarray
    area_m2: np.ndarray
    parts: np.ndarray


@dataclass(frozen=True)
class Mapped:
    """A warped cloud O_w in the target's object frame, with the rows of source and target that it joins."""

    cloud: Cloud
    source_index: np.ndarray
    target_index: np.ndarray
    valid: np.ndarray
    distance_m: np.ndarray


@dataclass(frozen=True)
class Warp:
    """An alignment of a source with a target: part frames, and the stretch between them."""

    source_frame: PartFrame
    target_frame: PartFrame
    stretch: Stretch
    source: Cloud
    target: Cloud

    @cached_property
    def aligned(self) -> Cloud:
        """The source, stretched, in the target's object frame."""
        T_part_object = frames.inverse(self.source_frame.T_object_part)
        part_m = frames.apply(T_part_object, self.source.points_m)
        factors = self.stretch.factors(part_m)
        # Normals follow the inverse transpose of the Jacobian, areas its cofactor.
        stretched = frames.rotate(T_part_object, self.source.normals) / factors
        length = np.linalg.norm(stretched, axis=1)
        return replace(
            self.source,
            points_m=frames.apply(self.target_frame.T_object_part, self.stretch.map(part_m)),
            normals=frames.rotate(self.target_frame.T_object_part, stretched / length[:, None]),
            area_m2=self.source.area_m2 * factors.prod(axis=1) * length,
        )


def fit(source: Cloud, target: Cloud, refinements: int) -> Warp:
    """Align the source with the target by part frames and give its container the target's variances (the paper's).

    With refinements, which the paper does not have: along the first axis the container gets the target's extent
    instead, because equal variances leave the lips of a mug and a bowl apart, and the rim keeps its thickness; across,
    nearest points with agreeing normals, paired both ways, are brought together by a factor and an offset an axis.
    """
    source_frame = part_frame(source.points_m, source.parts, name=source.name)
    target_frame = part_frame(target.points_m, target.parts, name=target.name)
    stretch = linear(scale(source_frame, target_frame))
    if refinements:
        here, there = _extent(source, source_frame), _extent(target, target_frame)
        rim = source.points_m[source.parts[:, 1]]
        rim_m = here[1] - np.quantile(_in_part_frame(rim, source_frame)[:, 0], 0.02)
        stretch = between_extents(here, there, rim_m, scale(source_frame, target_frame))
    warp = Warp(source_frame, target_frame, stretch, source, target)
    for _ in range(refinements):
        warp = _refined(warp)
    return warp


def _in_part_frame(points_m: np.ndarray, frame: PartFrame) -> np.ndarray:
    return frames.apply(frames.inverse(frame.T_object_part), points_m)


def _extent(cloud: Cloud, frame: PartFrame) -> np.ndarray:
    """Return where the container begins and ends along the first axis (2,), but for one point in a thousand."""
    return np.quantile(_in_part_frame(cloud.points_m[cloud.parts[:, 0]], frame)[:, 0], [0.001, 0.999])


def _refined(warp: Warp) -> Warp:
    """Return the warp with the factors and offsets across the first axis that fit its present pairs best."""
    some_source, some_target = (_thinned(cloud) for cloud in (warp.source, warp.target))
    thin = replace(warp, source=some_source, target=some_target)
    there, back = point_pairs(thin, 1)[0][:, 0], label_pairs(thin, 1)[0][:, 0]
    # A handle has no counterpart on a target without one.
    usable = ~some_source.parts[:, 2] | warp.target_frame.roll_observable
    forth, home = np.flatnonzero((there >= 0) & usable), np.flatnonzero((back >= 0) & usable[back])
    x = _in_part_frame(some_source.points_m, warp.source_frame)[:, 1:]
    y = _in_part_frame(some_target.points_m, warp.target_frame)[:, 1:]
    x, y = np.vstack([x[forth], x[back[home]]]), np.vstack([y[there[forth]], y[home]])
    mean_x, mean_y = x.mean(axis=0), y.mean(axis=0)
    factors = ((x - mean_x) * (y - mean_y)).sum(axis=0) / ((x - mean_x) ** 2).sum(axis=0)
    return replace(warp, stretch=replace(warp.stretch, scale=factors, offset_m=mean_y - factors * mean_x))


def _thinned(cloud: Cloud) -> Cloud:
    step = max(1, len(cloud.points_m) // REFINEMENT_POINTS)
    arrays = ("points_m", "normals", "area_m2", "parts")
    return replace(cloud, **{name: getattr(cloud, name)[::step] for name in arrays})


def point_pairs(warp: Warp, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Return for each source point the k nearest target points with an agreeing normal: rows (N, k), distances (N, k)."""
    aligned, target = warp.aligned, warp.target
    return agreeing_neighbours(aligned.points_m, aligned.normals, target.points_m, target.normals, k)


def label_pairs(warp: Warp, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Return for each target point the k nearest source points with an agreeing normal: rows (M, k), distances (M, k)."""
    aligned, target = warp.aligned, warp.target
    return agreeing_neighbours(target.points_m, target.normals, aligned.points_m, aligned.normals, k)


def point_mapping(warp: Warp, k: int) -> Mapped:
    """Map each source point to the mean of its k nearest target points with an agreeing normal; labels stay."""
    target, aligned = warp.target, warp.aligned
    index, distance = point_pairs(warp, k)
    normals = mean_of_neighbours(target.normals, index)
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    points_m = mean_of_neighbours(target.points_m, index)
    cloud = Cloud(target.name, points_m, normals, aligned.area_m2, aligned.parts)
    return Mapped(cloud, np.arange(len(points_m)), index[:, 0], index[:, 0] >= 0, distance[:, 0])


def label_mapping(warp: Warp, k: int) -> Mapped:
    """Give each target point the labels that most of its k nearest source points with an agreeing normal have."""
    index, distance = label_pairs(warp, k)
    parts = majority_of_neighbours(warp.aligned.parts, index)
    cloud = replace(warp.target, parts=parts)
    return Mapped(cloud, index[:, 0], np.arange(len(parts)), index[:, 0] >= 0, distance[:, 0])


def wall_side_flips(warp: Warp, mapped: Mapped) -> float:
    """Return the share of pairs on the wall whose points face opposite ways from the axis of the container."""
    rows = np.flatnonzero(mapped.valid)
    here = _facing_outward(warp.aligned, warp.target_frame)[mapped.source_index[rows]]
    there = _facing_outward(warp.target, warp.target_frame)[mapped.target_index[rows]]
    on_wall = (np.abs(here) > WALL_COSINE) & (np.abs(there) > WALL_COSINE)
    return float(np.mean(here[on_wall] * there[on_wall] < 0.0)) if on_wall.any() else 0.0


def _facing_outward(cloud: Cloud, frame: PartFrame) -> np.ndarray:
    radial = cloud.points_m[:, :2] - frame.T_object_part[:2, 3]
    radial = radial / np.maximum(np.linalg.norm(radial, axis=1, keepdims=True), 1e-9)
    return np.einsum("nc,nc->n", radial, cloud.normals[:, :2])
