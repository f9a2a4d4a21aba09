"""Views without poses fitted to their fused surface, all at once: turns and shifts of the views with the surface's own shift.

When every view comes nearer alike, walls only grow thicker or thinner. One view after the other hardly notices: each fits
what the others make of the wall. Solved for together, with the surface free to follow, the shift is determined.
"""

import numpy as np
from scipy.spatial import cKDTree

from pipeline.fuse.levelled import Levelled
from pipeline.geometry import frames
from pipeline.geometry.surface import Surface

STEPS, NEAR_M = 4, 0.006
ALIKE = 0.5  # cosine between normals of points that are the same
LEAST_FACING = 0.25  # cosine between ray and surface: beyond, the noise is large
ROBUST_M = 0.002  # residuals beyond count less
# In each equation, a point: holds what the pairs do not determine, the turn of a round cup.
HOLD = np.array([1e-6, 1e-3, 1e-3])
# In each equation of a view whose pose was given, a point: holds its turn to the given one. The noise of a round object's normals
# speaks for other turns with a fifth of it, a mug's handle against wrong ones with four times as much.
HOLD_GIVEN_TURN = 5e-5


def fitted_together(
    views: list[Levelled],
    poses: list[np.ndarray],
    vertices_m: np.ndarray,
    triangles: np.ndarray,
    normals: np.ndarray,
    hold_turn: float = 0.0,
) -> list[np.ndarray]:
    """Return T_world_level of the views after steps to a surface, with unit normals (V, 3) at its vertices, that follows them.

    hold_turn: how much, a point, each view's turn is held to none.
    """
    surface, tree = Surface(vertices_m, triangles), cKDTree(vertices_m)
    for _ in range(STEPS):
        pairs = [_pairs(view, T, surface, tree, normals) for view, T in zip(views, poses, strict=True)]
        steps = _steps(pairs, tree.n, np.array([turn_rad(T) for T in poses]), hold_turn)
        poses = [moved(*step) @ T for step, T in zip(steps, poses, strict=True)]
    return poses


def moved(turn_rad: float, dx_m: float, dy_m: float) -> np.ndarray:
    """Return the transform of a turn about z and a shift across it."""
    turn = frames.rotation_about(np.array([0.0, 0.0, 1.0]), turn_rad)
    return frames.transform(turn, np.array([dx_m, dy_m, 0.0]))


def turn_rad(T: np.ndarray) -> float:
    """Return the turn about z of such a transform."""
    return float(np.arctan2(T[1, 0], T[0, 0]))


def motions(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return how far points (N, 3) move along unit normals (N, 3) by a turn about z, and by shifts along x and y (N, 3)."""
    x, y = points[:, 0], points[:, 1]
    return np.column_stack([x * normals[:, 1] - y * normals[:, 0], normals[:, 0], normals[:, 1]])


def _pairs(
    view: Levelled, T: np.ndarray, surface: Surface, tree: cKDTree, normals: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the vertices (M,) where the rays of a view meet the surface, its points' ways there (M,) and their motions (M, 3).

    The nearest vertices would do no good: depth's noise moves a point along the wall to where this faces the camera less.
    """
    here, eye = frames.apply(T, view.points_m), (T @ view.T_level_camera)[:3, 3]
    ray = here - eye
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    reach_m = surface.hit(np.broadcast_to(eye, ray.shape), ray)
    met = np.isfinite(reach_m)
    here, ray, facing = here[met], ray[met], frames.rotate(T, view.normals)[met]
    there = eye + reach_m[met, None] * ray
    vertex = tree.query(there)[1]
    n = normals[vertex]
    apart_m = np.einsum("nc,nc->n", n, there - here)
    good = (np.abs(apart_m) < NEAR_M) & (np.einsum("nc,nc->n", n, facing) > ALIKE)
    good &= np.einsum("nc,nc->n", n, ray) < -LEAST_FACING
    return vertex[good], apart_m[good], motions(there[good], n[good])


def _steps(
    pairs: list[tuple[np.ndarray, np.ndarray, np.ndarray]],
    n_vertices: int,
    turns_rad: np.ndarray,
    hold_turn: float,
) -> np.ndarray:
    """Return turn and shift (V, 3) of each view that bring all pairs together, where every vertex goes to their mean.

    turns_rad (V,): by how much the views are turned already.
    """
    n = len(pairs)
    left, right = np.zeros((n, 3, n, 3)), np.zeros((n, 3))
    total, pull, push = np.zeros(n_vertices), np.zeros(n_vertices), np.zeros((n_vertices, n, 3))
    for k, (vertex, apart_m, motion) in enumerate(pairs):
        weight = 1 / (1 + (apart_m / ROBUST_M) ** 2)
        left[k, :, k] = np.einsum("n,ni,nj->ij", weight, motion, motion) + np.diag(HOLD) * (len(vertex) + 1)
        right[k] = np.einsum("n,ni,n->i", weight, motion, apart_m)
        left[k, 0, k, 0] += hold_turn * len(vertex)
        right[k, 0] -= hold_turn * len(vertex) * turns_rad[k]
        total += np.bincount(vertex, weight, n_vertices)
        pull += np.bincount(vertex, weight * apart_m, n_vertices)
        for i in range(3):
            push[:, k, i] = np.bincount(vertex, weight * motion[:, i], n_vertices)
    held = total > 0
    share = push[held].reshape(-1, 3 * n) / np.sqrt(total[held])[:, None]
    matrix = left.reshape(3 * n, 3 * n) - share.T @ share
    vector = right.ravel() - share.T @ (pull[held] / np.sqrt(total[held]))
    return np.linalg.solve(matrix, vector).reshape(n, 3)
