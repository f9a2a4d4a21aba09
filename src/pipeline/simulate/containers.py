"""The containers as rigid bodies in Bullet: it moves the held one along its tilt and says where the two collide.

The second container is a static concave mesh. The held one is a compound of convex pieces of its wall (Bullet cannot
collide two concave meshes): cells of azimuth × height (squares on the floor), split again where a handle stands off the wall.
"""

from collections.abc import Sequence

import numpy as np
import pybullet

from pipeline.geometry import bodies, frames

# Bullet wraps every shape in a margin (pybullet's default); reported distances are corrected for both.
_MARGIN_M = 0.001
_SECTORS = 20  # chords of 18° poke 0.5 mm into a cavity of 40 mm radius
_FLOOR_BAND_M = 0.012  # the floor and the corner above it are a band of their own
_FLOOR_SQUARE_M = 0.025
_BAND_M = 0.020
_STAND_OFF_M = 0.008  # a radial gap wider than any wall: a handle
_EDGE_M = 0.005  # triangles are cut to this size, so that cells share them evenly
# Triangles of the second, by its area: edges of about 9 mm, 0.4 mm within a rim of 25 mm radius.
_TRIANGLE_M2 = 3.5e-5
_TRIANGLES = (400, 1600)
_MANY, _MERGED_M = 20, 0.0015
_DIRECTIONS = 96
# Every so many pieces: few of them find most contacts at the start, at a fraction of the cost.
_SCOUT_STRIDES = (16, 4)
# Bullet's motion in steps: never further than the gap allows, never finer than this.
_FINEST_STEP_M = 0.0015
_LOOK_AHEAD_M = (0.003, 0.012)  # how far Bullet looks for the other container


class Containers:
    """One Bullet world (no graphics) with the containers that were added; use as a context manager, or `close()`."""

    def __init__(self) -> None:
        self._client = pybullet.connect(pybullet.DIRECT)
        self._hull_m: dict[int, np.ndarray] = {}
        self._scouts: dict[int, list[int]] = {}

    def __enter__(self) -> "Containers":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave the Bullet world; safe to call twice."""
        if self._client >= 0:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = -1

    def add_second(self, vertices_m: np.ndarray, triangles: np.ndarray) -> int:
        """Add a static container by a coarse mesh (V, 3), (F, 3) in its object frame; return Bullet's number of the body."""
        shape = bodies.concave(vertices_m, triangles, self._client)
        return pybullet.createMultiBody(0.0, shape, physicsClientId=self._client)

    def add_held(self, pieces: list[np.ndarray]) -> int:
        """Add a container that moves, by its `wall_pieces`; return the body's number."""
        from scipy.spatial import ConvexHull

        body = self._compound(pieces)
        self._scouts[body] = [self._compound(pieces[::stride]) for stride in _SCOUT_STRIDES]
        points = np.concatenate(pieces)
        self._hull_m[body] = points[ConvexHull(points).vertices]
        return body

    def _compound(self, pieces: list[np.ndarray]) -> int:
        shape = bodies.compound(pieces, self._client)
        return pybullet.createMultiBody(1.0, shape, physicsClientId=self._client)

    def move(self, body: int, T_world_body: np.ndarray) -> None:
        """Put a body at a pose (4, 4)."""
        bodies.place(body, T_world_body, self._client)

    def _put(self, body: int, at_m: Sequence[float], turned: Sequence[float]) -> None:
        """Put a body at a place (3,) and a quaternion (4,)."""
        pybullet.resetBasePositionAndOrientation(body, at_m, turned, physicsClientId=self._client)

    def gap_m(self, held: int, second: int, look_ahead_m: float = 0.02) -> float:
        """Return the distance between two bodies where they are (negative: they overlap); at most `look_ahead_m`."""
        found = pybullet.getClosestPoints(
            held, second, look_ahead_m - 2.0 * _MARGIN_M, physicsClientId=self._client
        )
        return min((point[8] + 2.0 * _MARGIN_M for point in found), default=look_ahead_m)

    def touch_on_the_way(
        self,
        held: int,
        second: int,
        T_world_held: np.ndarray,
        T_world_second: np.ndarray,
        lip_world: np.ndarray,
        axis_world: np.ndarray,
        tilt_rad: float,
    ) -> bool:
        """Return whether the containers touch anywhere from upright to `tilt_rad` about the lip (3,), fixed in the world.

        Conservative advancement: no point of the held container moves further in a step than the gap before it, so
        that nothing is jumped over, down to steps of 1.5 mm, half a thin wall.
        """
        self.move(second, T_world_second)
        turned = bodies.quaternion(T_world_held[:3, :3])
        for scout in self._scouts[held]:
            self._put(scout, T_world_held[:3, 3].tolist(), turned)
            if self.gap_m(scout, second, 0.0) < 0.0:
                return True
        arm_m = self._arm_m(held, T_world_held, lip_world, axis_world)
        from_lip = (T_world_held[:3, 3] - lip_world).tolist(), turned
        tilt_now, look_ahead_m = 0.0, 0.0
        while True:
            turn = lip_world.tolist(), pybullet.getQuaternionFromAxisAngle(axis_world.tolist(), tilt_now)
            pose = pybullet.multiplyTransforms(*turn, *from_lip)
            self._put(held, *pose)
            gap_m = self.gap_m(held, second, look_ahead_m)
            if gap_m < 0.0:
                return True
            if tilt_now >= tilt_rad:
                return False
            # Looking far costs more the nearer the other is (Bullet lists every pair in reach): open up in the clear.
            look_ahead_m = float(np.clip(2.0 * gap_m, *_LOOK_AHEAD_M))
            tilt_now = min(tilt_rad, tilt_now + max(gap_m, _FINEST_STEP_M) / arm_m)

    def _arm_m(
        self, held: int, T_world_held: np.ndarray, lip_world: np.ndarray, axis_world: np.ndarray
    ) -> float:
        """Return the distance from the tilt axis of the body's furthest point: metres moved per radian, at most."""
        offsets = frames.apply(T_world_held, self._hull_m[held]) - lip_world
        along = offsets @ axis_world
        return float(np.sqrt(np.max(np.einsum("ij,ij->i", offsets, offsets) - along**2)))


