"""From recorded poses of a cup to the task space: which rim point is the lip, along which direction it pours, how far it tilts."""

import numpy as np

from pipeline.errors import PipelineError
from pipeline.geometry import frames


def matrices(poses: np.ndarray) -> np.ndarray:
    """Return T_world_body (T, 4, 4) of rows x, y, z (metres), qx, qy, qz, qw (T, 7)."""
    from scipy.spatial.transform import Rotation

    T = np.tile(np.eye(4), (len(poses), 1, 1))
    T[:, :3, :3], T[:, :3, 3] = Rotation.from_quat(poses[:, 3:]).as_matrix(), poses[:, :3]
    return T


def trajectory(
    T_world_cup: np.ndarray, rim_m: np.ndarray, T_world_second: np.ndarray, opening_m: np.ndarray, where: str
) -> np.ndarray:
    """Return the task-space trajectory (T, 4) of cup poses (T, 4, 4): lip x, y, z in metres, tilt in radians.

    rim_m: rim points (M, 3), cup's frame; opening_m (3,): the second's frame; where: the file, for errors. The pour's
    direction is where the cup leans when it leans most within a right angle, the lip the rim point that is lowest then.
    """
    up = T_world_cup[:, :3, 2]
    lean = np.arccos(np.clip(up[:, 2], -1.0, 1.0))
    # Beyond a right angle the direction is still the same, but an upside-down cup has none.
    most = int(np.argmin(np.abs(lean - min(lean.max(), np.pi / 2.0))))
    if lean[most] < 0.2:
        raise PipelineError(
            f"{where}: expected a pour, found a cup that never tilts by 0.2 rad; remove the file or record it again"
        )
    along = np.array([*up[most, :2], 0.0])
    along /= np.linalg.norm(along)
    across = np.cross([0.0, 0.0, 1.0], along)
    lip_m = rim_m[np.argmin(frames.apply(T_world_cup[most], rim_m)[:, 2])]
    offset = np.array([frames.apply(T, lip_m) for T in T_world_cup]) - frames.apply(T_world_second, opening_m)
    tilt = np.unwrap(np.arctan2(up @ along, up[:, 2]))
    return np.column_stack([offset @ along, offset @ across, offset[:, 2], tilt])
