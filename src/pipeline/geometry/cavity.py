"""The room for liquid in a scanned container: its inside, its rim, what it keeps when tilted.

Everything is in the object's frame: upright, z up, the underside on z = 0. The mesh may have pinholes: whether a point
is inside is decided by what encloses it and by what can be seen from there, never by the winding of triangles.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.errors import PipelineError
from pipeline.geometry.frames import apply, rotation_about
from pipeline.geometry.rim import rim_and_opening, rim_at
from pipeline.geometry.surface import Surface, subdivided

TIE_M = 0.002  # rims that are level to within this count as level
_BED = 16  # a spout's bed is looked for in heights averaged over an eighth of the turn: this share to either side
_LOWER = 3  # cells: a room that overflows so much lower than another is one of the same container
_COMPARTMENT = 0.2  # of the largest room: a smaller one is a pocket beside it
_LEAST_M3 = 5e-6  # a container that keeps less than 5 ml is none

Quadrature = tuple[np.ndarray, np.ndarray, float]


@dataclass(frozen=True)
class Cavity:
    """A container's inside, object frame, metres.

    origin_m (3,): centre of cell [0, 0, 0]. interior (nx, ny, nz): room for liquid below the rim's surface. distance_m:
    distance of cell centres to the inner surface, positive in the open, negative beyond the wall (one-sided: the outer
    surface does not count). rim_m (M, 3): the lip's highest edge, by azimuth about the opening, M even steps.
    opening_m (3,): mean of the rim. capacity_m3: room below the rim's lowest point, upright.
    """

    origin_m: np.ndarray
    cell_m: float
    interior: np.ndarray
    distance_m: np.ndarray
    rim_m: np.ndarray
    opening_m: np.ndarray
    capacity_m3: float

    @cached_property
    def opening_radius_m(self) -> float:
        """The mean distance of the rim's points to their mean, the paper's radius (Section II-D)."""
        return float(np.linalg.norm(self.rim_m - self.opening_m, axis=1).mean())

    def rim_at(self, x_m: np.ndarray, y_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the rim's horizontal distance from the opening and its height in the direction of (x, y)."""
        return rim_at(self.rim_m, self.opening_m, x_m, y_m)


def cavity(vertices_m: np.ndarray, triangles: np.ndarray, *, name: str, cell_m: float = 0.002) -> Cavity:
    """Find the cavity of a container's mesh: vertices (V, 3) in metres, object frame, and triangles (F, 3).

    A `PipelineError` names the object when it cannot hold liquid (a plate, a closed block, a hole in the floor).
    """
    if len(triangles) == 0:
        raise PipelineError(f"{name}: expected a mesh with faces, found none; scan the object again")
    vertices_m, triangles = subdivided(np.asarray(vertices_m, float), np.asarray(triangles), 3 * cell_m)
    surface = Surface(vertices_m, triangles)
    axes = _axes(vertices_m, cell_m)
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    free = surface.free_on_grid(centres, cell_m)
    pool, level = _pool(free, cell_m, name)
    rim, opening = rim_and_opening(surface, axes, pool, level, vertices_m[:, 2].max(), cell_m, name)
    level_m = axes[2][level]
    if rim[:, 2].min() - level_m > 3 * cell_m:
        raise PipelineError(
            f"{name}: expected a wall without holes below its rim ({rim[:, 2].min() * 1e3:.0f} mm), "
            f"found that liquid escapes at {level_m * 1e3:.0f} mm; close the hole or exclude the object"
        )
    core, below = _core(free, pool, centres, rim, opening, cell_m, name)
    interior, distance = _inside(surface, vertices_m, triangles, centres, core, below, cell_m)
    volume = _room(distance, interior, rim, opening, tuple(np.moveaxis(centres, -1, 0)), cell_m)
    capacity = float((volume * _share_below(rim[:, 2].min() - axes[2], cell_m)).sum() * cell_m**3)
    origin = centres[0, 0, 0].copy()
    return Cavity(origin, cell_m, interior, distance.astype(np.float32), rim, opening, capacity)


def lip_alone(cup: Cavity) -> np.ndarray:
    """Return the lip (3,) of a cup alone: the rim's lowest point, of a level rim that furthest along +x."""
    return lowest_point(cup.rim_m)


def spout_depth(contour_m: np.ndarray) -> float:
    """Return how far the lowest point of a contour (M, 3) is below its median height, metres."""
    return float(np.median(contour_m[:, 2]) - contour_m[:, 2].min())


