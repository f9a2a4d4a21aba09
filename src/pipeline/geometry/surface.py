"""Questions to a triangle mesh: how far, what is hit, what is seen. Object frame, metres."""

import numpy as np


class Surface:
    """A triangle mesh: vertices (V, 3), triangles (F, 3). Answers are for points of any shape (..., 3)."""

    def __init__(self, vertices_m: np.ndarray, triangles: np.ndarray) -> None:
        from pipeline.geometry.open3d_core import open3d as o3d

        self._vertices, self._triangles = np.asarray(vertices_m, float), triangles
        self._tensor = o3d.core.Tensor.from_numpy
        self._scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        self._scene.add_triangles(
            self._tensor(np.ascontiguousarray(vertices_m, np.float32)),
            self._tensor(np.ascontiguousarray(triangles, np.uint32)),
        )

    def distance(self, points_m: np.ndarray) -> np.ndarray:
        """Return the unsigned distance of each point to the surface."""
        points = self._tensor(np.ascontiguousarray(points_m, np.float32))
        return self._scene.compute_distance(points, nthreads=1).numpy().astype(float)

    def distance_on_grid(self, centres_m: np.ndarray, cell_m: float) -> np.ndarray:
        """Return the unsigned distance (nx, ny, nz) of a grid's points: exact within 3 cells, rounded to cells beyond.

        No edge of the mesh may be longer than 3 cells.
        """
        distance = self._to_corners(centres_m, cell_m)
        near = distance <= 5.5 * cell_m
        distance[near] = self.distance(centres_m[near])
        return distance

    def free_on_grid(self, centres_m: np.ndarray, cell_m: float) -> np.ndarray:
        """Return which points (nx, ny, nz) of a grid are further than a cell from the surface; asks where that is in doubt.

        A cell with a corner of a triangle is not: no corner is further from its centre than half of the cell's diagonal. Nor is one
        so far from all of these that no edge reaches it.
        """
        distance = self._to_corners(centres_m, cell_m)
        reach = cell_m * (1.0 + np.sqrt(3.0) / 2.0) + longest_edges(
            self._vertices, self._triangles
        ).max() / np.sqrt(3.0)
        doubt = (distance > 0.0) & (distance <= reach)
        free = distance > reach
        free[doubt] = self.distance(centres_m[doubt]) > cell_m
        return free

    def _to_corners(self, centres_m: np.ndarray, cell_m: float) -> np.ndarray:
        """Return the distance (nx, ny, nz) from each cell to the next one with a triangle's corner in it, centre to centre."""
        from scipy import ndimage

        used = np.zeros(len(self._vertices), dtype=bool)
        used[self._triangles] = True
        marked = np.zeros(centres_m.shape[:3], dtype=bool)
        cells = np.rint((self._vertices[used] - centres_m[0, 0, 0]) / cell_m).astype(int)
        marked[tuple(cells.T)] = True
        return cell_m * ndimage.distance_transform_edt(~marked)

    def hit(self, origins_m: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Return how far each ray (unit direction) goes before it hits; inf if it never does."""
        return (
            self._scene.cast_rays(self._rays(origins_m, directions), nthreads=1)["t_hit"]
            .numpy()
            .astype(float)
        )

    def sees(self, points_m: np.ndarray, goals_m: np.ndarray) -> np.ndarray:
        """Return whether the straight line from each point to its goal is free of surface."""
        rays = self._rays(points_m, goals_m - points_m)
        return ~self._scene.test_occlusions(rays, tnear=0.0, tfar=1.0, nthreads=1).numpy()

    def _rays(self, origins: np.ndarray, directions: np.ndarray):
        return self._tensor(np.concatenate([origins, directions], axis=-1).astype(np.float32))


def longest_edges(vertices_m: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the length of each triangle's longest edge (F,)."""
    corners = vertices_m[triangles]
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).max(axis=1)


def is_closed(triangles: np.ndarray) -> bool:
    """Return whether every edge of the triangles (F, 3) belongs to two of them."""
    edges = np.sort(np.concatenate([triangles[:, :2], triangles[:, 1:], triangles[:, ::2]]), axis=1)
    _, count = np.unique(edges[:, 0] * (edges.max(initial=0) + 1) + edges[:, 1], return_counts=True)
    return bool((count == 2).all())


def subdivided(vertices_m: np.ndarray, triangles: np.ndarray, edge_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the same surface with no edge longer than `edge_m`; unchanged when there is none."""
    if longest_edges(vertices_m, triangles).max() <= edge_m:
        return vertices_m, triangles
    from trimesh.remesh import subdivide_to_size

    return subdivide_to_size(vertices_m, triangles, edge_m, max_iter=20)
