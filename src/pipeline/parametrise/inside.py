"""What the container's inner side tells: capacity, what is kept when tilted, wall. Metres, object frame, z up."""

import numpy as np

from pipeline.geometry.cavity import pour_axis
from pipeline.geometry.frames import rotation_about
from pipeline.parametrise.library import ingredient, parameter

GRID_DEG = tuple(range(0, 121, 15))
_TILTS_RAD = np.radians(np.arange(0.0, 150.5, 1.5))
_OPPOSITE = -0.7  # cosine between the normals of a wall's two sides, at most


@ingredient
def inner(container_m: np.ndarray, container_normals: np.ndarray, opening_m: np.ndarray) -> np.ndarray:
    """Which container points (N,) face the cavity: what is seen from the axis at its own height.

    The eye does not go below a third of the height, so that it sees the floor and its corner from above.
    """
    offset = container_m - opening_m
    eye = np.zeros_like(offset)
    eye[:, 2] = np.maximum(offset[:, 2], -2.0 / 3.0 * np.ptp(container_m[:, 2]))
    return np.einsum("nc,nc->n", eye - offset, container_normals) > 0.0


@ingredient
def kept_m3(
    container_m: np.ndarray,
    container_normals: np.ndarray,
    container_area_m2: np.ndarray,
    inner: np.ndarray,
    opening_m: np.ndarray,
    contour_m: np.ndarray,
    lip_m: np.ndarray,
) -> np.ndarray:
    """What a brimful cup keeps at each of the tilts `_TILTS_RAD` about its lip (T,), by the divergence theorem.

    The liquid's surface has the normal u, and is level with the contour's lowest point. With F = (x - u (u·x))/2 about the
    opening's centre div F = 1, and no F goes through that surface: V = -∮ F·n over the inner side below it, n into the
    cavity. What is lost on the way stays lost, so V never grows.
    """
    axis = pour_axis(opening_m, lip_m)
    ups = np.array([rotation_about(axis, tilt)[2] for tilt in _TILTS_RAD])
    offset, n, area = container_m[inner] - opening_m, container_normals[inner], container_area_m2[inner]
    height, level = offset @ ups.T, ((contour_m - opening_m) @ ups.T).min(axis=0)
    flux = (np.einsum("nc,nc->n", offset, n)[:, None] - height * (n @ ups.T)) / 2.0
    volumes = -np.sum(flux * area[:, None] * (height < level), axis=0)
    return np.minimum.accumulate(np.maximum(volumes, 0.0))


@parameter("m3")
def capacity_m3(kept_m3: np.ndarray) -> float:
    """Capacity: the cavity below the lowest point of the contour, upright, V(0)."""
    return float(kept_m3[0])


@parameter("m3", parts=[f"{tilt:03d}_deg" for tilt in GRID_DEG])
def retained_m3(kept_m3: np.ndarray) -> np.ndarray:
    """What hydrostatics leaves in a brimful cup that is tilted slowly about its lip, V(θ) at θ = 0°, 15°, … 120°."""
    return np.interp(np.radians(GRID_DEG), _TILTS_RAD, kept_m3)


@parameter("rad")
def tilt_reference_cavity_rad(kept_m3: np.ndarray) -> float:
    """Tilt reference on the cavity: the tilt at which half of the capacity is left, V(θ) = V(0)/2."""
    half = kept_m3[0] / 2.0
    after = max(1, int(np.argmax(kept_m3 <= half)))
    return float(np.interp(-half, -kept_m3[after - 1 : after + 1], _TILTS_RAD[after - 1 : after + 1]))


@parameter("m")
def wall_m(container_m: np.ndarray, container_normals: np.ndarray, inner: np.ndarray) -> float:
    """Thickness of the wall: median over the inner side of |(q - p)·n|, q the nearest that faces the other way.

    nan where no point has another one opposite: a cloud of one side, torn labels.
    """
    from scipy.spatial import cKDTree

    if not inner.any() or inner.all():
        return float("nan")
    p, n = container_m[inner], container_normals[inner]
    q, n_other = container_m[~inner], container_normals[~inner]
    nearest = cKDTree(q).query(p)[1]
    opposite = np.einsum("nc,nc->n", n, n_other[nearest]) < _OPPOSITE
    apart_m = np.abs(np.einsum("nc,nc->n", q[nearest] - p, n))[opposite]
    return float(np.median(apart_m)) if len(apart_m) else float("nan")