def wall_pieces(vertices_m: np.ndarray, triangles: np.ndarray, centre_m: np.ndarray) -> list[np.ndarray]:
    """Return the wall as convex pieces: the extreme points (≤ 96, 3) of each, object frame, metres."""
    from trimesh.remesh import subdivide_to_size

    vertices_m, triangles = subdivide_to_size(vertices_m, triangles, _EDGE_M, max_iter=30)
    centroids = vertices_m[triangles].mean(axis=1)
    _, cells = np.unique(_cells(centroids, centre_m), axis=0, return_inverse=True)
    return [
        _extremes(vertices_m[part])
        for cell in range(cells.max() + 1)
        for part in _split_radially(triangles[cells == cell], centroids[cells == cell], centre_m)
    ]


def _cells(centroids: np.ndarray, centre_m: np.ndarray) -> np.ndarray:
    """Return each triangle's cell (N, 3): squares for the floor (band 0), azimuth × height for the wall."""
    offsets = centroids[:, :2] - centre_m[:2]
    height_m = centroids[:, 2] - centroids[:, 2].min()
    n_bands = max(1, round((height_m.max() - _FLOOR_BAND_M) / _BAND_M))
    band = np.digitize(height_m, np.linspace(_FLOOR_BAND_M, height_m.max() + 1e-9, n_bands + 1))
    turn = np.arctan2(offsets[:, 1], offsets[:, 0]) / (2.0 * np.pi) + 0.5
    sector = np.minimum((turn * _SECTORS).astype(int), _SECTORS - 1)
    wall = np.column_stack([band, sector, np.zeros_like(band)])
    floor = np.column_stack([band, np.floor(offsets / _FLOOR_SQUARE_M).astype(int)])
    return np.where(band[:, None] == 0, floor, wall)


def _split_radially(triangles: np.ndarray, centroids: np.ndarray, centre_m: np.ndarray) -> list[np.ndarray]:
    """Split a cell's triangles where none lies for longer than a wall is thick; return vertex numbers of each part."""
    radius_m = np.linalg.norm(centroids[:, :2] - centre_m[:2], axis=1)
    order = np.argsort(radius_m, kind="stable")
    breaks = np.flatnonzero(np.diff(radius_m[order]) > _STAND_OFF_M) + 1
    return [np.unique(triangles[part]) for part in np.split(order, breaks)]


def _extremes(points: np.ndarray) -> np.ndarray:
    """Return the points (N, 3) that are furthest in one of many directions spread over the sphere."""
    k = np.arange(_DIRECTIONS) + 0.5
    z, turn = 1.0 - 2.0 * k / _DIRECTIONS, np.pi * (1.0 + np.sqrt(5.0)) * k
    across = np.sqrt(1.0 - z**2)
    directions = np.column_stack([across * np.cos(turn), across * np.sin(turn), z])
    return points[np.unique(np.argmax(points @ directions.T, axis=0))]


def decimated(vertices_m: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a mesh with few enough triangles for Bullet: neighbours merged first, which is fast, then quadric decimation."""
    from pipeline.geometry.open3d_core import open3d as o3d

    mesh = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(vertices_m), o3d.utility.Vector3iVector(triangles)
    )
    n = int(np.clip(mesh.get_surface_area() / _TRIANGLE_M2, *_TRIANGLES))
    if len(triangles) > _MANY * n:
        mesh = mesh.simplify_vertex_clustering(_MERGED_M, o3d.geometry.SimplificationContraction.Quadric)
    if len(mesh.triangles) > n:
        mesh = mesh.simplify_quadric_decimation(n)
    return np.asarray(mesh.vertices), np.asarray(mesh.triangles)
