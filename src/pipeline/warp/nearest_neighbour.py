"""The paper's warp: part frames, scaling, nearest neighbours with agreeing normals; and its refinement."""

from dataclasses import replace

import numpy as np

from pipeline.geometry import frames
from pipeline.warp.alignment import PartFrame, part_frame, scale
from pipeline.warp.clouds import Cloud, thinned
from pipeline.warp.deformation import PartStretch
from pipeline.warp.stretch import Stretch, between_extents, linear
from pipeline.warp.warp import Warp, label_pairs, point_pairs

NAME = "nearest_neighbour"
REFINEMENT_POINTS = 4000


def fit(source: Cloud, target: Cloud, *, rng: np.random.Generator, refinements: int = 5) -> Warp:
    """Align the source with the target by part frames and give its container the target's variances (the paper's).

    With refinements, which the paper does not have: along the first axis the container gets the target's extent
    instead, because equal variances leave the lips of a mug and a bowl apart, and the rim keeps its thickness; across,
    nearest points with agreeing normals, paired both ways, are brought together by a factor and an offset an axis.
    """
    warp = coarse(source, target)
    if not refinements:
        return warp
    here, there = _extent(source, warp.source_frame), _extent(target, warp.target_frame)
    rim = source.points_m[source.parts[:, 1]]
    rim_m = here[1] - np.quantile(_in_part_frame(rim, warp.source_frame)[:, 0], 0.02)
    stretch = between_extents(here, there, rim_m, scale(warp.source_frame, warp.target_frame))
    for _ in range(refinements):
        stretch = _refined(_with(warp, stretch), stretch)
    return replace(_with(warp, stretch), diagnostics={"refinements": float(refinements)})


def coarse(source: Cloud, target: Cloud) -> Warp:
    """Return the paper's first stage: part frame onto part frame, the container scaled to the target's variances."""
    source_frame = part_frame(source.points_m, source.parts, name=source.name)
    target_frame = part_frame(target.points_m, target.parts, name=target.name)
    stretch = linear(scale(source_frame, target_frame))
    deformation = PartStretch(source_frame.T_object_part, target_frame.T_object_part, stretch)
    return Warp(NAME, source, target, source_frame, target_frame, deformation)


def _with(warp: Warp, stretch: Stretch) -> Warp:
    frames_ = warp.source_frame.T_object_part, warp.target_frame.T_object_part
    return replace(warp, deformation=PartStretch(*frames_, stretch))


def _in_part_frame(points_m: np.ndarray, frame: PartFrame) -> np.ndarray:
    return frames.apply(frames.inverse(frame.T_object_part), points_m)


def _extent(cloud: Cloud, frame: PartFrame) -> np.ndarray:
    """Return where the container begins and ends along the first axis (2,), but for one point in a thousand."""
    return np.quantile(_in_part_frame(cloud.points_m[cloud.parts[:, 0]], frame)[:, 0], [0.001, 0.999])


def _refined(warp: Warp, stretch: Stretch) -> Stretch:
    """Return the stretch with the factors and offsets across the first axis that fit the warp's present pairs best."""
    thin = replace(
        warp, source=thinned(warp.source, REFINEMENT_POINTS), target=thinned(warp.target, REFINEMENT_POINTS)
    )
    there, back = point_pairs(thin, 1)[0][:, 0], label_pairs(thin, 1)[0][:, 0]
    # A handle has no counterpart on a target without one.
    usable = ~thin.source.parts[:, 2] | warp.target_frame.roll_observable
    forth, home = np.flatnonzero((there >= 0) & usable), np.flatnonzero((back >= 0) & usable[back])
    x = _in_part_frame(thin.source.points_m, warp.source_frame)[:, 1:]
    y = _in_part_frame(thin.target.points_m, warp.target_frame)[:, 1:]
    x, y = np.vstack([x[forth], x[back[home]]]), np.vstack([y[there[forth]], y[home]])
    mean_x, mean_y = x.mean(axis=0), y.mean(axis=0)
    factors = ((x - mean_x) * (y - mean_y)).sum(axis=0) / ((x - mean_x) ** 2).sum(axis=0)
    return replace(stretch, scale=factors, offset_m=mean_y - factors * mean_x)
