"""Which way an upright object faces: to its handle, away from its spout, to a corner; or, when it is round, anywhere."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from pipeline.warp.clouds import Cloud
from pipeline.warp.components import components

HANDLE_MIN_SHARE = 0.02
# Shares of a handle's points that are labelled so, and that face the body from outside; how far off it, of the body's radius.
LEAST_LABELLED, FACES_BODY, GAP = 0.3, 0.05, 0.05
LONG = 1.5  # what reaches so many radii of the body out, where that is widest below the rim, is no spout of a rim
WAY = np.linspace(0.15, 0.9, 26)  # shares of the way from a handle to the axis; its own wall comes before
ALIKE = 0.8  # a second handle counts as large as the first from here on
SECTORS, ROUND_SHARE, REPEATS = 72, 0.015, 0.9


@dataclass(frozen=True)
class Roll:
    """The second axis (3,), a horizontal unit vector, and what told it.

    `symmetry`: 1 where one direction is right, m where m are, equally spaced, and 0 on a round object, where any is.
    """

    axis: np.ndarray
    symmetry: int
    handles: int


def roll(cloud: Cloud, origin_m: np.ndarray, ring_m: np.ndarray) -> Roll:
    """Return the roll of a container about the vertical through its middle (3,), with a rim ring (M, 3).

    Where several directions are equally right, the one nearest to the skewness of its own points is taken: however its cloud
    is turned, it is met in the same way.
    """
    skew_rad = _skew_azimuth(cloud.points_m)
    found = _handles(cloud, origin_m, ring_m)
    if found:
        alike = [rows for rows in found if len(rows) >= ALIKE * len(found[0])]
        towards = [_horizontal(cloud.points_m[rows].mean(axis=0) - origin_m) for rows in alike]
        skew = _unit_vector(skew_rad)
        return Roll(max(towards, key=lambda axis: axis @ skew), 1, len(found))
    azimuth_rad, symmetry = outline(ring_m, skew_rad)
    return Roll(_unit_vector(azimuth_rad), symmetry, 0)


def _skew_azimuth(points_m: np.ndarray) -> float:
    """Return the azimuth (rad) of the skewness of points (N, 3) across the vertical: on a round object, of chance alone."""
    flat = points_m[:, :2] - points_m[:, :2].mean(axis=0)
    skewness = (flat**2).sum(axis=1) @ flat
    return float(np.arctan2(skewness[1], skewness[0]))


def _unit_vector(azimuth_rad: float) -> np.ndarray:
    return np.array([np.cos(azimuth_rad), np.sin(azimuth_rad), 0.0])


def _horizontal(vector: np.ndarray) -> np.ndarray:
    flat = vector * [1.0, 1.0, 0.0]
    return flat / np.linalg.norm(flat)


def _handles(cloud: Cloud, origin_m: np.ndarray, ring_m: np.ndarray) -> list[np.ndarray]:
    """Return the rows of each handle, that with most points first.

    A candidate stands off the body, and looks like a handle in part. A spout may do both; but it reaches the rim, nothing of it
    faces the body from outside, and it is short.
    """
    if not cloud.parts[:, 2].any():
        return []
    off, outward, body_m = standing_off(cloud, origin_m)
    low_m = rim_low_m(ring_m)
    size_m = body_m[cloud.points_m[:, 2] <= low_m].max()
    found = []
    for rows in components(cloud, off):
        alike = rows[cloud.parts[rows, 2]]
        if len(rows) < HANDLE_MIN_SHARE * len(off) or len(alike) < LEAST_LABELLED * len(rows):
            continue
        loops = np.mean(outside_wall(cloud, rows, origin_m, outward)) > FACES_BODY
        below = np.mean(cloud.points_m[rows, 2] >= low_m) < FACES_BODY
        reach_m = np.linalg.norm((cloud.points_m[rows] - origin_m)[:, :2], axis=1).max()
        if loops or below or reach_m > LONG * size_m:
            found.append(alike)
    return sorted(found, key=len, reverse=True)


def rim_low_m(ring_m: np.ndarray) -> float:
    """Return how high a rim's ring (M, 3) begins, but for one point in fifty."""
    return float(np.quantile(ring_m[:, 2], 0.02))


