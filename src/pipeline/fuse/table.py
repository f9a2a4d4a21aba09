"""The table under the object, and the object on it: where up is, where the origin is, what belongs to the object."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from pipeline.errors import PipelineError
from pipeline.fuse.layouts import Views
from pipeline.geometry import frames

INLIER_M = 0.004
LEAST_SHARE = 0.15  # of all points on the table; else the poses do not fit together
CELL_M = 0.004
ABOVE_M = 0.008  # points this far above the table are no noise of the table
MARGIN_M = 0.008  # around the object
LARGEST_M = 0.45
MOST_BELOW = 0.05  # of the points over the footprint may lie more than `BELOW_M` below the table
BELOW_M = 0.010
LEAST_POINTS = 300
_CURE = "check that poses are camera→world in metres and the depth's scale (scan.yaml: depth_scale)"
_TRIALS = 400
_STRIDE = 3


@dataclass(frozen=True)
class Plane:
    """The table: unit normal (3,) upwards and offset with normal · x + offset = 0, world, metres; rms of its points."""

    normal: np.ndarray
    offset_m: float
    rms_m: float

    def height(self, points_world: np.ndarray) -> np.ndarray:
        """Return the height (N,) of points (N, 3) above the table."""
        return points_world @ self.normal + self.offset_m


@dataclass(frozen=True)
class Placement:
    """Where the object stands: T_object_world, its bounds (2, 3) and footprint cells (nx, ny) from `bounds_m[0]` on,
    object frame, both with a margin; the seen points (N, 3) above the table that belong to it."""

    T_object_world: np.ndarray
    bounds_m: np.ndarray
    footprint: np.ndarray
    points_m: np.ndarray

    def covers(self, x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
        """Return whether (x, y) of the object frame are within the footprint."""
        cell = np.floor((np.stack([x_m, y_m], -1) - self.bounds_m[0, :2]) / CELL_M).astype(int)
        inside = ((cell >= 0) & (cell < self.footprint.shape)).all(axis=-1)
        i, j = np.moveaxis(np.clip(cell, 0, np.array(self.footprint.shape) - 1), -1, 0)
        return inside & self.footprint[i, j]


def world_points(views: Views) -> np.ndarray:
    """Return points (N, 3) in the world: every third pixel of every third row of every view."""
    K, clouds = views.intrinsics, []
    for depth, T_world_camera in zip(views.depths_m, views.T_world_cameras, strict=True):
        v, u = np.nonzero(depth[::_STRIDE, ::_STRIDE])
        z = depth[::_STRIDE, ::_STRIDE][v, u].astype(float)
        x = (_STRIDE * u - K[0, 2]) / K[0, 0] * z
        y = (_STRIDE * v - K[1, 2]) / K[1, 1] * z
        clouds.append(frames.apply(T_world_camera, np.stack([x, y, z], axis=-1)))
    return np.concatenate(clouds)


def table_plane(
    points_world: np.ndarray, eyes_world: np.ndarray, name: str, rng: np.random.Generator
) -> Plane:
    """Find the plane of most points (N, 3) by RANSAC and least squares; up is the side of the cameras (M, 3)."""
    sample = points_world[rng.integers(len(points_world), size=20_000)]
    a, b, c = np.moveaxis(sample[rng.integers(len(sample), size=(_TRIALS, 3))], 1, 0)
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1)
    usable = length > 1e-6
    normals, a = normals[usable] / length[usable, None], a[usable]
    offsets = -np.einsum("ij,ij->i", normals, a)
    counts = [
        np.count_nonzero(np.abs(sample @ n + d) < INLIER_M) for n, d in zip(normals, offsets, strict=True)
    ]
    best = int(np.argmax(counts))
    share = counts[best] / len(sample)
    if share < LEAST_SHARE:
        raise PipelineError(
            f"{name}: expected a table that holds at least {LEAST_SHARE:.0%} of the measured points, found no plane with more "
            f"than {share:.0%}; {_CURE}"
        )
    some = points_world[rng.integers(len(points_world), size=200_000)]
    plane = _refined(some, normals[best], offsets[best], eyes_world)
    below = np.count_nonzero(plane.height(eyes_world) < 0)
    if below:
        raise PipelineError(
            f"{name}: expected every camera above the table, found {below} of {len(eyes_world)} below it; {_CURE}"
        )
    return plane


def _refined(points: np.ndarray, normal: np.ndarray, offset: float, eyes: np.ndarray) -> Plane:
    for _ in range(4):
        inliers = points[np.abs(points @ normal + offset) < INLIER_M]
        centre = inliers.mean(axis=0)
        # Not `@`: the order of a threaded product's sums depends on the number of cores.
        scatter = np.einsum("ni,nj->ij", inliers - centre, inliers - centre)
        normal = np.linalg.eigh(scatter)[1][:, 0]
        offset = -float(normal @ centre)
    if np.median(eyes @ normal + offset) < 0:
        normal, offset = -normal, -offset
    return Plane(normal, offset, float(np.sqrt(np.mean((inliers @ normal + offset) ** 2))))


def place(points_world: np.ndarray, plane: Plane, name: str) -> Placement:
    """Find the one object on the table: the largest cluster of points above it, seen from above."""
    T_table_world = _table_frame(plane)
    points = frames.apply(T_table_world, points_world)
    points = points[(points[:, 2] > ABOVE_M) & (points[:, 2] < LARGEST_M)]
    points = _largest_cluster(points, name) if len(points) else points
    if len(points) < LEAST_POINTS:
        raise PipelineError(
            f"{name}: expected an object on the table, found {len(points)} points together more than "
            f"{ABOVE_M * 1e3:.0f} mm above it; {_CURE} and that the object is in view"
        )
    low, high = points.min(axis=0), np.sort(points, axis=0)[-10]
    if max(high - [*low[:2], 0.0]) > LARGEST_M:
        raise PipelineError(
            f"{name}: expected an object of at most {LARGEST_M} m on the table, found one of "
            f"{' × '.join(f'{e:.2f}' for e in high - low)} m; check units, poses and what stands around the object"
        )
    centre = np.array([*(low + high)[:2] / 2, 0.0])
    T_object_world = frames.transform(np.eye(3), -centre) @ T_table_world
    placement = Placement(T_object_world, *_region(points - centre), points - centre)
    _check_below(placement, frames.apply(T_object_world, points_world), name)
    return placement


def _check_below(placement: Placement, points_m: np.ndarray, name: str) -> None:
    """Refuse scans that see through the table under the object: their poses or depths are wrong."""
    over = points_m[placement.covers(points_m[:, 0], points_m[:, 1])]
    share = float(np.mean(over[:, 2] < -BELOW_M))
    if share > MOST_BELOW:
        raise PipelineError(
            f"{name}: expected nothing below the table under the object, found {share:.0%} of the points there; {_CURE}"
        )


def _table_frame(plane: Plane) -> np.ndarray:
    """Return T_table_world: z up from the table, x along the world's x (or y, when that is nearly upright)."""
    along = np.eye(3)[0 if abs(plane.normal[0]) < 0.9 else 1]
    x = along - (along @ plane.normal) * plane.normal
    x /= np.linalg.norm(x)
    R = np.stack([x, np.cross(plane.normal, x), plane.normal])
    return frames.transform(R, np.array([0.0, 0.0, plane.offset_m]))


