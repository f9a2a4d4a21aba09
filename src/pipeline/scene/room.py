"""The room for liquid in an object for the browser: its radius by height and azimuth."""

from typing import Any

import numpy as np

from pipeline.geometry.cavity import Cavity, lip_alone
from pipeline.scene.packing import pack

LAYERS, SECTORS, CONTOUR = 40, 64, 64


def room(cup: Cavity) -> dict[str, Any]:
    """Return the part of the viewer's object that tells of a cavity: rim, opening, lip, radii (layers × sectors, from below)."""
    layers = np.flatnonzero(cup.interior.any(axis=(0, 1)))
    bottom, top = _floor_m(cup, int(layers[0])), float(cup.rim_m[:, 2].max())
    radii = radii_m(cup, bottom, top)
    reach = float(radii.max())
    step = len(cup.rim_m) // CONTOUR
    table = np.rint(radii / reach * 255).astype(np.uint8)
    return {
        "rim_m": cup.rim_m[::step].round(5).tolist(),
        "opening_m": cup.opening_m.round(5).tolist(),
        "lip_m": lip_alone(cup).round(5).tolist(),
        "room": {
            **{"layers": LAYERS, "sectors": SECTORS, "bottom_m": bottom, "top_m": top, "reach_m": reach},
            "axis_m": cup.opening_m[:2].tolist(),
            "capacity_m3": cup.capacity_m3,
            "radii": pack({"radii": table}),
        },
    }


def radii_m(cup: Cavity, bottom_m: float, top_m: float) -> np.ndarray:
    """Return the radius (LAYERS, SECTORS) at which the cavity's wall is met from the opening's axis, at layers' middles.

    Where no wall is met (above a spout) it is that of the rim.
    """
    from scipy import ndimage

    z = bottom_m + (np.arange(LAYERS) + 0.5) / LAYERS * (top_m - bottom_m)
    azimuth = (np.arange(SECTORS) + 0.5) / SECTORS * 2 * np.pi - np.pi
    away = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1)
    r = np.arange(0.0, np.hypot(*cup.interior.shape[:2]) * cup.cell_m / 2, cup.cell_m / 4)
    xy = cup.opening_m[:2] + r[:, None] * away[:, None, :]
    shape = (LAYERS, SECTORS, len(r))
    x, y = np.broadcast_to(xy[..., 0], shape), np.broadcast_to(xy[..., 1], shape)
    where = np.stack([x, y, np.broadcast_to(z[:, None, None], shape)]) - cup.origin_m[:, None, None, None]
    open_m = ndimage.map_coordinates(cup.distance_m, where / cup.cell_m, order=1, mode="nearest")
    wall = open_m <= 0.0
    rim_m, height_m = cup.rim_at(*(cup.opening_m[:2] + away).T)
    met = r[wall.argmax(axis=2)]
    return np.where(wall.any(axis=2) & (z[:, None] < height_m), met, rim_m)


def _floor_m(cup: Cavity, first: int) -> float:
    """Return the height of the lowest point of the floor: where the distance to the wall is nought, not a cell's middle."""
    column = cup.distance_m[:, :, first]
    deepest = float(column[cup.interior[:, :, first]].max())
    return float(cup.origin_m[2] + cup.cell_m * first - min(deepest, cup.cell_m))
