"""What no view saw of a wall: taken to be as thick as the wall is where both its sides were seen."""

import numpy as np
from scipy import ndimage

HANDLE_M = 0.025  # what stands off the body and is narrower in a level is no part of its wall
OFF_M = 0.006  # what was seen so far off the wall is a handle: so much around it stays
LEAST_UNSEEN = 0.05  # of the cavity's edge, over all levels; with less, what is unseen stays solid
LEAST_EDGE = 12  # voxels of a level whose both sides were seen tell how thick the wall is there
HALF = 0.5  # of a voxel: so much further than the last solid one's middle is the surface, in the mean
_CROSS = ndimage.generate_binary_structure(2, 1)


def completed(
    value: np.ndarray, measured: np.ndarray, walled_in: np.ndarray, voxel_m: float, truncation_m: float
) -> np.ndarray:
    """Return the signed distances (nx, ny, nz) in truncations, positive in the open, with walls in place of what is in shadow.

    measured (nx, ny, nz): what some view saw. walled_in: the cavity. Level by level: unseen places that are deeper in the body than
    its wall is thick, and can be reached from the cavity, are open; then those that are further from the cavity than that, and can
    be reached from outside, also below the cavity's floor. Nothing that was seen changes.
    """
    edge = ndimage.binary_dilation(walled_in, _CROSS[..., None]) & (value <= 0)
    if np.count_nonzero(edge & ~measured) <= LEAST_UNSEEN * np.count_nonzero(edge):
        return value
    value, truncation = value.copy(), truncation_m / voxel_m
    levels = np.flatnonzero(walled_in.any(axis=(0, 1)))
    for z in levels[::-1]:  # down to the floor, whose level tells what is in shadow below
        level, seen, room = value[..., z], measured[..., z], walled_in[..., z]
        beyond = _beyond_wall_inside(level, seen, room, voxel_m)
        level = _opened(level, seen, beyond, room, truncation)
        room = ndimage.binary_propagation(room, mask=level > 0)
        beyond = _beyond_wall_outside(level, seen, room, voxel_m)
        value[..., z] = _opened(level, seen, beyond, (level > 0) & ~room, truncation)
    for z in range(levels[0]):
        level, seen = value[..., z], measured[..., z]
        foot = (level <= 0) & seen & (beyond > OFF_M / voxel_m)
        if np.count_nonzero(foot) < LEAST_EDGE:  # what is wider than the wall above was not in its shadow
            value[..., z] = _opened(level, seen, beyond, level > 0, truncation)
    return value


def _opened(
    value: np.ndarray, measured: np.ndarray, beyond: np.ndarray, start: np.ndarray, truncation: float
) -> np.ndarray:
    """Return the values (nx, ny) of a level, open where nothing was seen beyond the wall (in voxels), on ways from the start."""
    unseen = (value <= 0) & ~measured
    reached = ndimage.binary_propagation(start, mask=start | (unseen & (beyond > 0)))
    opened = unseen & ndimage.binary_dilation(reached, _CROSS)
    return np.where(opened, np.maximum(value, np.clip(beyond / truncation, -1.0, 1.0)), value)


def _beyond_wall_inside(
    value: np.ndarray, measured: np.ndarray, room: np.ndarray, voxel_m: float
) -> np.ndarray:
    """Return how much deeper in the body than its wall is thick the voxels (nx, ny) of a level are, in voxels."""
    solid = value <= 0
    body = _without_handles(ndimage.binary_fill_holes(solid | room), voxel_m) | room
    depth, outside = ndimage.distance_transform_edt(body, return_indices=True)
    edge = ndimage.binary_dilation(room, _CROSS) & solid & measured
    return _beyond(depth, edge & _seen_at(solid & measured, outside))


def _beyond_wall_outside(
    value: np.ndarray, measured: np.ndarray, room: np.ndarray, voxel_m: float
) -> np.ndarray:
    """Return how much further from the cavity than its wall is thick the voxels (nx, ny) are, in voxels; handles stay."""
    solid = value <= 0
    distance, inside = ndimage.distance_transform_edt(~room, return_indices=True)
    body = _without_handles(solid | room, voxel_m)
    edge = body & ~ndimage.binary_erosion(body, _CROSS) & measured
    beyond = _beyond(distance, edge & _seen_at(solid & measured, inside))
    handle = solid & measured & (beyond > OFF_M / voxel_m)
    near = ndimage.distance_transform_edt(~handle) <= OFF_M / voxel_m if handle.any() else handle
    return np.where(near, -np.inf, beyond)


def _beyond(distance: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """Return the distances (nx, ny) less the thickness of the wall, which is theirs at its edge; without one, nothing is beyond."""
    if np.count_nonzero(edge) < LEAST_EDGE:
        return np.full(distance.shape, -np.inf)
    return distance - np.median(distance[edge]) - HALF


def _seen_at(seen: np.ndarray, nearest: np.ndarray) -> np.ndarray:
    """Return whether something was seen (nx, ny) at the nearest places (2, nx, ny)."""
    return ndimage.binary_dilation(seen, iterations=2)[tuple(nearest)]


def _without_handles(body: np.ndarray, voxel_m: float) -> np.ndarray:
    """Return what of a level's body (nx, ny) is wider than a handle."""
    radius = HANDLE_M / voxel_m / 2
    core = ndimage.distance_transform_edt(np.pad(body, 1))[1:-1, 1:-1] > radius
    return body & (ndimage.distance_transform_edt(~core) <= radius) if core.any() else body
