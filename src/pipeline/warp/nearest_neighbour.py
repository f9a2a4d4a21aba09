"""The paper's warp: part frames, scaling, nearest neighbours with agreeing normals; and its refinement."""

from dataclasses import replace

import numpy as np

from pipeline.geometry import frames
from pipeline.warp import splines
from pipeline.warp.alignment import PartFrame, part_frame, scale
from pipeline.warp.clouds import Cloud, subset, thinned
from pipeline.warp.deformation import Chain, Deformation, Kernels, PartStretch
from pipeline.warp.foreign import near_rim
from pipeline.warp.stretch import Stretch, between_extents, linear
from pipeline.warp.warp import Warp, label_pairs, point_pairs

NAME = "nearest_neighbour"
REFINEMENT_POINTS = 4000
BEND_CENTRES, BEND_STIFFNESS = 150, 1e-3


def fit(
    source: Cloud, target: Cloud, *, rng: np.random.Generator, refinements: int = 5, bends: int = 1
) -> Warp:
    """Align the source with the target by part frames and give its container the target's variances (the paper's).

    With refinements, which the paper does not have: along the first axis the container gets the target's extent
    instead, because equal variances leave the lips of a mug and a bowl apart, and the rim keeps its thickness; across,
    nearest points with agreeing normals, paired both ways, are brought together by a factor and an offset an axis. A
    target that the source fits as well at another size is the same thing at that size, and its rim is scaled, too.
    With bends, which the paper does not have either, a thin-plate spline then takes the pairs to each other: no factors
    make a bowl of a mug.
    """
    warp = coarse(source, target)
    if refinements:
        warp = _refine(warp, refinements)
    stretched = warp.deformation
    if bends and _misses_rim(warp):
        warp = replace(warp, deformation=Chain(stretched, _bend(warp, stretched, _with_rim(warp))))
    for _ in range(bends):
        warp = replace(warp, deformation=Chain(stretched, _bend(warp, stretched, pairs(warp))))
    return replace(warp, diagnostics={"refinements": float(refinements), "bends": float(bends)})


def _misses_rim(warp: Warp) -> bool:
    """Return whether most of the source's rim does not go to the target's: on a vase with a narrow opening, to its belly."""
    thin, from_rows, to_rows = pairs(warp)
    rim = thin.source.parts[from_rows, 1]
    met = near_rim(thin.target.points_m[to_rows[rim]], warp.ring)
    return bool(np.count_nonzero(met) < 0.5 * len(met) or not len(met))


def _with_rim(warp: Warp) -> tuple[Warp, np.ndarray, np.ndarray]:
    """Return `pairs` of which those of a rim's points are with the other's rim, where both have points."""
    thin, from_rows, to_rows = pairs(warp)
    is_rim, is_near = thin.source.parts[:, 1], near_rim(thin.target.points_m, warp.ring)
    if not is_rim.any() or not is_near.any():
        return thin, from_rows, to_rows
    others = ~(is_rim[from_rows] | is_near[to_rows])
    rims = replace(thin, source=subset(thin.source, is_rim), target=subset(thin.target, is_near))
    forth, back = point_pairs(rims, 1)[0][:, 0], label_pairs(rims, 1)[0][:, 0]
    met, home = np.flatnonzero(forth >= 0), np.flatnonzero(back >= 0)
    here, there = np.flatnonzero(is_rim), np.flatnonzero(is_near)
    from_rows = np.concatenate([from_rows[others], here[met], here[back[home]]])
    return thin, from_rows, np.concatenate([to_rows[others], there[forth[met]], there[home]])


def _refine(warp: Warp, refinements: int) -> Warp:
    source, target = warp.source, warp.target
    here, there = _extent(source, warp.source_frame), _extent(target, warp.target_frame)
    rim = source.points_m[source.parts[:, 1]]
    rim_m = here[1] - np.quantile(_in_part_frame(rim, warp.source_frame)[:, 0], 0.02)
    stretch = between_extents(here, there, rim_m, scale(warp.source_frame, warp.target_frame))
    for _ in range(refinements):
        stretch = _refined(_with(warp, stretch), stretch)
    refined = _with(warp, stretch)
    size = np.linalg.norm(warp.target_frame.spread_m) / np.linalg.norm(warp.source_frame.spread_m)
    same = _with(warp, linear(np.full(3, size)))
    return same if _between_planes_m(same) <= _between_planes_m(refined) else refined


def _between_planes_m(warp: Warp) -> float:
    """Return the mean distance of paired points along the target's normals: how far apart the surfaces are."""
    thin, from_rows, to_rows = pairs(warp)
    apart_m = thin.target.points_m[to_rows] - thin.aligned.points_m[from_rows]
    return float(np.mean(np.abs(np.einsum("nc,nc->n", apart_m, thin.target.normals[to_rows]))))


def coarse(source: Cloud, target: Cloud) -> Warp:
    """Return the paper's first stage: part frame onto part frame, the container scaled to the target's variances."""
    source_frame = part_frame(source)
    target_frame = part_frame(target)
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
    thin, from_rows, to_rows = pairs(warp)
    x = _in_part_frame(thin.source.points_m[from_rows], warp.source_frame)[:, 1:]
    y = _in_part_frame(thin.target.points_m[to_rows], warp.target_frame)[:, 1:]
    mean_x, mean_y = x.mean(axis=0), y.mean(axis=0)
    factors = ((x - mean_x) * (y - mean_y)).sum(axis=0) / ((x - mean_x) ** 2).sum(axis=0)
    return replace(stretch, scale=factors, offset_m=mean_y - factors * mean_x)


def _bend(warp: Warp, stretched: Deformation, found: tuple[Warp, np.ndarray, np.ndarray]) -> Kernels:
    """Return the spline that takes the stretched source to the target, by pairs that were found."""
    thin, from_rows, to_rows = found
    here_m = stretched.map(thin.source.points_m)
    step = max(1, len(here_m) // BEND_CENTRES)
    return splines.fit(here_m[from_rows], thin.target.points_m[to_rows], here_m[::step], BEND_STIFFNESS)


def pairs(warp: Warp, points: int = REFINEMENT_POINTS) -> tuple[Warp, np.ndarray, np.ndarray]:
    """Return the warp of clouds thinned to some points, and the rows of its source and target that pair, both ways."""
    thin = replace(warp, source=thinned(warp.source, points), target=thinned(warp.target, points))
    there, back = point_pairs(thin, 1)[0][:, 0], label_pairs(thin, 1)[0][:, 0]
    forth, home = np.flatnonzero((there >= 0) & thin.has_counterpart), np.flatnonzero(back >= 0)
    return thin, np.concatenate([forth, back[home]]), np.concatenate([there[forth], home])
