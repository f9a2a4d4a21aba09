"""The one object on the table: what belongs to it, where its frame is."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from pipeline.errors import PipelineError
from pipeline.fuse import agreement, table
from pipeline.fuse.raw import Views
from pipeline.fuse.table import CELL_M, CURE, Placement, Plane, Points
from pipeline.geometry import frames

ABOVE_M, ABOVE_SIGMAS, MOST_ABOVE_M = (
    0.008,
    3.0,
    0.025,
)  # points this far above the table are no noise of the table
MARGIN_M = 0.008  # around the object
LARGEST_M = 0.45
MOST_BELOW = 0.05  # of the points over the footprint may lie more than `BELOW_M` below the table
BELOW_M = 0.010
LEAST_POINTS = 300
LEAST_OF_A_VIEW = 60
LEAST_RAISED = 30  # above the base, in a single view: a steep one shows little but the rim there
# A second object: this far from the first at most, with this share of its points, in this share of the views.
SECOND_M, SECOND_POINTS, SECOND_VIEWS = 0.15, 0.15, 0.5
# A base under the object: flat, its border too, and so many times larger than what stands on it, or no higher than a thick board.
FLAT_M, FLAT_SHARE, BASE_AREAS = 0.004, 0.7, 2.0
THICK_M, ALL_FLAT_SHARE = 0.025, 0.9
LEAST_STANDING = 0.25  # of the base's height: what is lower is a lid's knob, and no object
OTHERS = 12  # views that are asked whether they look through a point
# What is nearer together is one thing; in a single view its own shadow lies between its parts.
GAP_M, SHADOW_M = 0.016, 0.12
AROUND_M = 0.15  # the table is fitted again this far around the object: depth cameras bend large planes
# A board under the object: between these heights above the table (a higher one is a platter), on so much of the table this far
# around the object, and in directions from it that leave no larger gap.
BESIDE_M, LEAST_BOARD_M, MOST_BOARD_M, BOARD_SHARE, MOST_OPEN_RAD = 0.03, 0.002, 0.012, 0.1, 0.75 * np.pi
_ASKED = 300_000  # points at most tell heights, noise, and what is below the table: every so many
_COMPARED = 5_000  # points of each of two objects
# Stray pixels hit a cell once or twice; one of the object by many views: where it faces them, so many times as often as that.
_HITS_OF_NOISE, _CLEARLY = 3, 3.0


class NoObject(PipelineError):
    """There is no object on this plane; another plane may be the table."""


@dataclass(frozen=True)
class Cluster:
    """Points that stand together on the table: their mask (N,), share of the views that see them, bounds (2, 3)."""

    mask: np.ndarray
    n: int
    views: float
    bounds_m: np.ndarray

    @property
    def centre_m(self) -> np.ndarray:
        """The middle (2,) of the footprint."""
        return self.bounds_m[:, :2].mean(axis=0)

    def shown(self, T_world_table: np.ndarray, views: Views | None) -> str:
        """Return size and place in words: where in which image it is, or in the world of a cloud without images."""
        size = " × ".join(f"{1000 * e:.0f}" for e in np.ptp(self.bounds_m, axis=0))
        place = frames.apply(T_world_table, np.array([*self.centre_m, self.bounds_m[1, 2] / 2]))
        if views is None:
            return f"one of {size} mm at ({', '.join(f'{x:.3f}' for x in place)}) m"
        x, y, z = views.intrinsics[0] @ frames.apply(frames.inverse(views.T_world_cameras[0]), place)
        return f"one of {size} mm at pixel ({x / z:.0f}, {y / z:.0f}) of {views.names[0]}"


def find(
    views: Views, name: str, rng: np.random.Generator, raised_m: float | None = None
) -> tuple[Plane, Placement]:
    """Find the table and the one object on it, near what the cameras look at; the rest is background.

    The table is the plane of most points on which something stands; raised_m: how much higher the object stands, where that is
    known. A `PipelineError` says what is missing, or shows both objects when there are two.
    """
    middle = table.focus(views)
    near = table.world_points(views, stride(views, middle), middle, table.NEAR_M)
    some = table.thinned(near.places_m, _ASKED)
    eyes = np.array([T[:3, 3] for T in views.T_world_cameras])
    failures: list[NoObject] = []
    for plane in table.planes(near.places_m, eyes, name, rng):
        try:
            first = place(some, _above(near, plane, views), plane, middle, views, name)
            if raised_m is None:
                under, up_m = _under(some, plane, first, eyes)
            else:
                under, up_m = plane.raised(raised_m), raised_m
            return under, replace(
                place(some, _above(near, under, views), under, middle, views, name), raised_m=up_m
            )
        except NoObject as failure:
            failures.append(failure)
    raise failures[0]


def stride(views: Views, focus: np.ndarray) -> int:
    """Return every how many pixels are enough to tell an object at the focus (3,) from noise: fewer where it is far away."""
    reach_m = np.median([np.linalg.norm(focus - T[:3, 3]) for T in views.T_world_cameras])
    across = CELL_M * float(np.median(views.intrinsics[:, 0, 0])) / reach_m  # pixels of a cell
    needed = _CLEARLY * _hits_of_noise(len(views.names))
    return next((s for s in range(table.STRIDE, 1, -1) if len(views.names) * (across / s) ** 2 >= needed), 1)


def _hits_of_noise(n_views: int) -> int:
    """Return how often stray pixels of so many views hit a cell at most."""
    return min(_HITS_OF_NOISE, n_views // 3)


def on_a_plane(points_m: np.ndarray, name: str, rng: np.random.Generator) -> tuple[Plane, Placement]:
    """Find the table in a cloud (N, 3) without cameras, and the object on it: on the side where most of the rest is."""
    points = Points(points_m, np.zeros(len(points_m), int))
    failure: PipelineError | None = None
    for plane in table.planes(points_m, points_m.mean(axis=0)[None], name, rng):
        height = plane.height(points_m)
        above = points.only((height > ABOVE_M) & (height < LARGEST_M))
        try:
            middle = np.median(above.places_m, axis=0) if len(above.view) else points_m[0]
            return plane, place(points_m, above, plane, middle, None, name)
        except NoObject as error:
            failure = failure or error
    raise failure or NoObject(f"{name}: expected a table under the object, found none")


def _above(points: Points, plane: Plane, views: Views) -> Points:
    """Return what rises out of the table's noise and stays where it is: no hand and no robot's arm."""
    height = plane.height(points.places_m)
    least = float(np.clip(ABOVE_SIGMAS * spread_m(height), ABOVE_M, MOST_ABOVE_M))
    above = points.only((height > least) & (height < LARGEST_M))
    return above.only(~agreement.seen_through(above.places_m, views, above.view, OTHERS))


def spread_m(height_m: np.ndarray) -> float:
    """Return the standard deviation of the table's points, from heights (N,) of all: the depth camera's noise."""
    height_m = table.thinned(height_m, _ASKED)
    table_m = height_m[np.abs(height_m) < MOST_ABOVE_M]
    return 1.4826 * float(np.median(np.abs(table_m - np.median(table_m)))) if len(table_m) else 0.0


def place(
    points_m: np.ndarray, above: Points, plane: Plane, focus: np.ndarray, views: Views | None, name: str
) -> Placement:
    """Return where the object stands on the plane: what of the points above it is nearest to the focus (3,).

    points_m (N, 3): points all around, as many as are needed to know whether some are below the plane.
    """
    T_table_world = table_frame(plane)
    places = frames.apply(T_table_world, above.places_m)
    middle = frames.apply(T_table_world, focus)[:2]
    near = np.linalg.norm(places[:, :2] - middle, axis=1) < LARGEST_M
    places = places[near]
    single = views is not None and len(views.names) == 1
    gap_m, least = (SHADOW_M, LEAST_OF_A_VIEW) if single else (GAP_M, LEAST_POINTS)
    found = _clusters(Points(places, above.view[near]), middle, gap_m) if len(places) else []
    if not found or found[0].n < least:
        raise NoObject(
            f"{name}: expected an object on the table, found {found[0].n if found else 0} points together more than "
            f"{ABOVE_M * 1e3:.0f} mm above it; {CURE} and that the object is in view"
        )
    cluster = found[0]
    _check_size(cluster, name)
    _check_alone(found, places, middle, frames.inverse(T_table_world), views, name)
    own = places[cluster.mask | _within(found, places)]
    centre = np.array([*cluster.centre_m, 0.0])
    T_object_world = frames.transform(np.eye(3), -centre) @ T_table_world
    placement = Placement(T_object_world, *_region(own - centre), own - centre)
    _check_below(placement, frames.apply(T_object_world, points_m), name)
    return placement


def _platter_m(placement: Placement, least: int) -> float | None:
    """Return the height of a flat base that the object, of so many points at least, stands on, such as a turntable's, or None.

    A base is flat from its border to what stands on it, as no saucer is, and much larger than that, or as low as a board.
    """
    z = placement.points_m[:, 2]
    shape = placement.footprint.shape
    column = np.floor((placement.points_m[:, :2] - placement.bounds_m[0, :2]) / CELL_M).astype(int)
    cell = np.ravel_multi_index(tuple(column.T), shape)
    every = np.arange(placement.footprint.size)
    top = np.maximum(ndimage.maximum(z, cell, every), 0.0).reshape(shape)
    usual = np.asarray(ndimage.median(z, cell, every)).reshape(shape)
    held = ndimage.binary_fill_holes(ndimage.binary_closing(top > 0))
    border = held & ~ndimage.binary_erosion(held, iterations=3) & (top > 0)
    height = float(np.median(top[border]))
    flat = np.abs(top - height) < FLAT_M
    above = ndimage.binary_fill_holes(top > height + ABOVE_M)
    if np.sort(z)[-10] - height < LEAST_STANDING * height:
        return None
    if np.mean(flat[border]) < FLAT_SHARE or np.count_nonzero(z > height + ABOVE_M) < least:
        return None
    off_its_side = ndimage.binary_erosion(held, iterations=2) & (top > 0)
    around = usual[off_its_side & ~ndimage.binary_dilation(above)]
    low, middle, high = np.quantile(around, [0.1, 0.5, 0.9]) if len(around) else (0.0, 0.0, 0.0)
    if high - low > FLAT_M or abs(middle - height) > FLAT_M:
        return None
    is_board = height < THICK_M and np.mean(flat[border]) > ALL_FLAT_SHARE
    if not is_board and np.count_nonzero(held) < BASE_AREAS * np.count_nonzero(above):
        return None
    return float(np.median(z[np.abs(z - height) < FLAT_M]))


def _under(points_m: np.ndarray, plane: Plane, placement: Placement, eyes: np.ndarray) -> tuple[Plane, float]:
    """Return what the object stands on, fitted to the points near it, and how much higher than the table it is.

    It is a platter, a board, or the table, which is not quite flat.
    """
    x, y, z = frames.apply(placement.T_object_world, points_m).T
    raised_m = _platter_m(placement, LEAST_POINTS if len(eyes) > 1 else LEAST_RAISED)
    if raised_m is not None:
        near = np.flatnonzero(placement.covers(x, y))
    else:
        near_table = np.flatnonzero(placement.beside(x, y, AROUND_M))
        raised_m, near = _board(x, y, z, placement) or (0.0, near_table)
    plane = plane.raised(raised_m)
    if len(near) < LEAST_POINTS:
        return plane, raised_m
    return table.refined(points_m[near], plane.normal, plane.offset_m, eyes), raised_m


def _board(
    x_m: np.ndarray, y_m: np.ndarray, z_m: np.ndarray, placement: Placement
) -> tuple[float, np.ndarray] | None:
    """Return the height of a board under the object, such as one of markers, and which points are on it (M,); or None.

    It is flat, and seen beyond the object on opposite sides: what lies beside it carries nothing.
    """
    beside = np.flatnonzero(placement.beside(x_m, y_m, BESIDE_M) & (np.abs(z_m) < MOST_BOARD_M))
    if len(beside) < LEAST_POINTS:
        return None
    height_m = table.local_heights(x_m[beside], y_m[beside], z_m[beside])
    raised = height_m > LEAST_BOARD_M
    if np.mean(raised) < BOARD_SHARE:
        return None
    top_m = float(np.median(height_m[raised]))
    on_top = np.abs(height_m - top_m) < FLAT_M / 2
    board = beside[on_top]
    far = board[~placement.beside(x_m[board], y_m[board], 0.0)]
    if np.count_nonzero(on_top) < FLAT_SHARE * np.count_nonzero(raised) or not len(far):
        return None
    angle = np.sort(np.arctan2(y_m[far], x_m[far]))
    open_rad = float(np.diff(np.append(angle, angle[0] + 2 * np.pi)).max())
    return (top_m, board) if open_rad < MOST_OPEN_RAD else None


def table_frame(plane: Plane) -> np.ndarray:
    """Return T_table_world: z up from the table, x along the world's x (or y, when that is nearly upright)."""
    along = np.eye(3)[0 if abs(plane.normal[0]) < 0.9 else 1]
    x = along - (along @ plane.normal) * plane.normal
    x /= np.linalg.norm(x)
    R = np.stack([x, np.cross(plane.normal, x), plane.normal])
    return frames.transform(R, np.array([0.0, 0.0, plane.offset_m]))


