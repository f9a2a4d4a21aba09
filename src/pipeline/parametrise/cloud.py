"""The pieces of a warped cloud that parameters start from, and its points with the scan's noise averaged."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.artefacts import Frame, normals, points
from pipeline.errors import PipelineError

# What `evaluate` starts from: all points (N, 3) of some part, with their areas; those of the container with normals and areas, and
# evened; those of the rim; how many points fill a hull.
PIECES = (
    *("points_m", "area_m2", "container_m", "container_normals", "container_area_m2", "container_even_m"),
    *("rim_m", "hull_points"),
)
_LEAST = 20
_NEIGHBOURS, _LEAST_REACH_M = 24, 1e-6
_BLOCK = 250  # points that are evened at a time: more leave the processor's cache
_AGREE = 0.7  # cosine between normals of the same side of a wall, at least


@dataclass(frozen=True)
class Cloud:
    """A warped object: points (N, 3) in metres, object frame, normals (N, 3), areas (N,), which are container and rim (N,), and
    which are of any part (N,): an arch over the opening, which the source has not, is of none.

    even_m (N, 3): the points with their noise averaged, where they are on the container's outside.
    """

    points_m: np.ndarray
    normals: np.ndarray
    area_m2: np.ndarray
    container: np.ndarray
    rim: np.ndarray
    known: np.ndarray
    even_m: np.ndarray

    def pieces(self, hull_points: int, rows: np.ndarray | None = None) -> dict[str, Any]:
        """Return the `PIECES` of all points, or of some rows (M,), which may recur."""
        rows = np.arange(len(self.points_m)) if rows is None else rows
        container, rim, known = (rows[part[rows]] for part in (self.container, self.rim, self.known))
        return {
            "points_m": self.points_m[known],
            "area_m2": self.area_m2[known],
            "container_m": self.points_m[container],
            "container_normals": self.normals[container],
            "container_area_m2": self.area_m2[container],
            "container_even_m": self.even_m[container],
            "rim_m": self.points_m[rim],
            "hull_points": hull_points,
        }


def warped(table: Frame, *, name: str) -> Cloud:
    """Return the valid points of a table `mapping`; a `PipelineError` names the object if they lack a container or a rim."""
    valid = np.asarray(table["valid"], bool)
    points_m, directions = points(table)[valid], normals(table)[valid]
    container, rim, handle, area_m2 = (
        np.asarray(table[column])[valid] for column in ("container", "rim", "handle", "area_m2")
    )
    if min(container.sum(), rim.sum()) < _LEAST:
        raise PipelineError(
            f"{name}: expected a container and a rim after warping, found {container.sum()} and {rim.sum()} points; "
            "look at the scan and the initial labels"
        )
    even_m = points_m.copy()
    outside = container.copy()
    outside[container] = _outward(points_m[container], directions[container])
    if outside.any():
        even_m[outside] = evened(points_m[outside], directions[outside])
    return Cloud(points_m, directions, area_m2, container, rim, container | rim | handle, even_m)


def _outward(points_m: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return which points (N, 3) face away from the middle of all: no other can be a corner of their hull."""
    middle = (points_m.min(axis=0) + points_m.max(axis=0)) / 2.0
    return np.einsum("nc,nc->n", points_m - middle, normals) > 0.0


def evened(points_m: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return points (N, 3) moved along their normals (N, 3) onto the surface through their neighbours.

    That is a quadric over the tangent plane, fitted by least squares to the nearest points of the same side of the wall, nearer
    ones weighing more (moving least squares): it follows walls and edges that are round, and averages noise.
    """
    from scipy.spatial import cKDTree

    distance, near = cKDTree(points_m).query(points_m, k=min(2 * _NEIGHBOURS, len(points_m)))
    blocks = np.array_split(np.arange(len(points_m)), -(-len(points_m) // _BLOCK))
    shift = [_shift(points_m, normals, rows, distance[rows], near[rows]) for rows in blocks]
    return points_m + normals * np.concatenate(shift)


def _shift(
    points_m: np.ndarray, normals: np.ndarray, rows: np.ndarray, distance: np.ndarray, near: np.ndarray
) -> np.ndarray:
    """Return how far (M, 1) to move some points along their normals, given their neighbours (M, K)."""
    middle, up = points_m[rows], normals[rows]
    # Point mapping may take many points to one.
    reach = np.maximum(distance[:, [min(_NEIGHBOURS, len(points_m)) - 1]], _LEAST_REACH_M)
    same_side = np.einsum("nkc,nc->nk", normals[near], up) > _AGREE
    weight = np.where(same_side, np.exp(-2.0 * (distance / reach) ** 2), 0.0)
    offset = points_m[near] - middle[:, None]
    u, v, height = (np.einsum("nkc,nc->nk", offset, axis) for axis in (*_tangents(up), up))
    u, v = u / reach, v / reach
    terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1)
    weighted = (terms * weight[..., None]).transpose(0, 2, 1)
    matrix = weighted @ terms + 1e-4 * np.eye(6)  # too few neighbours: flatter
    return np.linalg.solve(matrix, weighted @ height[..., None])[:, 0]


def _tangents(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit vectors (N, 3) each, perpendicular to unit normals (N, 3) and to each other."""
    helper = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    across = np.cross(normals, helper)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return across, np.cross(normals, across)