def _largest_cluster(points: np.ndarray, name: str) -> np.ndarray:
    origin = points[:, :2].min(axis=0)
    cells = np.floor((points[:, :2] - origin) / CELL_M).astype(int)
    counts = np.zeros(cells.max(axis=0) + 1, int)
    np.add.at(counts, tuple(cells.T), 1)
    # Stray pixels hit a cell once or twice; a cell of the object is hit by many views.
    labels, n = ndimage.label(ndimage.binary_closing(np.pad(counts > 3, 3), iterations=2), np.ones((3, 3)))
    labels = labels[3:-3, 3:-3]
    if n == 0:
        raise PipelineError(
            f"{name}: expected an object on the table, found scattered points; check poses and units"
        )
    sizes = ndimage.sum_labels(counts, labels, np.arange(1, n + 1))
    order = np.argsort(-sizes, kind="stable")
    centres = np.array(ndimage.center_of_mass(counts, labels, order + 1)) * CELL_M + origin
    if (
        n > 1
        and sizes[order[1]] > 0.3 * sizes[order[0]]
        and np.linalg.norm(centres[1] - centres[0]) < LARGEST_M
    ):
        shown = " and ".join(f"({x:.2f}, {y:.2f}) m" for x, y in centres[:2])
        raise PipelineError(
            f"{name}: expected one object on the table, found two, at {shown} on it; record one at a time"
        )
    return points[labels[tuple(cells.T)] == order[0] + 1]


def _region(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    low = np.array([*points.min(axis=0)[:2], 0.0]) - [MARGIN_M, MARGIN_M, 0.0]
    high = np.array([*points.max(axis=0)[:2], np.sort(points[:, 2])[-10]]) + MARGIN_M
    cells = np.floor((points[:, :2] - low[:2]) / CELL_M).astype(int)
    footprint = np.zeros(np.ceil((high - low)[:2] / CELL_M).astype(int) + 1, bool)
    footprint[tuple(cells.T)] = True
    footprint = ndimage.binary_fill_holes(footprint)
    return np.array([low, high]), ndimage.binary_dilation(footprint, np.ones((3, 3)), iterations=2)
