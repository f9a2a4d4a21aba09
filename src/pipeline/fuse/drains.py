"""Small holes through the floor or the wall of a dropped container: gaps of its scan, which are closed."""

import numpy as np
from scipy import ndimage

from pipeline.fuse.wrapping import Field

WIDEST_M = 0.010
LEAST_M3 = 5e-6  # a container that keeps less is none
PLUG_M = 0.0025
COARSE_M = 0.001  # cells for finding them


def plugged(field: Field) -> tuple[Field, int]:
    """Return the field with holes closed through which liquid would leave, and how many there were.

    Only holes narrower than `WIDEST_M` count; they are closed where they are narrowest.
    """
    step = max(1, round(COARSE_M / field.cell_m))
    cell, margin = step * field.cell_m, int(WIDEST_M / field.cell_m / step) + 1
    # Above the rim, what is open must be wide.
    air = np.pad(field.value_m[::step, ::step, ::step] < 0, margin, constant_values=True)
    air_m = ndimage.distance_transform_edt(air) * cell
    layer, pool, outside = _pool(air_m, cell)
    if not pool.any():
        return field, 0
    meeting = _meeting(air_m[:, :, : layer + 1], pool, outside, cell)
    parts, n = ndimage.label(meeting, np.ones((3, 3, 3)))
    widths = [max(s.stop - s.start for s in part) * cell for part in ndimage.find_objects(parts)]
    if n == 0 or max(widths) > 1.5 * WIDEST_M:
        return field, 0
    plug = np.zeros(field.value_m.shape, bool)
    cells = step * (np.argwhere(meeting) - margin)
    plug[tuple(cells[((cells >= 0) & (cells < plug.shape)).all(axis=1)].T)] = True
    around = ndimage.distance_transform_edt(~plug) * field.cell_m
    return Field(np.maximum(field.value_m, PLUG_M / 2 - around), field.low_m, field.cell_m), n


def _pool(air_m: np.ndarray, cell_m: float) -> tuple[int, np.ndarray, np.ndarray]:
    """Return the rim's layer, what is enclosed below it if no hole narrower than `WIDEST_M` let it out, and what is not."""
    wide = air_m > WIDEST_M / 2
    for layer in range(wide.shape[2] - 1, 0, -1):
        labels, n = ndimage.label(wide[:, :, : layer + 1])
        sizes = np.bincount(labels.ravel(), minlength=n + 1)
        sizes[[0, labels[0, 0, 0]]] = 0
        if sizes.max() * cell_m**3 >= LEAST_M3:
            rim = max(layer - int(WIDEST_M / 2 / cell_m) - 2, 0)  # `wide` ends that far above it
            below = labels[:, :, : rim + 1]
            return rim, below == sizes.argmax(), below == labels[0, 0, 0]
    return 0, np.zeros(1, bool), np.zeros(1, bool)


def _meeting(air_m: np.ndarray, pool: np.ndarray, outside: np.ndarray, cell_m: float) -> np.ndarray:
    """Return where pool and outside meet when both grow through the air, the widest places first."""
    for least_m in np.arange(WIDEST_M / 2, -cell_m / 2, -cell_m / 2):
        allowed, grown = air_m > max(least_m, 0.0), 0
        while grown != (grown := int(pool.sum() + outside.sum())):
            pool = pool | (ndimage.binary_dilation(pool) & allowed & ~outside)
            outside = outside | (ndimage.binary_dilation(outside) & allowed & ~pool)
    return pool & ndimage.binary_dilation(outside)
