"""Inverse kinematics of the arm along a path: damped least squares, the seventh degree of freedom kept near a rest posture."""

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.execute.cell import FLANGE, N_JOINTS, READY_RAD, Cell

POSITION_M, TURN_RAD = 0.0003, 0.002  # how near the flange must come
_DAMPING = 0.02
_TO_REST = 0.05  # of the way to the rest posture an iteration, as far as the flange does not notice
_LARGEST_STEP_RAD = 0.2
_ITERATIONS, _ITERATIONS_AT_START = 30, 300


def solve(
    cell: Cell, T_world_flange: np.ndarray, q_rad: np.ndarray, iterations: int = _ITERATIONS
) -> np.ndarray | None:
    """Return joint angles (7,) near `q_rad` that put the flange at a pose (4, 4); None where there are none within limits."""
    q = q_rad.copy()
    for _ in range(iterations):
        cell.pose_arm(q)
        frames = cell.frames()
        miss = _miss(frames[FLANGE], T_world_flange)
        if np.linalg.norm(miss[:3]) < POSITION_M and np.linalg.norm(miss[3:]) < TURN_RAD:
            return q
        J = jacobian(frames)
        pinv = J.T @ np.linalg.inv(J @ J.T + _DAMPING**2 * np.eye(6))
        step = pinv @ miss + (np.eye(N_JOINTS) - pinv @ J) @ (_TO_REST * (READY_RAD - q))
        step *= min(1.0, _LARGEST_STEP_RAD / np.abs(step).max())
        q = np.clip(q + step, cell.low_rad, cell.high_rad)
    return None


def path(cell: Cell, T_world_flange: np.ndarray) -> tuple[np.ndarray, int]:
    """Return joint angles (T, 7) along flange poses (T, 4, 4), and how many of them could be reached, from the first on."""
    q = solve(cell, T_world_flange[0], READY_RAD, _ITERATIONS_AT_START)
    found: list[np.ndarray] = []
    for pose in T_world_flange:
        q = solve(cell, pose, q) if q is not None else None
        if q is None:
            break
        found.append(q)
    return np.reshape(found, (-1, N_JOINTS)), len(found)


def jacobian(frames: list[np.ndarray]) -> np.ndarray:
    """Return the flange's Jacobian (6, 7), m and rad a rad in the world; every joint turns about its frame's z (the model's)."""
    axes = np.array([T[:3, 2] for T in frames])
    arms = frames[FLANGE][:3, 3] - np.array([T[:3, 3] for T in frames])
    return np.vstack([np.cross(axes, arms).T, axes.T])


def _miss(T_world_now: np.ndarray, T_world_wanted: np.ndarray) -> np.ndarray:
    turn = T_world_wanted[:3, :3] @ T_world_now[:3, :3].T
    return np.concatenate(
        [T_world_wanted[:3, 3] - T_world_now[:3, 3], Rotation.from_matrix(turn).as_rotvec()]
    )