def standing_off(cloud: Cloud, origin_m: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which points (N,) lie outside the body about the vertical through its middle (3,), as a handle's do; how much each
    faces away from that (N,), the cosine; and how wide the body is at the height of each (N,), its radius in metres.
    """
    radial = (cloud.points_m - origin_m)[:, :2]
    radius_m = np.linalg.norm(radial, axis=1)
    outward = np.einsum("nc,nc->n", radial, cloud.normals[:, :2]) / np.maximum(radius_m, 1e-9)
    body_m = _body_radius(cloud.points_m[:, 2], radius_m, outward > 0.5)
    return radius_m > (1.0 + GAP) * body_m, outward, body_m


def _body_radius(height_m: np.ndarray, radius_m: np.ndarray, outside: np.ndarray) -> np.ndarray:
    """Return the body's outer radius (N,) at the height of each point: the median of its outside in twenty slices."""
    edges = np.linspace(height_m.min(), height_m.max(), 21)
    part = np.clip(np.searchsorted(edges, height_m) - 1, 0, 19)
    medians = [
        np.median(radius_m[here]) if (here := (part == i) & outside).any() else np.nan for i in range(20)
    ]
    known = np.flatnonzero(np.isfinite(medians))
    return np.interp(part, known, np.array(medians)[known])


def outside_wall(cloud: Cloud, rows: np.ndarray, origin_m: np.ndarray, outward: np.ndarray) -> np.ndarray:
    """Return which points of a candidate (N,) face the axis and have an outer wall of something else on their way to it."""
    wall = np.setdiff1d(np.flatnonzero(outward > 0.5), rows)
    if not len(wall):
        return np.zeros(len(rows), dtype=bool)
    start_m = cloud.points_m[rows]
    to_axis_m = (origin_m - start_m) * [1.0, 1.0, 0.0]
    way_m = start_m[:, None] + WAY[:, None] * to_axis_m[:, None]
    reach_m = 1.5 * np.sqrt(np.median(cloud.area_m2))
    distance_m, _ = cKDTree(cloud.points_m[wall]).query(way_m, distance_upper_bound=reach_m)
    return (outward[rows] < -0.5) & np.isfinite(distance_m).any(axis=1)


def outline(ring_m: np.ndarray, skew_rad: float) -> tuple[float, int]:
    """Return the azimuth (rad) and the symmetry of a rim seen from above: points (M, 3).

    The azimuth is that of the corner nearest to `skew_rad`; of a single bulge, a spout, that of the opposite side, where
    handles are; and on a round rim `skew_rad` itself.
    """
    offset = ring_m[:, :2] - _middle(ring_m[:, :2])
    azimuth = (np.arctan2(offset[:, 1], offset[:, 0]) - skew_rad) % (2 * np.pi)
    centres = (np.arange(SECTORS) + 0.5) * 2 * np.pi / SECTORS
    sector = np.minimum((azimuth / (2 * np.pi) * SECTORS).astype(int), SECTORS - 1)
    count = np.bincount(sector, minlength=SECTORS)
    mean_m = np.bincount(sector, np.linalg.norm(offset, axis=1), SECTORS) / np.maximum(count, 1)
    profile = np.interp(centres, centres[count > 0], mean_m[count > 0], period=2 * np.pi)
    profile = np.mean([np.roll(profile, shift) for shift in (-1, 0, 1)], axis=0) / np.median(profile) - 1.0
    if np.std(profile) < ROUND_SHARE:
        return skew_rad, 0
    repeats = [m for m in (4, 3, 2) if np.corrcoef(profile, np.roll(profile, SECTORS // m))[0, 1] > REPEATS]
    symmetry = repeats[0] if repeats else 1
    excess = np.maximum(profile, 0.0)
    phase = np.angle(np.sum(excess * np.exp(1j * symmetry * centres))) / symmetry
    if symmetry == 1:
        return float(skew_rad + phase + np.pi), 1
    turns = phase + 2 * np.pi * np.arange(symmetry) / symmetry
    return float(skew_rad + turns[np.argmax(np.cos(turns))]), symmetry


def _middle(ring_m: np.ndarray) -> np.ndarray:
    """Return the centre (2,) of the circle that most points (M, 2) lie on: Kåsa's fit, reweighted for least absolute distances."""
    mean_m = ring_m.mean(axis=0)
    x = ring_m - mean_m
    size_m = float(x.std())
    x = x / size_m
    design, right = np.column_stack([2.0 * x, np.ones(len(x))]), (x**2).sum(axis=1)
    weight = np.ones(len(x))
    for _ in range(20):
        root = np.sqrt(weight)[:, None]
        solved = np.linalg.lstsq(design * root, right * root[:, 0])[0]
        weight = 1.0 / np.maximum(np.abs(design @ solved - right), 0.02)
    return mean_m + size_m * solved[:2]
