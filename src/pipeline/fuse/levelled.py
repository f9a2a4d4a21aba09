"""One view without a pose, stood upright by the table in it: what is left unknown is a turn and a shift on the table."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from pipeline.errors import PipelineError
from pipeline.fuse import placement
from pipeline.fuse.agreement import unprojected
from pipeline.fuse.raw import Views
from pipeline.fuse.table import Placement
from pipeline.geometry import frames

VOXEL_M, NORMAL_RADIUS_M = 0.002, 0.006
LEAST_POINTS = 150
# What the object stands on is no higher than this above the table that is seen so far around it.
HIGHEST_M, AROUND_M, SAME_M = 0.1, 0.4, 0.004
# A difference of normals of one, or of contrasts of one, weighs as much as this distance.
NORMAL_M, COLOUR_M = 0.006, 0.030
# Contrast is intensity less its mean over so many metres: light that stays with the camera of a turntable is no paint.
SHADE_M = 0.030


@dataclass(frozen=True)
class Levelled:
    """A view (its number among the views) in a frame of its own: z up from the table, the object's axis near the origin.

    points_m (N, 3), normals (N, 3) towards the camera, contrast (N,) or zeros; T_level_camera (4, 4); contrasts (H, W) of
    the object's pixels, NaN elsewhere, or none without colours; steepness: sine of the camera's elevation.
    """

    number: int
    points_m: np.ndarray
    normals: np.ndarray
    contrast: np.ndarray
    T_level_camera: np.ndarray
    contrasts: np.ndarray | None = None

    @property
    def steepness(self) -> float:
        """How steeply the camera looks down, 0 to 1."""
        return float(-self.T_level_camera[2, 2])

    @property
    def lopsided_m(self) -> float:
        """How far the outermost points are beyond most others, from the axis: what sticks out tells turns apart."""
        median, far = np.quantile(np.hypot(*self.points_m[:, :2].T), [0.5, 0.99])
        return float(far - median)

    def features(self, T: np.ndarray) -> np.ndarray:
        """Return places, normals and contrasts (N, 7) in another level frame, all in metres."""
        return np.column_stack(
            [frames.apply(T, self.points_m), NORMAL_M * self.normals @ T[:3, :3].T, COLOUR_M * self.contrast]
        )


def level(
    views: Views, i: int, name: str, rng: np.random.Generator, raised_m: float | None = None
) -> Levelled:
    """Stand view i upright; a `PipelineError` says that it has no table or no object on it.

    raised_m: how much higher than the table the object stands, where other views tell.
    """
    single = replace(
        views,
        depths_m=[views.depths_m[i]],
        T_world_cameras=[np.eye(4)],
        intrinsics=views.intrinsics[i : i + 1],
        names=[views.names[i]],
    )
    _, place = placement.find(single, f"{name}, {views.names[i]}", rng, raised_m)
    found = shown(views, i, place, name)
    shift = frames.transform(np.eye(3), np.array([*-axis_of(found.points_m, found.normals), 0.0]))
    return replace(
        found, points_m=frames.apply(shift, found.points_m), T_level_camera=shift @ found.T_level_camera
    )


def shown(views: Views, i: int, place: Placement, name: str) -> Levelled:
    """Return what view i shows of an object at `place`, whose world is the camera's frame; a `PipelineError` if too little."""
    points, contrast, contrasts = _points(views, i, place)
    if len(points) < LEAST_POINTS:
        raise PipelineError(
            f"{name}, {views.names[i]}: expected an object on the table, found {len(points)} points; keep it in view"
        )
    points, normals, contrast = _even(points, contrast, place.T_object_world[:3, 3])
    return Levelled(i, points, normals, contrast, place.T_object_world, contrasts)


def raised_m(views: Views, view: Levelled) -> float:
    """Return by how much the view's object stands higher than the plane of most points around it: 0, or a turntable's height."""
    i = view.number
    depth = views.depths_m[i][::4, ::4]
    v, u = np.nonzero(depth)
    x, y, z = frames.apply(view.T_level_camera, unprojected(4 * u, 4 * v, depth[v, u], views.intrinsics[i])).T
    z = z[(np.hypot(x, y) < AROUND_M) & (np.abs(z) < HIGHEST_M)]
    if len(z) == 0:
        return 0.0
    counts, edges = np.histogram(z, np.arange(-HIGHEST_M, SAME_M, SAME_M))
    return max(0.0, -float(np.median(z[np.abs(z - edges[counts.argmax()] - SAME_M / 2) < SAME_M])))


def _points(views: Views, i: int, place: Placement) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Return all points (N, 3) of the object in view i, its frame, and their contrasts (N,) and those of the image."""
    depth = views.depths_m[i]
    v, u = np.nonzero(depth)
    points = frames.apply(place.T_object_world, unprojected(u, v, depth[v, u], views.intrinsics[i]))
    low = place.points_m[:, 2].min()
    own = (
        (points[:, 2] > low)
        & (points[:, 2] < place.bounds_m[1, 2])
        & place.covers(points[:, 0], points[:, 1])
    )
    if not views.colours:
        return points[own], np.zeros(int(own.sum())), None
    shown = np.zeros(depth.shape, bool)
    shown[v[own], u[own]] = True
    shade_px = SHADE_M * views.intrinsics[i, 0, 0] / float(np.median(depth[shown])) if own.any() else 1.0
    contrasts = _contrasts(views.colours[i], shown, shade_px)
    return points[own], contrasts[v[own], u[own]], contrasts


def _contrasts(intensity: np.ndarray, shown: np.ndarray, shade_px: float) -> np.ndarray:
    """Return by how much (H, W) the pixels that are shown (H, W) are lighter than their neighbourhood; NaN elsewhere."""
    weight = ndimage.gaussian_filter(shown.astype(float), shade_px)
    mean = ndimage.gaussian_filter(np.where(shown, intensity, 0.0), shade_px) / np.maximum(weight, 1e-12)
    return np.where(shown, intensity - mean, np.nan)


def _even(points: np.ndarray, contrast: np.ndarray, eye: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return evenly spaced points, their normals towards the camera, contrasts; without edges where there is neither."""
    from pipeline.geometry.open3d_core import open3d as o3d

    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.colors = o3d.utility.Vector3dVector(np.repeat(contrast[:, None], 3, axis=1))
    cloud = cloud.voxel_down_sample(VOXEL_M)
    cloud, _ = cloud.remove_statistical_outlier(12, 2.0)
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamRadius(NORMAL_RADIUS_M))
    cloud.orient_normals_towards_camera_location(eye)
    return np.asarray(cloud.points), np.asarray(cloud.normals), np.asarray(cloud.colors)[:, 0]


def axis_of(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return where (2,) the horizontal lines along the normals meet: on the axis, if the object is round."""
    n = normals[:, :2]
    length = np.linalg.norm(n, axis=1)
    steep = length > 0.5
    if np.count_nonzero(steep) < 30:
        return points[:, :2].mean(axis=0)
    across = np.column_stack([-n[steep, 1], n[steep, 0]]) / length[steep, None]
    wanted = np.einsum("nc,nc->n", across, points[steep, :2])
    weight = np.ones(len(wanted))
    centre = points[:, :2].mean(axis=0)
    for _ in range(10):
        A = np.einsum("n,ni,nj->ij", weight, across, across) + 1e-6 * np.eye(2)
        centre = np.linalg.solve(A, np.einsum("n,ni,n->i", weight, across, wanted) + 1e-6 * centre)
        weight = 1 / (1 + ((across @ centre - wanted) / 0.004) ** 2)
    return centre
