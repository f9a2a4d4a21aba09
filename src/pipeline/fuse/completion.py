"""What no view saw of a wall: taken to be as thick as the wall is where both its sides were seen."""

import numpy as np
from scipy import ndimage

HANDLE_M = 0.025  # what stands off the body and is narrower in a level is no part of its wall
OFF_M = 0.006  # what was seen so far off the wall is a handle: so much around it stays
# Of the cavity's edge, and of the outer one on its levels; with less, what is unseen stays solid. Of bowls 4 % of the outside are
# seen from nowhere.
LEAST_UNSEEN, LEAST_UNSEEN_OUTSIDE = 0.05, 0.1
LEAST_M3 = 5e-6  # a cavity that keeps less is none, and tells nothing of a wall
LEAST_EDGE = 12  # voxels of a level whose both sides were seen tell how thick the wall is there
LEAST_PART = 60  # voxels: a handle's or a foot's skin; noise near the table leaves a few
HALF = 0.5  # of a voxel: so much further than the last solid one's middle is the surface, in the mean
_CROSS = ndimage.generate_binary_structure(2, 1)
_LEVEL = _CROSS[..., None]


def completed(
    value: np.ndarray, measured: np.ndarray, walled_in: np.ndarray, voxel_m: float, truncation_m: float
) -> np.ndarray | None:
    """Return the signed distances (nx, ny, nz) in truncations, positive in the open, with walls in place of what is in shadow.

    None where that is hardly anything.

    measured (nx, ny, nz): what some view saw. walled_in: the cavity. Unseen places that are deeper in the body on their level than
    its wall is thick, and can be reached from the cavity, are open; then those that are further from the cavity than that, and can
    be reached from outside, also below the cavity's floor. Nothing that was seen changes.
    """
    if np.count_nonzero(walled_in) * voxel_m**3 < LEAST_M3:
        return None
    inside = ndimage.binary_dilation(walled_in, _LEVEL) & (value <= 0)
    outside = _outer_edge((value <= 0) | walled_in) & walled_in.any(axis=(0, 1))
    shadow_inside = _unseen(inside, measured) > LEAST_UNSEEN
    if not shadow_inside and _unseen(outside, measured) <= LEAST_UNSEEN_OUTSIDE:
        return None
    value, room, truncation = value.copy(), walled_in, truncation_m / voxel_m
    levels = np.flatnonzero(walled_in.any(axis=(0, 1)))
    for z in levels if shadow_inside else ():
        beyond = _beyond_wall_inside(value[..., z], measured[..., z], room[..., z], voxel_m)
        value[..., z] = _opened(value[..., z], measured[..., z], beyond, room[..., z], truncation)
    room = ndimage.binary_propagation(room, _LEVEL, mask=(value > 0) & room.any(axis=(0, 1)))
    beyond = _beyond_wall_outside(value, measured, room, levels, voxel_m)
    return _opened(value, measured, beyond, (value > 0) & ~room, truncation)


def _outer_edge(body: np.ndarray) -> np.ndarray:
    """Return which places (nx, ny, nz) of the body are at its edge on their level."""
    return body & ~ndimage.binary_erosion(body, _LEVEL)


def _unseen(places: np.ndarray, measured: np.ndarray) -> float:
    """Return which share of the places (nx, ny, nz) was not seen."""
    return float(np.mean(~measured[places])) if places.any() else 0.0


def _opened(
    value: np.ndarray, measured: np.ndarray, beyond: np.ndarray, start: np.ndarray, truncation: float
) -> np.ndarray:
    """Return the values of a level (nx, ny) or of all, open where nothing was seen beyond the wall (in voxels), on ways from the
    start."""
    unseen = (value <= 0) & ~measured
    reached = ndimage.binary_propagation(start, mask=start | (unseen & (beyond > 0)))
    opened = unseen & ndimage.binary_dilation(reached)
    return np.where(opened, np.maximum(value, np.clip(beyond / truncation, -1.0, 1.0)), value).astype(
        value.dtype
    )


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
    value: np.ndarray, measured: np.ndarray, room: np.ndarray, levels: np.ndarray, voxel_m: float
) -> np.ndarray:
    """Return how much further from the cavity than its wall is thick the voxels (nx, ny, nz) are, in voxels; handles stay.

    Below the cavity's levels that is what it is on the lowest, unless a foot that is wider was seen.
    """
    solid, off = value <= 0, OFF_M / voxel_m
    distance, inside = ndimage.distance_transform_edt(~room, return_indices=True)
    both = measured & _seen_at(solid & measured, inside)
    thick = np.full(len(levels), np.nan)
    for i, z in enumerate(levels):
        body = _without_handles(solid[..., z] | room[..., z], voxel_m)
        edge = body & ~ndimage.binary_erosion(body, _CROSS) & both[..., z]
        if np.count_nonzero(edge) >= LEAST_EDGE:
            thick[i] = np.median(distance[..., z][edge])
    known = np.isfinite(thick)
    if not known.any():
        return np.full(value.shape, -np.inf)
    beyond = distance - np.interp(np.arange(value.shape[2]), levels[known], thick[known]) - HALF
    lowest = levels[0]
    beyond[..., :lowest] = beyond[..., lowest, None]
    further = _large(solid & measured & (beyond > off))
    stays = np.count_nonzero(further, axis=(0, 1)) >= LEAST_EDGE
    stays[lowest : levels[-1] + 1] = False
    stays[levels[-1] + 1 :] = True
    near = ndimage.distance_transform_edt(~further) <= off if further.any() else further
    return np.where(near | stays, -np.inf, beyond)


def _large(places: np.ndarray) -> np.ndarray:
    """Return the places (nx, ny, nz) that hang together in more than a speck of noise."""
    labels, _ = ndimage.label(places, np.ones((3, 3, 3)))
    large = np.bincount(labels.ravel()) >= LEAST_PART
    large[0] = False
    return large[labels]


def _beyond(distance: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """Return the distances (nx, ny) less the thickness of the wall, which is theirs at its edge; without one, nothing is beyond."""
    if np.count_nonzero(edge) < LEAST_EDGE:
        return np.full(distance.shape, -np.inf)
    return distance - np.median(distance[edge]) - HALF


def _seen_at(seen: np.ndarray, nearest: np.ndarray) -> np.ndarray:
    """Return whether something was seen at the nearest places (2, nx, ny), or (3, nx, ny, nz)."""
    return ndimage.binary_dilation(seen, iterations=2)[tuple(nearest)]


def _without_handles(body: np.ndarray, voxel_m: float) -> np.ndarray:
    """Return what of a level's body (nx, ny) is wider than a handle."""
    radius = HANDLE_M / voxel_m / 2
    core = ndimage.distance_transform_edt(np.pad(body, 1))[1:-1, 1:-1] > radius
    return body & (ndimage.distance_transform_edt(~core) <= radius) if core.any() else body
