"""The rim of a container: where its inner wall ends, all round the opening. Object frame, upright, metres."""

import numpy as np

from pipeline.errors import PipelineError
from pipeline.geometry.surface import Surface

AZIMUTHS = 256
_RIM_STEP_M = 0.0001
_RIM_GAP_M = 0.004  # a hole in the scan below the rim's edge may be this high
# What stands so far above the median of a quarter turn around it is a handle that bridges the opening, as a bucket's.
_BRIDGE_M = 0.015
_NOWHERE_M = 10.0  # as far as a ray that hits nothing is said to go
_MOST_SLIT = 0.1  # of the azimuths
# Of the opening's width: what stands in its middle and is narrower is no part of it, but a spoon.
_LEAST_TUBE = 0.14
_MOST_OUTSIDE = 0.05  # of a pool may be outside of its rim


def rim_and_opening(
    surface: Surface,
    axes: list[np.ndarray],
    pool: np.ndarray,
    level: int,
    top_m: float,
    cell: float,
    name: str,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the smoothed rim (M, 3) of a pool (nx, ny, nz), whose highest layer is `level`, and the rim's mean (3,).

    What stands in the middle of the pool, a divider or the tube of a cake tin, hides the wall from there: it is then followed from
    above a divider that is lower than the rim, or from the pool around what stands there, as where dividers leave rooms outside.
    """
    centre = _middle(pool[:, :, level], axes)
    bottom = np.nonzero(pool.any(axis=(0, 1)))[0][0]
    first, lowest_m = max(level - 5, bottom), max(axes[2][level] - 5 * cell, axes[2][bottom])
    is_divided, turns = False, 3
    while turns:
        turns -= 1
        i, j = np.clip(
            np.rint((centre - [axes[0][0], axes[1][0]]) / cell).astype(int), 0, np.array(pool.shape[:2]) - 1
        )
        clear = np.flatnonzero(pool[i, j, first : level + 1])
        start = axes[2][first + clear[0]] if len(clear) and clear[0] > 0 else lowest_m
        start = min(start, top_m - cell / 2)  # of a shallow one all cells may be level with its rim
        hidden = is_divided or (len(clear) == 0 and _is_wide(pool[:, :, first], i, j))
        from_m = _reach(pool[:, :, first], axes, centre, cell) if hidden else 0.0
        rim = _rim_about(surface, centre, start, top_m, from_m, name)
        outside = _share_outside(pool[:, :, first], axes, rim, cell)
        if not is_divided and _MOST_OUTSIDE < outside < 1 - _MOST_OUTSIDE:  # all of it: about a spoon
            is_divided, turns = True, 3
        centre = _middle(pool[:, :, first], axes) if is_divided else rim[:, :2].mean(axis=0)
    return rim, rim.mean(axis=0)


def _middle(layer: np.ndarray, axes: list[np.ndarray]) -> np.ndarray:
    """Return the mean place (2,) of a pool's layer (nx, ny)."""
    ix, iy = np.nonzero(layer)
    return np.array([axes[0][ix].mean(), axes[1][iy].mean()])


def _share_outside(layer: np.ndarray, axes: list[np.ndarray], rim: np.ndarray, cell: float) -> float:
    """Return the share of a pool's layer (nx, ny) that is outside of a rim (M, 3)."""
    x, y = (axis[index] for axis, index in zip(axes[:2], np.nonzero(layer), strict=True))
    opening = rim.mean(axis=0)
    radius, _ = rim_at(rim, opening, x, y)
    return float(np.mean(np.hypot(x - opening[0], y - opening[1]) > radius + 2 * cell))


def _azimuths() -> np.ndarray:
    """Return the directions (M,) in which the rim is looked for."""
    return (np.arange(AZIMUTHS) + 0.5) * 2 * np.pi / AZIMUTHS - np.pi


def _is_wide(layer: np.ndarray, i: int, j: int) -> bool:
    """Return whether what stands at a cell of a pool's layer (nx, ny) is no spoon, but wide, or a part of the wall."""
    from scipy import ndimage

    labels, _ = ndimage.label(~layer)
    places = labels == labels[i, j], ndimage.binary_fill_holes(layer)
    # In cells; those next to a surface are no pool's.
    stands, across = (2 * np.sqrt(np.count_nonzero(place) / np.pi) for place in places)
    return bool(stands - 2 > _LEAST_TUBE * (across + 2))


def _reach(layer: np.ndarray, axes: list[np.ndarray], centre: np.ndarray, cell: float) -> np.ndarray:
    """Return how far (M,) from the centre a pool's layer (nx, ny) goes in each azimuth, less two cells."""
    azimuth = _azimuths()
    steps = np.arange(0.0, np.hypot(*layer.shape) * cell, cell / 2)
    out = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1)
    places = centre + steps[:, None] * out[:, None] - [axes[0][0], axes[1][0]]
    i, j = np.moveaxis(np.rint(places / cell).astype(int), -1, 0)
    within = (i >= 0) & (i < layer.shape[0]) & (j >= 0) & (j < layer.shape[1])
    held = within & layer[np.where(within, i, 0), np.where(within, j, 0)]
    there = held.any(axis=1)
    reach_m = np.where(held, steps, 0.0).max(axis=1) - 2 * cell
    return np.interp(azimuth, azimuth[there], np.maximum(reach_m[there], 0.0), period=2 * np.pi)