def lowest_point(contour_m: np.ndarray) -> np.ndarray:
    """Return the lowest point (3,) of a rim's contour (M, 3), in its order round.

    A level rim has none: where nothing is more than 2 mm below the median height, it is the point furthest along +x of those
    within 2 mm of the lowest. A spout's is the middle of its bed, which turns with the object.
    """
    height = contour_m[:, 2]
    if spout_depth(contour_m) <= TIE_M:
        return contour_m[np.argmax(np.where(height <= height.min() + TIE_M, contour_m[:, 0], -np.inf))].copy()
    reach = len(contour_m) // _BED
    bed = np.mean([np.roll(height, shift) for shift in range(-reach, reach + 1)], axis=0)
    return contour_m[np.argmin(bed)].copy()


def lip_towards(cup: Cavity, T_world_held: np.ndarray, point_world: np.ndarray) -> np.ndarray:
    """Return the lip (3,), object frame, of a held cup: the rim point nearest to a point (3,) of the world."""
    return cup.rim_m[np.argmin(np.linalg.norm(apply(T_world_held, cup.rim_m) - point_world, axis=1))].copy()


def pour_axis(opening: np.ndarray, lip: np.ndarray) -> np.ndarray:
    """Return the horizontal unit axis (3,) about which a right-handed rotation tilts the lip (3,) downwards."""
    out = np.array([lip[0] - opening[0], lip[1] - opening[1], 0.0])
    out /= np.linalg.norm(out)
    return np.array([-out[1], out[0], 0.0])


def retained_volume_m3(
    cup: Cavity,
    lip_m: np.ndarray,
    axis: np.ndarray,
    tilt_rad: np.ndarray | float,
    blocks: Quadrature | None = None,
) -> np.ndarray:
    """Return what hydrostatics leaves in a brimful cup after a slow tilt about `axis` through the lip, m³.

    The surface is level with the rim's lowest point. Tilts of any shape; what is lost on the way stays lost, so the
    result never grows with the tilt. The lip itself is where the axis passes and does not change volumes. Who asks often
    hands over the cup's `quadrature`.
    """
    tilts = np.asarray(tilt_rad, float)
    steps = np.linspace(
        0.0, max(float(tilts.max(initial=0.0)), 1e-3), max(2, int(tilts.max(initial=0.0) / 0.035) + 2)
    )
    blocks = blocks or quadrature(cup)
    kept = [under_rim_m3(cup, axis, t, blocks) for t in steps]
    return np.interp(tilts, steps, np.minimum.accumulate(kept))


def under_rim_m3(cup: Cavity, axis: np.ndarray, tilt_rad: float, blocks: Quadrature) -> float:
    """Return the room below a surface that is level with the rim's lowest point, tilted about `axis`, m³."""
    points, volumes, cell = blocks
    up = rotation_about(axis, tilt_rad)[2]
    return float(volumes @ _share_below((cup.rim_m @ up).min() - points @ up, cell))


def room_m3(cup: Cavity) -> np.ndarray:
    """Return the volume (nx, ny, nz) of each cell that is room for liquid below the rim's surface."""
    return (
        _room(cup.distance_m, cup.interior, cup.rim_m, cup.opening_m, _grids(cup), cup.cell_m) * cup.cell_m**3
    )


def _grids(cup: Cavity) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    x, y, z = (o + cup.cell_m * np.arange(n) for o, n in zip(cup.origin_m, cup.interior.shape, strict=True))
    return tuple(np.meshgrid(x, y, z, indexing="ij"))


