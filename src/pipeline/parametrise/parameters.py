"""Warped parameters: each a short pure function of the warped cloud (section II-D), that may build on others.

A function's arguments name what it needs: another parameter, or a piece of the cloud (`CLOUD_PIECES`). To add a parameter,
write one function with the `parameter` mark and a unit in its name. All lengths in metres, object frame, z up.
"""

import inspect
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from pipeline.errors import PipelineError
from pipeline.geometry import hulls

# What `evaluate` starts from: all points (N, 3); those of the container with normals and areas; those of the rim.
CLOUD_PIECES = ("points_m", "container_m", "container_normals", "container_area_m2", "rim_m", "hull_points")

PARAMETERS: dict[str, Callable[..., Any]] = {}
CONTOUR_BINS = 90
LEVEL_M = 0.002


def parameter(function: Callable[..., Any]) -> Callable[..., Any]:
    """Register a function as the parameter of its name."""
    PARAMETERS[function.__name__] = function
    return function


def evaluate(names: Iterable[str], pieces: dict[str, Any]) -> dict[str, Any]:
    """Return the named parameters, and all that they build on, of a cloud given as `CLOUD_PIECES`."""
    values = dict(pieces)
    for name in names:
        _evaluate(name, values)
    return values


def _evaluate(name: str, values: dict[str, Any]) -> Any:
    if name not in values:
        if name not in PARAMETERS:
            raise PipelineError(f"parameter '{name}' is unknown; there are {' '.join(sorted(PARAMETERS))}")
        function = PARAMETERS[name]
        needs = inspect.signature(function).parameters
        values[name] = function(**{need: _evaluate(need, values) for need in needs})
    return values[name]


@parameter
def opening_m(rim_m: np.ndarray) -> np.ndarray:
    """Centre of the opening (3,): the mean of the rim points."""
    return rim_m.mean(axis=0)


@parameter
def radius_m(rim_m: np.ndarray, opening_m: np.ndarray) -> float:
    """Radius of the opening: the mean distance of the rim points to its centre."""
    return float(np.linalg.norm(rim_m - opening_m, axis=1).mean())


@parameter
def volume_m3(container_m: np.ndarray) -> float:
    """Volume of the container: that of its points' convex hull."""
    return hulls.hull_volume_m3(container_m)


@parameter
def height_m(points_m: np.ndarray) -> float:
    """Height of the container: the range of all points along the first dimension (up)."""
    return float(np.ptp(points_m[:, 2]))


@parameter
def contour_m(rim_m: np.ndarray, opening_m: np.ndarray) -> np.ndarray:
    """Smoothed contour of the rim (M, 3): the mean of its points in each of 90 directions, at their top's height."""
    azimuth = np.arctan2(*(rim_m - opening_m)[:, 1::-1].T)
    sector = np.floor((azimuth + np.pi) / (2 * np.pi) * CONTOUR_BINS).astype(int) % CONTOUR_BINS
    contour = [
        [*rim_m[sector == s, :2].mean(axis=0), np.quantile(rim_m[sector == s, 2], 0.95)]
        for s in np.unique(sector)
    ]
    # A circular mean over five neighbours: single noisy points make no lip.
    stacked = np.array(contour)
    return np.mean([np.roll(stacked, shift, axis=0) for shift in range(-2, 3)], axis=0)


@parameter
def lip_m(rim_m: np.ndarray, contour_m: np.ndarray) -> np.ndarray:
    """Lip of the cup alone (3,): the rim point nearest to the contour's lowest, of level ones (2 mm) that furthest along +x."""
    level = contour_m[contour_m[:, 2] <= contour_m[:, 2].min() + LEVEL_M]
    lowest = level[np.argmax(level[:, 0])]
    return rim_m[np.argmin(np.linalg.norm(rim_m - lowest, axis=1))]


@parameter
def hull_inside_m(container_m: np.ndarray, hull_points: int) -> np.ndarray:
    """Points (M, 3) that fill the container points' hull evenly."""
    return hulls.points_in_hull(container_m, hull_points)


@parameter
def tilt_reference_rad(hull_inside_m: np.ndarray, lip_m: np.ndarray, opening_m: np.ndarray) -> float:
    """Tilt reference of the cup alone: the tilt about the lip at which half of the volume is above it."""
    return hulls.tilt_reference_rad(hull_inside_m, lip_m, opening_m)


@parameter
def tilt_references_rad(hull_inside_m: np.ndarray, rim_m: np.ndarray, opening_m: np.ndarray) -> np.ndarray:
    """Tilt reference with the lip at each of the rim points, in their order (N,)."""
    return np.array([hulls.tilt_reference_rad(hull_inside_m, lip, opening_m) for lip in rim_m])


@parameter
def capacity_m3(
    container_m: np.ndarray,
    container_normals: np.ndarray,
    container_area_m2: np.ndarray,
    opening_m: np.ndarray,
    contour_m: np.ndarray,
) -> float:
    """Capacity: the cavity below the lowest point of the contour, by the divergence theorem.

    With F = (x, y, 0)/2 about the opening's centre div F = 1, and neither the lip's plane nor a level floor lets F
    through: V = -∮ F·n over the inner side, with n into the cavity.
    """
    offset = container_m - opening_m
    # Seen from the axis, at its own height but not below a third of the height: the inner side faces it.
    viewpoint = np.zeros_like(offset)
    viewpoint[:, 2] = np.maximum(offset[:, 2], -2.0 / 3.0 * np.ptp(container_m[:, 2]))
    inner = np.einsum("nc,nc->n", viewpoint - offset, container_normals) > 0.0
    counted = inner & (container_m[:, 2] < contour_m[:, 2].min())
    flux = np.einsum("nc,nc->n", offset[:, :2], container_normals[:, :2]) / 2.0
    return float(-np.sum((flux * container_area_m2)[counted]))
