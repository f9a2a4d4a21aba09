"""The table under the object: planes of the measured points by RANSAC, in any world frame."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from pipeline.errors import PipelineError
from pipeline.fuse.agreement import unprojected
from pipeline.fuse.raw import Views
from pipeline.geometry import frames

INLIER_M = 0.004
CELL_M = 0.004  # of an object's footprint
LEAST_SHARE = 0.10  # of the points around what the cameras look at
MOST_PLANES = 5
NEAR_M = 0.6  # around what the cameras look at; the rest is background
LEAST_ABOVE = 0.9  # of the cameras are above a table
CURE = "check that poses are camera→world in metres and the depth's scale (scan.yaml: depth_scale)"
_TRIALS, _COUNTED, _REFINED = 2000, 4000, 100_000
STRIDE = 3  # pixels


@dataclass(frozen=True)
class Plane:
    """The table: unit normal (3,) upwards and offset with normal · x + offset = 0, world, metres; rms of its points."""

    normal: np.ndarray
    offset_m: float
    rms_m: float

    def height(self, points_world: np.ndarray) -> np.ndarray:
        """Return the height (N,) of points (N, 3) above the table."""
        return points_world @ self.normal + self.offset_m

    def raised(self, by_m: float) -> "Plane":
        """Return the plane that is so much higher."""
        return Plane(self.normal, self.offset_m - by_m, self.rms_m)


@dataclass(frozen=True)
class Placement:
    """Where the object stands: T_object_world, its bounds (2, 3) and footprint cells (nx, ny) from `bounds_m[0]` on,
    object frame, both with a margin; the seen points (N, 3) above the table that belong to it; raised_m: how much higher than the
    table around it is what it stands on."""

    T_object_world: np.ndarray
    bounds_m: np.ndarray
    footprint: np.ndarray
    points_m: np.ndarray
    raised_m: float = 0.0

    def covers(self, x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
        """Return whether (x, y) of the object frame are within the footprint."""
        (low_x, low_y), (nx, ny) = self.bounds_m[0, :2], self.footprint.shape
        inside = (x_m >= low_x) & (x_m < low_x + nx * CELL_M) & (y_m >= low_y) & (y_m < low_y + ny * CELL_M)
        i = ((x_m[inside] - low_x) / CELL_M).astype(int)
        j = ((y_m[inside] - low_y) / CELL_M).astype(int)
        inside[inside] = self.footprint[np.minimum(i, nx - 1), np.minimum(j, ny - 1)]
        return inside

    def beside(self, x_m: np.ndarray, y_m: np.ndarray, reach_m: float) -> np.ndarray:
        """Return whether (x, y) of the object frame are off the footprint and at most `reach_m` from its bounds."""
        low, high = self.bounds_m[0] - reach_m, self.bounds_m[1] + reach_m
        near = (x_m > low[0]) & (x_m < high[0]) & (y_m > low[1]) & (y_m < high[1])
        return near & ~self.covers(x_m, y_m)


@dataclass(frozen=True)
class Points:
    """Measured points (N, 3) in the world and the number of the view (N,) that each is from."""

    places_m: np.ndarray
    view: np.ndarray

    def only(self, kept: np.ndarray) -> "Points":
        """Return the points (N,) that are kept."""
        index = np.flatnonzero(kept)  # rows are taken faster by number than by mask
        return Points(self.places_m.take(index, axis=0), self.view.take(index))


def thinned(values: np.ndarray, most: int) -> np.ndarray:
    """Return every k-th of the rows: as many as possible, `most` at most."""
    return values[:: -(-len(values) // most) or 1]


def local_heights(x_m: np.ndarray, y_m: np.ndarray, z_m: np.ndarray) -> np.ndarray:
    """Return for each of the points (N,) the median height of those around it: steps of a table without the noise of depth."""
    column = np.floor(np.stack([x_m, y_m], axis=1) / (2 * CELL_M)).astype(int)
    column -= column.min(axis=0)
    cell = np.unique(column @ [1, column[:, 0].max() + 1], return_inverse=True)[1]
    return np.asarray(ndimage.median(z_m, cell, np.arange(cell.max() + 1)))[cell]


def world_points(views: Views, stride: int, around: np.ndarray, within_m: float) -> Points:
    """Return of every view every so many pixels of every so many rows, that show what is so near to a point (3,) of the world."""
    clouds = []
    for depth, K, T_world_camera in zip(views.depths_m, views.intrinsics, views.T_world_cameras, strict=True):
        v, u = np.nonzero(depth[::stride, ::stride] > 0)
        points = unprojected(stride * u, stride * v, depth[::stride, ::stride][v, u], K)
        places = frames.apply(T_world_camera, points)
        x, y, z = (places - around).T
        # View by view, as all of many large images at once are gigabytes.
        clouds.append(places.take(np.flatnonzero(x * x + y * y + z * z < within_m**2), axis=0))
    counts = [len(cloud) for cloud in clouds]
    return Points(np.concatenate(clouds), np.repeat(np.arange(len(clouds)), counts))


def focus(views: Views) -> np.ndarray:
    """Return the point (3,) of the world that the cameras look at: the median of what is in the middle of the images."""
    middles = []
    for depth, K, T_world_camera in zip(views.depths_m, views.intrinsics, views.T_world_cameras, strict=True):
        height, width = depth.shape
        v, u = np.mgrid[height * 2 // 5 : height * 3 // 5 : 4, width * 2 // 5 : width * 3 // 5 : 4]
        there = depth[v, u] > 0
        if there.any():
            points = unprojected(u[there], v[there], depth[v, u][there], K)
            middles.append(np.median(frames.apply(T_world_camera, points), axis=0))
    if not middles:
        raise PipelineError(
            f"{views.names[0]}: expected depth in the middle of the images, found none; keep the object in the middle"
        )
    return np.median(middles, axis=0)


def planes(points: np.ndarray, eyes: np.ndarray, name: str, rng: np.random.Generator) -> Iterator[Plane]:
    """Yield planes that may be the table, those of most points (N, 3) first; up is the side of the cameras (M, 3)."""
    left, n_found, below, largest = points, 0, 0, 0.0
    for _ in range(MOST_PLANES):
        if len(left) < max(100, LEAST_SHARE * len(points)):
            break
        normal, offset = _ransac(left, rng)
        share = np.count_nonzero(np.abs(left @ normal + offset) < INLIER_M) / len(points)
        largest = max(largest, share)
        if share < LEAST_SHARE:
            break
        plane = refined(left, normal, offset, eyes)
        under = int(np.count_nonzero(plane.height(eyes) < 0))
        if under <= (1 - LEAST_ABOVE) * len(eyes):
            n_found += 1
            yield plane
        below = below or under
        left = left[np.abs(plane.height(left)) > 2 * INLIER_M]
    if not n_found and below:
        raise PipelineError(
            f"{name}: expected every camera above the table, found {below} of {len(eyes)} below it; {CURE}"
        )
    if not n_found:
        raise PipelineError(
            f"{name}: expected a table that holds at least {LEAST_SHARE:.0%} of the measured points, found no plane with more "
            f"than {largest:.0%}; {CURE}"
        )


def _ransac(points: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, float]:
    """Return the normal and the offset of the plane near to most of the points (Fischler & Bolles 1981)."""
    sample = points[rng.integers(len(points), size=min(len(points), _COUNTED))]
    a, b, c = np.moveaxis(sample[rng.integers(len(sample), size=(_TRIALS, 3))], 1, 0)
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1)
    usable = length > 1e-6
    if not usable.any():
        return np.array([0.0, 0.0, 1.0]), 0.0
    normals, a = normals[usable] / length[usable, None], a[usable]
    offsets = -np.einsum("ij,ij->i", normals, a)
    counts = [
        np.count_nonzero(np.abs(np.einsum("nj,j->n", sample, n) + d) < INLIER_M)
        for n, d in zip(normals, offsets, strict=True)
    ]
    best = int(np.argmax(counts))
    return normals[best], float(offsets[best])


def refined(points: np.ndarray, normal: np.ndarray, offset: float, eyes: np.ndarray) -> Plane:
    """Return the least-squares plane of the points (N, 3) near a first one, upwards to the cameras (M, 3)."""
    points = thinned(points, _REFINED)
    for _ in range(4):
        inliers = points[np.abs(points @ normal + offset) < INLIER_M]
        if len(inliers) < 3:
            break
        centre = inliers.mean(axis=0)
        # Not `@`: the order of a threaded product's sums depends on the number of cores.
        scatter = np.einsum("ni,nj->ij", inliers - centre, inliers - centre)
        normal = np.linalg.eigh(scatter)[1][:, 0]
        offset = -float(normal @ centre)
    if np.median(eyes @ normal + offset) < 0:
        normal, offset = -normal, -offset
    residual = points @ normal + offset
    rms = (
        float(np.sqrt(np.mean(np.square(residual[np.abs(residual) < INLIER_M], dtype=float))))
        if len(points)
        else 0.0
    )
    return Plane(normal, offset, rms)