def _clusters(points: Points, middle: np.ndarray, gap_m: float) -> list[Cluster]:
    """Return what stands together, seen from above; the most likely object first, then by number of points.

    What reaches beyond the circle that was searched is background.
    """
    places, n_views = points.places_m, points.view.max() + 1
    origin = places[:, :2].min(axis=0)
    cells = np.floor((places[:, :2] - origin) / CELL_M).astype(int)
    counts = np.zeros(cells.max(axis=0) + 1, int)
    np.add.at(counts, tuple(cells.T), 1)
    hit = counts > _hits_of_noise(n_views)
    bridged = max(1, round(gap_m / CELL_M / 2))
    held = np.pad(hit, bridged + 1)
    labels, n = ndimage.label(ndimage.binary_closing(held, iterations=bridged), np.ones((3, 3)))
    label = labels[tuple(cells.T + bridged + 1)]
    seen = np.zeros((n + 1, n_views), int)
    np.add.at(seen, (label, points.view), 1)
    found = []
    for k in np.nonzero(seen.sum(axis=1) >= LEAST_OF_A_VIEW)[0]:
        mask = label == k
        own = places[mask]
        reach = np.linalg.norm(own[:, :2] - middle, axis=1)
        if k == 0 or np.mean(reach > LARGEST_M - 2 * CELL_M) > 0.01:
            continue
        tall = np.sort(own[:, 2])[-10]
        bounds = np.array([[*own.min(axis=0)[:2], 0.0], [*own.max(axis=0)[:2], tall]])
        found.append(Cluster(mask, int(mask.sum()), float((seen[k] >= 10).mean()), bounds))
    return sorted(
        found, key=lambda c: -c.n * c.views * np.exp(-((np.linalg.norm(c.centre_m - middle) / 0.15) ** 2))
    )


