"""Rigid transforms. `T_a_b` is a 4×4 matrix that takes coordinates in frame b to frame a; lengths in metres."""

import numpy as np


def transform(rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """Return the 4×4 matrix of a rotation (3, 3) and a translation (3,)."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation, translation
    return T


def apply(T_a_b: np.ndarray, points_b: np.ndarray) -> np.ndarray:
    """Return points (..., 3) of frame b in frame a."""
    points_a = points_b @ T_a_b[:3, :3].T
    points_a += T_a_b[:3, 3]
    return points_a


def rotate(T_a_b: np.ndarray, vectors_b: np.ndarray) -> np.ndarray:
    """Return directions (..., 3) of frame b in frame a."""
    return vectors_b @ T_a_b[:3, :3].T


def inverse(T_a_b: np.ndarray) -> np.ndarray:
    """Return T_b_a of a rigid T_a_b."""
    R = T_a_b[:3, :3].T
    return transform(R, -R @ T_a_b[:3, 3])


def rotation_about(axis: np.ndarray, angle_rad: float) -> np.ndarray:
    """Return the rotation (3, 3) about a unit axis (3,) by the right-hand rule (Rodrigues' formula)."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle_rad) * K + (1.0 - np.cos(angle_rad)) * (K @ K)


def tilted(
    T_world_body: np.ndarray, pivot_world: np.ndarray, axis_world: np.ndarray, angle_rad: float
) -> np.ndarray:
    """Return the pose of a body after a rotation about the axis (3,) through the pivot (3,), both in the world."""
    R = rotation_about(axis_world, angle_rad)
    return transform(R, pivot_world - R @ pivot_world) @ T_world_body


def look_at(eye_world: np.ndarray, target_world: np.ndarray) -> np.ndarray:
    """Return T_world_camera of a camera at `eye` that looks at `target`: z forward, y down (OpenCV's convention)."""
    forward = (target_world - eye_world) / np.linalg.norm(target_world - eye_world)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    if np.linalg.norm(right) < 1e-6:
        right = np.array([1.0, 0.0, 0.0])
    right = right / np.linalg.norm(right)
    return transform(np.column_stack([right, np.cross(forward, right), forward]), eye_world)
