"""The task frame (section II-D): the held cup's lip relative to the centre of the second's opening, and the tilt.

x: horizontal, along the pour, towards the opening; y: across; z: up. In the cell x, y, z are the world's, with the opening's
centre over the world's origin.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.geometry.frames import apply, rotation_about, transform

TILT_AXIS = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class Task:
    """A pair at work. lip_m (3,), yaw_rad: lip and pour direction in the held cup's frame; opening_m (3,): the second's frame."""

    lip_m: np.ndarray
    yaw_rad: float
    opening_m: np.ndarray

    @property
    def T_world_second(self) -> np.ndarray:
        """Where the second container stands (4, 4): on the table, its opening over the origin."""
        return transform(np.eye(3), np.array([-self.opening_m[0], -self.opening_m[1], 0.0]))

    def cup_poses(self, trajectory: np.ndarray) -> np.ndarray:
        """Return T_world_cup (T, 4, 4) of a task-space trajectory (T, 4): x, y, z in metres, tilt in radians."""
        opening = apply(self.T_world_second, self.opening_m)
        upright = rotation_about(np.array([0.0, 0.0, 1.0]), -self.yaw_rad)
        poses = []
        for *offset, tilt in trajectory:
            R = rotation_about(TILT_AXIS, tilt) @ upright
            poses.append(transform(R, opening + offset - R @ self.lip_m))
        return np.array(poses)

    def own(self, trajectories: np.ndarray, lip_m: np.ndarray, opening_m: np.ndarray) -> np.ndarray:
        """Return trajectories (..., 4) of this task as those of another lip and opening (3,) of the same containers."""
        upright = rotation_about(np.array([0.0, 0.0, 1.0]), -self.yaw_rad)
        off_x, off_y, off_z = upright @ (lip_m - self.lip_m)
        sin, cos = np.sin(trajectories[..., 3]), np.cos(trajectories[..., 3])
        tilted = np.stack(
            [cos * off_x + sin * off_z, np.full_like(sin, off_y), cos * off_z - sin * off_x], axis=-1
        )
        place = trajectories[..., :3] + tilted - (opening_m - self.opening_m)
        return np.concatenate([place, trajectories[..., 3:]], axis=-1)

    def trajectory(self, T_world_cup: np.ndarray, T_world_second: np.ndarray | None = None) -> np.ndarray:
        """Return the task-space trajectory (T, 4) of cup poses (T, 4, 4): the way back.

        The second container may stand elsewhere than this task would put it.
        """
        T_world_second = self.T_world_second if T_world_second is None else T_world_second
        opening = apply(T_world_second, self.opening_m)
        out = np.array([np.cos(self.yaw_rad), np.sin(self.yaw_rad), 0.0])
        rows = []
        for T in T_world_cup:
            up, forward = T[:3, 2], T[:3, :3] @ out
            tilt = np.arctan2(-forward[2], up[2])
            rows.append([*(apply(T, self.lip_m) - opening), tilt])
        return np.column_stack([np.array(rows)[:, :3], np.unwrap(np.array(rows)[:, 3])])