def _check_size(cluster: Cluster, name: str) -> None:
    size = np.ptp(cluster.bounds_m, axis=0)
    if max(size) > LARGEST_M:
        raise NoObject(
            f"{name}: expected an object of at most {LARGEST_M} m on the table, found one of "
            f"{' × '.join(f'{e:.2f}' for e in size)} m; check units, poses and what stands around the object"
        )


def _check_alone(
    found: list[Cluster],
    places: np.ndarray,
    middle: np.ndarray,
    T_world_table: np.ndarray,
    views: Views | None,
    name: str,
) -> None:
    first = found[0]
    reach = np.linalg.norm(first.centre_m - middle)
    for other in found[1:]:
        gap = _apart_m(places[first.mask], places[other.mask])
        central = np.linalg.norm(other.centre_m - middle) < 1.5 * reach + 0.05
        alike = other.n > SECOND_POINTS * first.n and other.views >= SECOND_VIEWS
        if alike and (gap < SECOND_M or central):
            raise PipelineError(
                f"{name}: expected one object on the table, found two, {first.shown(T_world_table, views)} and "
                f"{other.shown(T_world_table, views)}; record one at a time"
            )


def _within(found: list[Cluster], places: np.ndarray) -> np.ndarray:
    """Return which of the places (N, 3) stand within the outline of the first of what was found, and higher: a cake tin's tube."""
    first, taller, gap = found[0], np.zeros(len(places), bool), 2
    low = first.bounds_m[0, :2] - (gap + 1) * CELL_M
    cells = np.floor((places[:, :2] - low) / CELL_M).astype(int)
    held = np.zeros(cells[first.mask].max(axis=0) + gap + 2, bool)
    held[tuple(cells[first.mask].T)] = True
    held = ndimage.binary_fill_holes(ndimage.binary_closing(held, iterations=gap))
    for other in found[1:]:
        own = cells[other.mask]
        inside = ((own >= 0) & (own < held.shape)).all()
        if other.bounds_m[1, 2] > first.bounds_m[1, 2] and inside and held[tuple(own.T)].all():
            taller |= other.mask
    return taller


