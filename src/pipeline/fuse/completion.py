"""What no view saw of a cavity's wall: taken to be as thick as the wall is where both its sides were seen."""

import numpy as np
from scipy import ndimage

HANDLE_M = 0.025  # what stands off the body and is narrower in a level is no part of its wall
LEAST_UNSEEN = 0.05  # of the cavity's edge, over all levels; with less, what is unseen stays solid
LEAST_EDGE = 12  # voxels of a level whose both sides were seen tell how thick the wall is there
_CROSS = ndimage.generate_binary_structure(2, 1)


def completed(
    value: np.ndarray, measured: np.ndarray, walled_in: np.ndarray, voxel_m: float, truncation_m: float
) -> np.ndarray:
    """Return the signed distances (nx, ny, nz) in truncations, positive in the open, with the cavity wider where it was not seen.

    measured (nx, ny, nz): what some view saw. walled_in: the cavity. Level by level: unseen places that are deeper in the body than
    its wall is thick, and can be reached from the cavity, are open. Nothing is seen there, so nothing contradicts it.
    """
    edge = ndimage.binary_dilation(walled_in, _CROSS[..., None]) & (value <= 0)
    if np.count_nonzero(edge & ~measured) < LEAST_UNSEEN * np.count_nonzero(edge):
        return value
    value = value.copy()
    for z in np.flatnonzero(walled_in.any(axis=(0, 1))):
        level = value[..., z], measured[..., z], walled_in[..., z]
        value[..., z] = _wider(*level, voxel_m, truncation_m / voxel_m)
    return value


def _wider(
    value: np.ndarray, measured: np.ndarray, room: np.ndarray, voxel_m: float, truncation: float
) -> np.ndarray:
    """Return the values (nx, ny) of a level with a wider cavity; the truncation in voxels."""
    solid = value <= 0
    body = _without_handles(ndimage.binary_fill_holes(solid | room), HANDLE_M / voxel_m / 2) | room
    depth, outside = ndimage.distance_transform_edt(body, return_indices=True)
    outside_seen = ndimage.binary_dilation(solid & measured, iterations=2)[tuple(outside)]
    edge = ndimage.binary_dilation(room, _CROSS) & solid & measured & outside_seen
    if np.count_nonzero(edge) < LEAST_EDGE:
        return value
    beyond = depth - np.median(depth[edge])
    labels, _ = ndimage.label(room | (solid & ~measured & (beyond > 0)), _CROSS)
    reached = np.isin(labels, np.unique(labels[room]))
    opened = solid & ~measured & ndimage.binary_dilation(reached, _CROSS)
    return np.where(opened, np.maximum(value, np.clip(beyond / truncation, -1.0, 1.0)), value)


def _without_handles(body: np.ndarray, radius: float) -> np.ndarray:
    """Return what of a level's body (nx, ny) is wider than twice the radius, in voxels."""
    core = ndimage.distance_transform_edt(np.pad(body, 1))[1:-1, 1:-1] > radius
    if not core.any():
        return body
    return body & (ndimage.distance_transform_edt(~core) <= radius)
