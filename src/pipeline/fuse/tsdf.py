"""Depth images to one closed surface: a truncated signed distance, its surface, and a refinement of what comes out."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from pipeline.errors import PipelineError
from pipeline.fuse import measuring
from pipeline.fuse.completion import completed
from pipeline.fuse.layouts import Views
from pipeline.fuse.planes import Planes, planes
from pipeline.fuse.refinement import refined
from pipeline.fuse.table import Placement
from pipeline.fuse.walls import evened, parted
from pipeline.fuse.wrapping import Field

BLOCK = 8  # voxels; the box is whole blocks: a margin, and what Open3D's grid in benchmarks/fusion.py takes
# The table's own surface, fused, stays below this height: what is lower counts as table.
TABLE_M = 0.0006
# Beyond the sensor's noise a longer truncation only makes floor and walls speak of each other (docs/fusion.md).
LARGEST_TRUNCATION_M = 0.004
# The field is shifted by so much, so that noise tears no holes into walls of a millimetre; the refinement takes it back.
EXCESS_VOXELS = 0.8
EXCESS_RAMP_M = 0.003
LEAST_VOTES, PRIOR_VOTES, UNSEEN_VOTE = 0.2, 0.5, 0.1
LEAST_WEIGHT = 0.3  # of the cosines under which pixels saw a vertex, for it to count as seen: one view at 70°
# Up to this height a torn foot is closed by the table. Open below by less than `LEAST_DRAIN_M2` are corners.
FOOT_M, LEAST_DRAIN_M2 = 0.004, 0.0001
_AROUND = 2  # voxels around one, to which its value is drawn


@dataclass(frozen=True)
class Surface:
    """A closed surface, object frame: vertices_m (V, 3), triangles (F, 3) oriented outwards.

    seen (V,): by a camera, not closed by us. inner (V,): at the cavity, which is every place walled in on its level.
    table_closed_m2: area of the cavity's floor that is the table. thickened_share: of the outside, where the wall was too thin.
    open_below_m: the height below which the cavity is open to the side, or None where it is closed.
    """

    vertices_m: np.ndarray
    triangles: np.ndarray
    seen: np.ndarray
    inner: np.ndarray
    table_closed_m2: float = 0.0
    thickened_share: float = 0.0
    open_below_m: float | None = None


def fuse(
    views: Views,
    placement: Placement,
    voxel_m: float,
    truncation_m: float,
    name: str,
    seen_by: Planes | None = None,
) -> Surface:
    """Fuse the views (Curless & Levoy 1996) in the object frame into a closed surface that stands on z = 0.

    Space that no camera saw free counts as solid, down to the table: this closes the underside, the inside of the wall and what
    is merely unseen of the cavity's floor. The two sides of a wall are measured apart, so that the truncation may exceed its
    thickness. seen_by: the planes of what the views measure, where they are known.
    """
    if not 0 < voxel_m <= truncation_m / 2:
        raise PipelineError(
            f"--truncation-m: expected at least two voxels of {voxel_m} m, found {truncation_m}; set fuse.truncation_m"
        )
    truncation_m = min(truncation_m, max(LARGEST_TRUNCATION_M, 2 * voxel_m))
    lowest, covered = _box(placement, voxel_m)
    seen_by = seen_by or planes(views, placement)
    value, measured = _field(seen_by, placement.points_m, lowest, covered, voxel_m, truncation_m)
    heights_m = (lowest[2] + np.arange(value.shape[2])) * voxel_m
    value -= np.float32(_excess_m(heights_m, voxel_m) / truncation_m)
    walled_in, outside = enclosed(value > 0)
    without_shadow = completed(value, measured, walled_in, voxel_m, truncation_m)
    if without_shadow is not None:
        value, (walled_in, outside) = without_shadow, enclosed(without_shadow > 0)
    floor = _table_layers(voxel_m) - lowest[2]
    closed, open_from = closed_by_table(walled_in, outside, floor, voxel_m)
    value[closed] = -1.0
    table_closed_m2 = float(closed.any(axis=2).sum()) * voxel_m**2
    open_below_m = None if open_from is None else float((open_from + lowest[2]) * voxel_m)
    vertices, triangles = _marched(
        value * truncation_m, lowest, voxel_m, f"{name}: expected a surface from {len(views.depths_m)} views"
    )
    base = vertices[:, 2] < _table_layers(voxel_m) * voxel_m
    vertices[base, 2] = 0.0
    inner = touches(vertices, ~base, walled_in, lowest, voxel_m)
    vertices, weight = refined(vertices, triangles, base, _excess_m(vertices[:, 2], voxel_m), seen_by)
    seen = (weight > LEAST_WEIGHT) & ~base
    if without_shadow is not None:
        vertices = evened(vertices, triangles, inner, ~inner & ~base, seen)
    vertices, thickened = parted(vertices, triangles, inner, ~inner & ~base)
    return Surface(vertices, triangles, seen, inner, table_closed_m2, thickened, open_below_m)


def _excess_m(heights_m: np.ndarray, voxel_m: float) -> np.ndarray:
    """Return how much too thick the surface is made at these heights: not on the table, which would grow onto the object."""
    layer_m = _table_layers(voxel_m) * voxel_m
    return EXCESS_VOXELS * voxel_m * np.clip((heights_m - layer_m) / EXCESS_RAMP_M, 0.0, 1.0)


def _field(
    seen_by: Planes,
    points_m: np.ndarray,
    lowest: np.ndarray,
    covered: np.ndarray,
    voxel_m: float,
    truncation_m: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the signed distance (nx, ny, nz) in truncations: unseen voxels are solid, beyond footprint, top and table is free.

    And which voxels were seen.
    """
    near = _near(points_m, lowest, covered, truncation_m, voxel_m)
    arrays = seen_by.plane, seen_by.view, seen_by.projection
    columns = np.argwhere(covered.any(axis=2))
    columns = columns[np.lexsort((columns // BLOCK).T)]
    layers = ndimage.binary_dilation(covered.any(axis=(0, 1)), iterations=_AROUND)
    value, weight = measuring.signed_distances(lowest, voxel_m, columns, layers, near, *arrays, truncation_m)
    value = regularised(value, weight)
    value[~covered] = 1.0
    return value, weight > 0


def _box(placement: Placement, voxel_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the first voxel's coordinates (3,) and which voxels (nx, ny, nz) are above the table and the footprint.

    Whole blocks: one layer of them is below the table.
    """
    edge = voxel_m * BLOCK
    low = np.floor(placement.bounds_m[0] / edge).astype(int) - [0, 0, 1]
    high = np.floor(placement.bounds_m[1] / edge).astype(int) + 1
    x, y, z = (np.arange(a * BLOCK, b * BLOCK) for a, b in zip(low, high, strict=True))
    footprint = placement.covers(*np.meshgrid(x * voxel_m, y * voxel_m, indexing="ij"))
    # A surface that reached the border would be open there.
    footprint[[0, -1]] = footprint[:, [0, -1]] = False
    within = (z >= _table_layers(voxel_m)) & (z * voxel_m <= placement.bounds_m[1, 2])
    within[-1] = False
    return low * BLOCK, footprint[..., None] & within


def _near(
    points_m: np.ndarray, lowest: np.ndarray, covered: np.ndarray, truncation_m: float, voxel_m: float
) -> np.ndarray:
    """Return which voxels (nx, ny, nz) are in or next to a cell, as large as the truncation, that holds a measured point."""
    size = max(2, int(np.ceil(truncation_m / voxel_m)))
    cells = np.floor(points_m / (voxel_m * size) - lowest / size).astype(int)
    held = np.zeros(np.ceil(np.array(covered.shape) / size).astype(int), bool)
    held[tuple(cells[((cells >= 0) & (cells < held.shape)).all(axis=1)].T)] = True
    held = ndimage.binary_dilation(held, np.ones((3, 3, 3)))
    for axis, n in enumerate(covered.shape):
        held = np.take(held.repeat(size, axis=axis), np.arange(n), axis=axis)
    return held & covered


def _marched(
    distance_m: np.ndarray, lowest: np.ndarray, voxel_m: float, expected: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest surface where the distances (nx, ny, nz) change their sign."""
    vertices, triangles = Field(-distance_m, lowest * voxel_m, voxel_m).surface()
    if len(triangles) == 0:
        raise PipelineError(f"{expected}, found none; check poses and units")
    return largest_component(vertices, triangles)


def _table_layers(voxel_m: float) -> int:
    return int(np.ceil(TABLE_M / voxel_m))


def regularised(value: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return the values (nx, ny, nz) drawn to their neighbourhood where measured rarely; unseen voxels are solid.

    Normalised convolution (Knutsson & Westin 1993): the mean around a voxel, in which a measured voxel counts once and an
    unseen one `UNSEEN_VOTE` as solid, counts as `PRIOR_VOTES` measurements. Without it a few wrong depths leave bubbles inside the
    walls.
    """

    def around(field: np.ndarray) -> np.ndarray:
        return ndimage.gaussian_filter(field.astype(np.float32), 1.0, radius=_AROUND, mode="constant")

    measured = weight > 0
    mean = around(np.where(measured, value, -UNSEEN_VOTE)) / around(np.where(measured, 1.0, UNSEEN_VOTE))
    drawn = (weight * value + PRIOR_VOTES * mean) / (weight + PRIOR_VOTES)
    return np.where(around(weight) >= LEAST_VOTES, drawn, -1.0)


def enclosed(free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest room of free voxels (nx, ny, nz) walled in on their level, and those with a way to the border in a layer.

    A pinhole in the wall is no way: ways are at least three voxels wide.
    """
    level = np.zeros((3, 3, 3), bool)
    level[:, :, 1] = ndimage.generate_binary_structure(2, 1)
    labels, count = ndimage.label(ndimage.binary_erosion(free, level, border_value=1), level)
    is_outside = np.zeros(count + 1, bool)
    for side in (labels[0], labels[-1], labels[:, 0], labels[:, -1]):
        is_outside[side.ravel()] = True
    is_inside = ~is_outside
    is_inside[0] = is_outside[0] = False
    rooms, count = ndimage.label(is_inside[labels])
    if count == 0:
        return np.zeros_like(free), is_outside[labels]
    largest = np.bincount(rooms.ravel())[1:].argmax() + 1
    return ndimage.binary_dilation(rooms == largest, level) & free, is_outside[labels]


def closed_by_table(
    walled_in: np.ndarray, outside: np.ndarray, floor: int, voxel_m: float
) -> tuple[np.ndarray, int | None]:
    """Return the voxels (nx, ny, nz) that become solid so that the table closes the cavity, and the layer below which it is open.

    It reaches down to the table's layer `floor`, or to a foot that noise tore, whose lowest layers let it out sideways.
    """
    closed, open_from = np.zeros_like(walled_in), None
    closed[:, :, floor] = walled_in[:, :, floor]
    for z in range(floor + 1, walled_in.shape[2]):
        drains = walled_in[:, :, z] & outside[:, :, z - 1]
        if np.count_nonzero(drains) * voxel_m**2 < LEAST_DRAIN_M2:
            continue
        if (z - floor + 1) * voxel_m > max(FOOT_M, 2 * voxel_m):
            open_from = z
        else:
            closed[:, :, floor:z] |= drains[..., None]
    return closed, open_from


def touches(
    vertices: np.ndarray, wanted: np.ndarray, walled_in: np.ndarray, lowest: np.ndarray, voxel_m: float
) -> np.ndarray:
    """Return which wanted vertices (V,) lie within a voxel of the places (nx, ny, nz) that are walled in."""
    place = np.rint(vertices / voxel_m).astype(int) - lowest
    near = ndimage.binary_dilation(walled_in, ndimage.generate_binary_structure(3, 1))
    return wanted & near[tuple(place.T)]


def largest_component(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the connected part with the most triangles, unused vertices removed."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    edges = np.concatenate([triangles[:, :2], triangles[:, 1:]])
    shape = (len(vertices), len(vertices))
    part = connected_components(coo_matrix((np.ones(len(edges)), edges.T), shape=shape), directed=False)[1]
    triangles = triangles[part[triangles[:, 0]] == np.bincount(part[triangles[:, 0]]).argmax()]
    used = np.zeros(len(vertices), bool)
    used[triangles] = True
    return vertices[used], (np.cumsum(used) - 1)[triangles]