def quadrature(cup: Cavity) -> Quadrature:
    """Return points (N, 3), volumes (N,) and edge of blocks of 2×2×2 cells: enough for a tilted surface."""
    room = room_m3(cup)
    room = np.pad(room, [(0, n % 2) for n in room.shape])
    blocks = tuple(n // 2 for n in room.shape)
    volumes = room.reshape(blocks[0], 2, blocks[1], 2, blocks[2], 2).sum(axis=(1, 3, 5))
    index = np.argwhere(volumes > 0)
    points = cup.origin_m + cup.cell_m * (2 * index + 0.5)
    return points, volumes[tuple(index.T)], 2 * cup.cell_m


def _share_below(depth: np.ndarray, cell: float) -> np.ndarray:
    """Return the share (0 to 1) of a cell that is under a plane `depth` above its centre."""
    return np.clip(0.5 + depth / cell, 0.0, 1.0)


def _room(
    distance: np.ndarray, interior: np.ndarray, rim: np.ndarray, opening: np.ndarray, xyz: tuple, cell: float
) -> np.ndarray:
    """Return the share of each cell that is room; half-open cells at wall and rim make it better than the grid."""
    x, y, z = xyz
    radius, height = (a[..., None] for a in rim_at(rim, opening, x[..., 0], y[..., 0]))
    wall = np.where(interior | ((np.abs(distance) < cell) & (z < height)), _share_below(distance, cell), 0.0)
    rim_layer = (z >= height) & (z < height + cell / 2)
    edge = _share_below(radius - np.hypot(x - opening[0], y - opening[1]), cell)
    return np.where(rim_layer, edge, wall) * _share_below(height - z, cell)


def _axes(vertices: np.ndarray, cell: float) -> list[np.ndarray]:
    low = np.floor(vertices.min(axis=0) / cell) - 4
    high = np.ceil(vertices.max(axis=0) / cell) + 4
    return [cell * np.arange(a, b + 1) for a, b in zip(low, high, strict=True)]


def _pool(free: np.ndarray, cell: float, name: str) -> tuple[np.ndarray, int]:
    """Return the rooms that the object encloses below some level, and that level's layer: the highest such.

    Rooms that overflow a little lower count as well: a divider that is as high as the rim makes two of one.
    """
    from scipy import ndimage

    labels, _ = ndimage.label(free)
    air = labels == labels[0, 0, 0]
    pool, level, largest = np.zeros_like(free), 0, 0
    for layer in range(free.shape[2] - 1, 0, -1):
        labels, count = ndimage.label(air[:, :, : layer + 1])
        sizes = np.bincount(labels.ravel(), minlength=count + 1)
        sizes[[0, labels[0, 0, 0]]] = 0
        largest = max(largest, int(sizes.max()))
        holds = sizes * cell**3 >= max(_LEAST_M3, _COMPARTMENT * sizes.max() * cell**3)
        level = level or layer * bool(holds.any())
        pool[:, :, : layer + 1] |= holds[labels]
        if layer == level - _LOWER:
            break
    if level:
        return pool, level
    raise PipelineError(
        f"{name}: expected an object that holds liquid, found room for {largest * cell**3 * 1e6:.1f} ml at any level "
        "(a plate, a closed block, or a hole in its floor); mend the scan or put the object in objects.exclude"
    )


def _core(
    free: np.ndarray,
    pool: np.ndarray,
    centres: np.ndarray,
    rim: np.ndarray,
    opening: np.ndarray,
    cell: float,
    name: str,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the cells well inside the cavity (a cell or more from its wall) and those below the rim's surface."""
    from scipy import ndimage

    x, y, z = np.moveaxis(centres, -1, 0)
    radius, height = rim_at(rim, opening, x[:, :, 0], y[:, :, 0])
    below = z < height[..., None]
    under = pool.any(axis=2)
    within = np.hypot(x - opening[0], y - opening[1]) < radius[..., None] - cell
    tube = ndimage.binary_fill_holes(under) & ~under
    within &= ~tube[..., None]
    for lowered in range(4):
        open_below = free & (z < height[..., None] - lowered * cell)
        labels, count = ndimage.label(open_below)
        found = np.bincount(labels[pool & open_below], minlength=count + 1)
        if found.any() and found.argmax() != labels[0, 0, 0]:
            found[labels[0, 0, 0]] = 0
            core = found[labels] > 0  # both sides of a divider that is a little lower than the rim
            top = z > height[..., None] - (lowered + 1) * cell
            return core | (free & below & within & top), below
    raise PipelineError(
        f"{name}: expected a wall that is closed up to its rim, found a gap just below it; "
        "mend the scan or put the object in objects.exclude"
    )


def _inside(
    surface: Surface,
    vertices: np.ndarray,
    triangles: np.ndarray,
    centres: np.ndarray,
    core: np.ndarray,
    below: np.ndarray,
    cell: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return which cells are inside and every cell's signed distance to the inner surface.

    A point near the wall is inside when it sees the nearest point well inside.
    """
    from scipy import ndimage

    gap, nearest = ndimage.distance_transform_edt(~core, return_indices=True)
    band = (gap > 0) & (gap <= 3.5) & below
    inside = core.copy()
    inside[band] = surface.sees(centres[band], centres[tuple(n[band] for n in nearest)])
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    normal *= 1e-4 / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    middle = (a + b + c) / 3
    index = tuple(np.rint((middle - centres[0, 0, 0]) / cell).astype(int).T)
    goal = centres[tuple(n[index] for n in nearest)]
    inner = (gap[index] <= 3.5) & (surface.sees(middle + normal, goal) | surface.sees(middle - normal, goal))
    distance = Surface(vertices, triangles[inner]).distance_on_grid(centres, cell)
    return inside, np.where(inside | ~below, distance, -distance)
