"""One view without a pose, stood upright by the table in it: what is left unknown is a turn and a shift on the table."""

from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import PipelineError
from pipeline.fuse import placement
from pipeline.fuse.agreement import unprojected
from pipeline.fuse.raw import Views
from pipeline.geometry import frames

VOXEL_M, NORMAL_RADIUS_M = 0.002, 0.006
LEAST_POINTS = 150
# A difference of normals of one, or of intensities of one, weighs as much as this distance.
NORMAL_M, COLOUR_M = 0.006, 0.030


@dataclass(frozen=True)
class Levelled:
    """A view (its number among the views) in a frame of its own: z up from the table, the object's axis near the origin.

    points_m (N, 3), normals (N, 3) towards the camera, intensity (N,) or zeros; T_level_camera (4, 4); steepness: sine of
    the camera's elevation.
    """

    number: int
    points_m: np.ndarray
    normals: np.ndarray
    intensity: np.ndarray
    T_level_camera: np.ndarray

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
        """Return places, normals and intensities (N, 7) in another level frame, all in metres."""
        return np.column_stack(
            [frames.apply(T, self.points_m), NORMAL_M * self.normals @ T[:3, :3].T, COLOUR_M * self.intensity]
        )


def level(views: Views, i: int, name: str, rng: np.random.Generator) -> Levelled:
    """Stand view i upright; a `PipelineError` says that it has no table or no object on it."""
    single = replace(
        views,
        depths_m=[views.depths_m[i]],
        T_world_cameras=[np.eye(4)],
        intrinsics=views.intrinsics[i : i + 1],
        names=[views.names[i]],
    )
    _, place = placement.find(single, f"{name}, {views.names[i]}", rng)
    points, intensity = _points(views, i, place)
    if len(points) < LEAST_POINTS:
        raise PipelineError(
            f"{name}, {views.names[i]}: expected an object on the table, found {len(points)} points; keep it in view"
        )
    points, normals, intensity = _even(points, intensity, place.T_object_world[:3, 3])
    shift = frames.transform(np.eye(3), np.array([*-axis_of(points, normals), 0.0]))
    return Levelled(i, frames.apply(shift, points), normals, intensity, shift @ place.T_object_world)


def _points(views: Views, i: int, place) -> tuple[np.ndarray, np.ndarray]:  # type: ignore[no-untyped-def]
    """Return all points (N, 3) of the object in view i, its frame, and their intensities (N,)."""
    depth = views.depths_m[i]
    v, u = np.nonzero(depth)
    points = frames.apply(place.T_object_world, unprojected(u, v, depth[v, u], views.intrinsics[i]))
    low = place.points_m[:, 2].min()
    own = (
        (points[:, 2] > low)
        & (points[:, 2] < place.bounds_m[1, 2])
        & place.covers(points[:, 0], points[:, 1])
    )
    intensity = views.colours[i][v, u][own] if views.colours else np.zeros(int(own.sum()))
    return points[own], intensity


def _even(points: np.ndarray, intensity: np.ndarray, eye: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return evenly spaced points, their normals towards the camera, intensities; without edges where there is neither."""
    from pipeline.geometry.open3d_core import open3d as o3d

    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.colors = o3d.utility.Vector3dVector(np.repeat(intensity[:, None], 3, axis=1))
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
