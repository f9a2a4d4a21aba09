"""The ring round an opening among points that look like a rim. Object frame, upright, metres."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from pipeline.warp.clouds import Cloud
from pipeline.warp.components import components

SECTORS = 36
LEAST_POINTS, CENTRINGS = 30, 2
# In radii of the ring. What is nearer to the axis is no ring; what stands so far above the ring beside it bridges the opening, as
# a bail does; what is so far below its top is the wall; what is about level with it is within the band; what rises so far through
# it is no tube, as a cake tin's, but a cup on a saucer.
INNER, BRIDGE, DEPTH, BAND, THROUGH = 0.5, 0.1, 0.3, 0.15, 0.3
STICKS_OUT = 1.4  # times as far out as the ring beside it: a handle
LEAST_ROUND, LEAST_FREE = 0.7, 0.7  # of the sectors, where it has an edge, and where no wall goes on above
LUG = 0.1  # of the object's extent: smaller rings are a lug's more likely than an opening's
SURFACE = 0.5  # of the disc within, from where on what covers it closes it


@dataclass(frozen=True)
class Ring:
    """A ring of points (M, 3) about `centre_m` (2,), and what share of the sectors, `coverage`, it goes through.

    Of each of `SECTORS` (S,): `top_m`, how high its top is, or that beside it where it is bridged; `radius_m`, how far from the
    axis its highest point is.
    """

    points_m: np.ndarray
    centre_m: np.ndarray
    top_m: np.ndarray
    radius_m: np.ndarray
    coverage: float

    @property
    def goes_round(self) -> bool:
        """Whether it is one as seen from above: that of a container on its side is none."""
        return self.coverage >= LEAST_ROUND

    @property
    def size_m(self) -> float:
        """Its radius: the median of the sectors'."""
        return float(np.median(self.radius_m))

    def seen(self, points_m: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return of points (N, 3) their distance from the axis, their height above the ring's top there, and their sector (N,)."""
        distance_m, sector = _polar(points_m, self.centre_m)
        return distance_m, points_m[:, 2] - self.top_m[sector], sector


def rim_rings(cloud: Cloud) -> list[Ring]:
    """Return what looks like the ring of an opening, the best first.

    Edges of a base look like rims to local features, too, and so may a whole thin wall. A rim goes round most of an opening;
    nothing closes it; and no wall goes on above, or it comes after those of which this holds. Where no piece is a large one, all
    together may be.
    """
    pieces = [
        cloud.points_m[rows] for rows in components(cloud, cloud.parts[:, 1]) if len(rows) >= LEAST_POINTS
    ]
    rings = _open_rings(pieces, cloud)
    least_m = LUG * np.ptp(cloud.points_m, axis=0).max()
    if len(pieces) > 1 and not any(ring.size_m > least_m and is_edge(ring, cloud) for ring in rings):
        rings += [ring for ring in _open_rings([np.concatenate(pieces)], cloud) if ring.goes_round]
    return sorted(rings, key=lambda ring: (is_edge(ring, cloud), ring.coverage * ring.size_m), reverse=True)


def is_edge(ring: Ring, cloud: Cloud) -> bool:
    """Return whether the object ends with a ring that goes round: no wall goes on above it."""
    if not ring.goes_round:
        return False
    distance_m, above_m, sector = ring.seen(cloud.points_m)
    size_m = ring.size_m
    beside = np.abs(distance_m - ring.radius_m[sector]) < BAND * size_m
    goes_on = beside & (above_m > BAND * size_m) & (above_m < 2 * BAND * size_m)
    return len(np.unique(sector[goes_on])) < (1.0 - LEAST_FREE) * SECTORS


def _open_rings(pieces: list[np.ndarray], cloud: Cloud) -> list[Ring]:
    middle_m = cloud.points_m[cloud.parts[:, 0], :2].mean(axis=0)
    return [ring for piece in pieces if not _is_closed(ring := _ring(piece, middle_m), cloud)]


def _polar(points_m: np.ndarray, centre_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return of points (N, 3) the distance (N,) from the vertical through (2,), metres, and the sector (N,), 0 to `SECTORS` - 1."""
    offset = points_m[:, :2] - centre_m
    turn = np.arctan2(offset[:, 1], offset[:, 0]) / (2 * np.pi) + 0.5
    return np.linalg.norm(offset, axis=1), np.minimum((turn * SECTORS).astype(int), SECTORS - 1)


def _ring(piece_m: np.ndarray, middle_m: np.ndarray) -> Ring:
    """Return the ring on top of a piece of points (N, 3) of a container with its middle at (2,); the piece, where that has none."""
    own = _about(piece_m, piece_m[:, :2].mean(axis=0))
    ring = own if own.goes_round else _about(piece_m, middle_m)  # a handle may be more of it than the rim
    for left in reversed(range(CENTRINGS + 1)):
        on_m = piece_m[_is_on(ring, piece_m)]
        if not ring.goes_round or len(on_m) < LEAST_POINTS:
            return own
        if left:
            ring = _about(piece_m, on_m[:, :2].mean(axis=0))
    level = _about(on_m, ring.centre_m)
    return replace(ring, points_m=on_m, radius_m=level.radius_m, coverage=level.coverage)


def _is_on(ring: Ring, points_m: np.ndarray) -> np.ndarray:
    """Return which points (N,) are on a ring: not below it, not on what bridges the opening, not on what sticks out of it."""
    distance_m, above_m, sector = ring.seen(points_m)
    out_m = STICKS_OUT * _beside(ring.radius_m)[sector]
    level = (above_m < BRIDGE * ring.size_m) & (above_m > -DEPTH * ring.size_m)
    return level & (distance_m > INNER * ring.size_m) & (distance_m < out_m)


def _about(points_m: np.ndarray, centre_m: np.ndarray) -> Ring:
    """Return the ring of all of points (N, 3), metres, about the vertical through (2,): their top in each sector."""
    distance_m, sector = _polar(points_m, centre_m)
    outer = distance_m >= INNER * np.median(distance_m)  # all of a line, the vertical itself
    top_m, radius_m = np.full((2, SECTORS), np.nan)
    for i in np.unique(sector[outer]):
        here = np.flatnonzero(outer & (sector == i))
        high = here[points_m[here, 2].argmax()]
        top_m[i], radius_m[i] = points_m[high, 2], distance_m[high]
    coverage = float(np.isfinite(top_m).mean())
    top_m = _filled(top_m)
    bridged = top_m > _beside(top_m) + BRIDGE * np.nanmedian(radius_m)
    top_m = _filled(np.where(bridged, np.nan, top_m))
    return Ring(points_m, centre_m, top_m, _filled(radius_m), coverage)


def _beside(values: np.ndarray) -> np.ndarray:
    """Return the median of a quarter turn about each of values round a turn."""
    return ndimage.median_filter(values, SECTORS // 4, mode="wrap")


def _filled(values: np.ndarray) -> np.ndarray:
    """Return values round a turn with those that are nan between their neighbours'."""
    known = np.flatnonzero(np.isfinite(values))
    return np.interp(np.arange(len(values)), known, values[known], period=len(values))


def _is_closed(ring: Ring, cloud: Cloud) -> bool:
    """Return whether a surface goes across a ring, as across a base's edge, or something through it rises far above."""
    distance_m, above_m, _ = ring.seen(cloud.points_m)
    size_m = ring.size_m
    within = distance_m < INNER * size_m
    if not ring.goes_round:
        level_m = cloud.points_m[:, 2] - ring.points_m[:, 2].mean()
        return bool((within & (np.abs(level_m) < BAND * size_m)).any())
    across = within & (np.abs(above_m) < BAND * size_m)
    flat_m2 = np.sum(cloud.area_m2[across] * np.abs(cloud.normals[across, 2]))
    rises = across.any() and above_m[within].max() > THROUGH * size_m
    return bool(rises or flat_m2 > SURFACE * np.pi * (INNER * size_m) ** 2)