def _apart_m(one: np.ndarray, other: np.ndarray) -> float:
    """Return how far the points (N, 3) and (M, 3) are from each other, seen from above; boxes around them depend on the frame."""
    flat = [table.thinned(points[:, :2], _COMPARED) for points in (one, other)]
    return float(cKDTree(flat[0]).query(flat[1])[0].min())


def _check_below(placement: Placement, points_m: np.ndarray, name: str) -> None:
    """Refuse scans that see through the table under the object: their poses or depths are wrong."""
    over = points_m[placement.covers(points_m[:, 0], points_m[:, 1])]
    share = float(np.mean(over[:, 2] < -BELOW_M))
    if share > MOST_BELOW:
        raise NoObject(
            f"{name}: expected nothing below the table under the object, found {share:.0%} of the points there; {CURE}"
        )


def _region(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    low = np.array([*points.min(axis=0)[:2], 0.0]) - [MARGIN_M, MARGIN_M, 0.0]
    high = np.array([*points.max(axis=0)[:2], np.sort(points[:, 2])[-10]]) + MARGIN_M
    cells = np.floor((points[:, :2] - low[:2]) / CELL_M).astype(int)
    footprint = np.zeros(np.ceil((high - low)[:2] / CELL_M).astype(int) + 1, bool)
    footprint[tuple(cells.T)] = True
    footprint = ndimage.binary_fill_holes(footprint)
    return np.array([low, high]), ndimage.binary_dilation(footprint, np.ones((3, 3)), iterations=2)
