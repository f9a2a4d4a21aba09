"""What of a target a source has nothing like: arches over the opening, handles, spouts that are tubes, lugs. Upright."""

import numpy as np

from pipeline.warp.alignment import PartFrame, part_frame
from pipeline.warp.clouds import Cloud, subset
from pipeline.warp.components import components
from pipeline.warp.ring import INNER, SECTORS, STICKS_OUT, Ring, is_edge, rim_rings
from pipeline.warp.roll import GAP, outside_wall, standing_off

# Shares: of all points, that a piece has at least; of a turn, that it takes at most; of its own, that look into the container.
LEAST_SHARE, WIDEST, INSIDE = 0.005, 0.4, 0.1
# What comes so near to the table, with its middle within this share of the height, is a foot; a handle may reach as far down.
GROUND_M, LOW = 0.002, 0.25
# Of the ring's radius: what is higher above it may be overhead; what is further from its edge is no rim.
ABOVE, NEAR_RIM = 0.05, 0.25


def foreign(target: Cloud, source: Cloud) -> np.ndarray:
    """Return which points (M,) of a target, all of it, a source cannot have.

    What is above the opening, where nothing is above its own; what sticks out of the wall, but a handle for its own to go to.
    """
    found = np.zeros(len(target.points_m), dtype=bool)
    ring, own = rim_ring(target), rim_ring(source)
    if ring is None:
        return found
    over = _overhead(target, ring)
    if own is not None and _overhead(source, own).mean() > LEAST_SHARE:
        over[:] = False
    for _ in range(2):  # what is foreign draws the container's middle to itself: once with it, once without
        frame = part_frame(subset(target, ~found))
        found = over.copy()
        for rows in _sticking_out(target, ring, frame.T_object_part[:3, 3]):
            found[rows] |= not (source.parts[:, 2].any() and _is_handle(target, rows, frame))
        if not found.any():
            break
    return found


def _is_handle(cloud: Cloud, rows: np.ndarray, frame: PartFrame) -> bool:
    """Return whether a piece is where a part frame has a handle, if it has one."""
    towards = cloud.points_m[rows].mean(axis=0) - frame.T_object_part[:3, 3]
    ahead = towards @ frame.T_object_part[:3, 1]
    return bool(frame.handles) and bool(ahead > np.cos(np.pi / 4) * np.linalg.norm(towards[:2]))


def rim_ring(cloud: Cloud) -> Ring | None:
    """Return the ring of a cloud's opening, if there is one on top of its wall."""
    rings = rim_rings(cloud)
    return rings[0] if rings and is_edge(rings[0], cloud) else None


def near_rim(points_m: np.ndarray, ring: Ring | None) -> np.ndarray:
    """Return which points (N,) of (N, 3), object frame, may be of a ring's rim: all, where it is not known."""
    if ring is None:
        return np.ones(len(points_m), dtype=bool)
    distance_m, above_m, sector = ring.seen(points_m)
    return np.hypot(distance_m - ring.radius_m[sector], above_m) <= NEAR_RIM * ring.size_m


def _overhead(cloud: Cloud, ring: Ring) -> np.ndarray:
    """Return which points (N,) are above the opening, as those of an arch, a bail, or a handle that rises above the rim.

    What rises from the wall and neither reaches over the opening nor far out is a lip that is raised for pouring.
    """
    distance_m, above_m, sector = ring.seen(cloud.points_m)
    out = distance_m / ring.radius_m[sector]
    found = np.zeros(len(out), dtype=bool)
    for rows in components(cloud, above_m > ABOVE * ring.size_m):
        nearest, farthest = out[rows].min(), out[rows].max()
        found[rows] = nearest < INNER or nearest > 1.0 + GAP or farthest > STICKS_OUT
    return found


def _sticking_out(cloud: Cloud, ring: Ring, origin_m: np.ndarray) -> list[np.ndarray]:
    """Return the rows of each piece outside both the body, as round as it is there, and the rim's outline.

    A part of the wall, such as the spout of a jug, looks into the container; a foot stands on the table.
    """
    off, outward, _ = standing_off(cloud, origin_m)
    distance_m, above_m, sector = ring.seen(cloud.points_m)
    off &= distance_m > (1.0 + GAP) * ring.radius_m[sector]
    height_m = cloud.points_m[:, 2] - cloud.points_m[:, 2].min()
    low_m = LOW * (ring.points_m[:, 2].mean() - cloud.points_m[:, 2].min())
    found = []
    for rows in components(cloud, off):
        few = len(rows) < LEAST_SHARE * len(off)
        wide = len(np.unique(sector[rows])) > WIDEST * SECTORS
        foot = height_m[rows].min() < GROUND_M and height_m[rows].mean() < low_m
        if few or wide or foot:
            continue
        inside = (
            (outward[rows] < -0.5) & (above_m[rows] < 0.0) & ~outside_wall(cloud, rows, origin_m, outward)
        )
        if inside.mean() < INSIDE:
            found.append(rows)
    return found