def _rim_about(
    surface: Surface,
    centre: np.ndarray,
    start_m: float,
    top_m: float,
    from_m: np.ndarray | float,
    name: str,
) -> np.ndarray:
    """Follow the wall upwards in every azimuth, as seen from the axis, or from_m (M,) off it, to its edge; (M, 3).

    Over a slit, and where a handle bridges the opening, it goes from one side to the other.
    """
    from scipy import ndimage

    azimuth = _azimuths()
    heights = np.arange(start_m, top_m + _RIM_STEP_M, _RIM_STEP_M)
    origins = np.zeros((AZIMUTHS, len(heights), 3))
    out = np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth], axis=-1)
    from_m = np.broadcast_to(from_m, AZIMUTHS)[:, None]
    origins[..., :2], origins[..., 2] = centre + from_m[..., None] * out[:, None, :2], heights
    hits = surface.hit(origins, np.broadcast_to(out[:, None], origins.shape)) + from_m
    hits = np.pad(np.minimum(hits, _NOWHERE_M), ((2, 2), (0, 0)), mode="wrap")
    hits = ndimage.median_filter(hits, size=5)[2:-2]
    radius, height = hits[:, 0], np.full(AZIMUTHS, heights[0])
    for k in range(1, len(heights)):
        # A step outwards is something else behind the wall: a handle that rises above the rim.
        on = (np.abs(hits[:, k] - radius) < np.maximum(0.010, 0.35 * radius)) & (
            heights[k] - height <= _RIM_GAP_M
        )
        radius, height = np.where(on, hits[:, k], radius), np.where(on, heights[k] + _RIM_STEP_M / 2, height)
    slit = radius >= _NOWHERE_M
    if slit.mean() > _MOST_SLIT:
        raise PipelineError(
            f"{name}: expected a wall all round the opening, as seen from its middle, found none in {360 * slit.mean():.0f} of "
            "360° (a slit, or an opening like an L or a U); mend the scan or put the object in objects.exclude"
        )
    left_out = slit | (height > ndimage.median_filter(height, AZIMUTHS // 4 + 1, mode="wrap") + _BRIDGE_M)
    near = ndimage.binary_dilation(np.tile(left_out, 3), iterations=3)[AZIMUTHS:-AZIMUTHS]
    if left_out.any() and not near.all():
        radius, height = (
            np.interp(azimuth, azimuth[~near], a[~near], period=2 * np.pi) for a in (radius, height)
        )
    radius, height = (
        ndimage.gaussian_filter1d(ndimage.median_filter(a, 5, mode="wrap"), 2.0, mode="wrap")
        for a in (radius, height)
    )
    return np.column_stack([centre + radius[:, None] * out[:, :2], height])


def rim_at(
    rim: np.ndarray, opening: np.ndarray, x: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the rim's distance from the opening's axis and its height in the azimuths of places x, y of any shape."""
    offset = rim[:, :2] - opening[:2]
    azimuth = np.arctan2(offset[:, 1], offset[:, 0])
    order = np.argsort(azimuth)
    wanted = np.arctan2(y - opening[1], x - opening[0])
    radius = np.interp(wanted, azimuth[order], np.hypot(*offset[order].T), period=2 * np.pi)
    return radius, np.interp(wanted, azimuth[order], rim[order, 2], period=2 * np.pi)
