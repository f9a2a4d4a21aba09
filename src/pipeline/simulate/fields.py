"""A container as the liquid sees it: how much wall is within reach of a point, and how far the wall is.

The wall is one-sided. Everything beyond the cavity's surface and below the rim counts as solid, however thin the real wall
is: particles on two sides of it cannot act on one another, and nothing tunnels. Its rim is lowered by half a spacing, for a
particle's centre stays half a spacing above what it flows over.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from pipeline.geometry.cavity import Cavity
from pipeline.geometry.rim import AZIMUTHS

SUPPORT = 2.0  # support radius of the kernel, spacings: about 32 neighbours
FIELD_CELL = 0.3  # cell of the precomputed wall, spacings: 3 mm at 10 mm
HEADROOM = 3.0  # the field ends this many spacings above the rim


class Walls(NamedTuple):
    """What the compiled code reads. Object frame, float32, metres.

    reach (nx·ny·nz, 4): the wall's share of the kernel at a point, and its gradient (1/m). distance (nx·ny·nz,): to the
    wall, negative beyond. shape (3,): nx, ny, nz; origin (3,): their first point; cell: their step. rim_radius,
    rim_height (M,): by azimuth about the opening (3,), the azimuth of [k] is 2πk/M. lowered: by how much the rim is lowered;
    lowest_edge: its lowest point after that. bins (3,): cells of one support radius that hold the particles.
    """

    reach: np.ndarray
    distance: np.ndarray
    shape: np.ndarray
    origin: np.ndarray
    cell: np.float32
    rim_radius: np.ndarray
    rim_height: np.ndarray
    lowered: np.float32
    lowest_edge: np.float32
    opening: np.ndarray
    spacing: np.float32
    bins: np.ndarray


@dataclass(frozen=True, eq=False)
class Vessel:
    """A cavity made ready for particles of volume spacing_m³, its rim lowered by `lowered` spacings.

    `settled` remembers states at rest by their number of particles (`rest`); it is no part of the vessel's value.
    """

    cavity: Cavity
    spacing_m: float
    lowered: float
    walls: Walls
    settled: dict[int, np.ndarray] = field(default_factory=dict, repr=False)


def precompute(cavity: Cavity, spacing_m: float, lowered: float) -> Vessel:
    """Precompute the wall of a cavity for particles `spacing_m` apart, its rim lowered by `lowered` spacings."""
    support = SUPPORT * spacing_m
    solid, origin = _solid(cavity, support, lowered * spacing_m)
    reach = _convolved(solid, support, cavity.cell_m)
    cell = FIELD_CELL * spacing_m
    low = cavity.origin_m - support
    high = cavity.origin_m + cavity.cell_m * np.array(cavity.interior.shape) + support
    high[2] = cavity.rim_m[:, 2].max() + HEADROOM * spacing_m
    axes = [np.arange(a, b + cell, cell) for a, b in zip(low, high, strict=True)]
    at = np.stack(np.meshgrid(*axes, indexing="ij"))
    distance = _resampled(_distance(cavity), cavity.origin_m, cavity.cell_m, at)
    reach_at = np.stack([_resampled(part, origin, cavity.cell_m, at) for part in reach], axis=-1)
    azimuth = 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
    radius, height = cavity.rim_at(
        cavity.opening_m[0] + np.cos(azimuth), cavity.opening_m[1] + np.sin(azimuth)
    )
    walls = Walls(
        reach_at.reshape(-1, 4).astype(np.float32),
        distance.ravel().astype(np.float32),
        np.array(distance.shape, np.uint64),
        np.array([a[0] for a in axes], np.float32),
        np.float32(cell),
        radius.astype(np.float32),
        height.astype(np.float32),
        np.float32(lowered * spacing_m),
        np.float32(height.min() - lowered * spacing_m),
        cavity.opening_m.astype(np.float32),
        np.float32(spacing_m),
        np.array([int((a[-1] - a[0]) / support) + 1 for a in axes], np.int64),
    )
    return Vessel(cavity, spacing_m, lowered, walls)


def _solid(cavity: Cavity, support: float, lowered_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the solid share of each cell of the cavity's grid, grown by the support radius, and its first centre."""
    cell = cavity.cell_m
    pad = int(np.ceil(2 * support / cell)) + 1
    wall = np.clip(0.5 - np.pad(cavity.distance_m.astype(float), pad, mode="edge") / cell, 0.0, 1.0)
    origin = cavity.origin_m - pad * cell
    x, y, z = (o + cell * np.arange(n) for o, n in zip(origin, wall.shape, strict=True))
    height = cavity.rim_at(x[:, None], y[None, :])[1][..., None] - lowered_m
    outside = np.ones(wall.shape, dtype=bool)
    outside[pad:-pad, pad:-pad, pad:-pad] = False
    return np.where(outside, 1.0, wall) * np.clip(0.5 + (height - z) / cell, 0.0, 1.0), origin


def _distance(cavity: Cavity) -> np.ndarray:
    """Return the distance to the wall, continued above the rim as if the rim's contour went straight up."""
    x, y, z = (
        o + cavity.cell_m * np.arange(n) for o, n in zip(cavity.origin_m, cavity.interior.shape, strict=True)
    )
    radius, height = (a[..., None] for a in cavity.rim_at(x[:, None], y[None, :]))
    from_axis = np.hypot(x[:, None] - cavity.opening_m[0], y[None, :] - cavity.opening_m[1])[..., None]
    return np.where(z >= height, radius - from_axis, cavity.distance_m.astype(float))


def _convolved(solid: np.ndarray, support: float, cell: float) -> list[np.ndarray]:
    """Return the integral of the kernel over the solid about each cell, and its gradient."""
    from scipy import fft  # scipy.signal's fftconvolve does the same, and takes 0.3 s to load

    reach = int(np.ceil(support / cell))
    offset = cell * np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * 3, indexing="ij"))
    q = np.minimum(np.linalg.norm(offset, axis=0) / support, 1.0)
    kernel = np.where(q <= 0.5, 6 * q**3 - 6 * q**2 + 1, 2 * (1 - q) ** 3)
    shape = [fft.next_fast_len(n + 2 * reach, real=True) for n in solid.shape]
    share = fft.irfftn(fft.rfftn(solid, shape) * fft.rfftn(kernel / kernel.sum(), shape), shape)
    share = share[tuple(slice(reach, reach + n) for n in solid.shape)]
    return [share, *np.gradient(share, cell)]


def _resampled(values: np.ndarray, origin: np.ndarray, cell: float, at: np.ndarray) -> np.ndarray:
    """Return values of a grid at points (3, ...), linear between cells, constant beyond."""
    from scipy.ndimage import map_coordinates

    return map_coordinates(values, (at - origin[:, None, None, None]) / cell, order=1, mode="nearest")
