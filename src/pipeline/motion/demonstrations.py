"""Demonstrations as a user records them: a folder with pair.yaml and one CSV file a pour, in either of two layouts.

t_s lip_x_m lip_y_m lip_z_m tilt_rad: the held cup's lip relative to the centre of the second's opening, in the task frame (x
horizontal along the pour, towards the opening; y across; z up). Or t_s x_m y_m z_m qx qy qz qw: poses of the held cup, cup →
world; pair.yaml then says where the second container stands (`target_pose`, the same seven keys).
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import PipelineError

LIP_COLUMNS = ("t_s", "lip_x_m", "lip_y_m", "lip_z_m", "tilt_rad")
POSE_COLUMNS = ("t_s", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
POSE_KEYS = POSE_COLUMNS[1:]


@dataclass(frozen=True)
class Demonstrations:
    """Pours of one pair. times_s: (T_i,) each; values: (T_i, 4) of lip and tilt, or (T_i, 7) of poses, then target_pose (7,)."""

    held_object: str
    target_object: str
    files: tuple[str, ...]
    times_s: tuple[np.ndarray, ...]
    values: tuple[np.ndarray, ...]
    target_pose: np.ndarray | None = None

    @property
    def poses(self) -> bool:
        """Return whether the files hold cup poses."""
        return self.values[0].shape[1] == len(POSE_KEYS)


def read(folder: str | Path) -> Demonstrations:
    """Read and check a folder of demonstrations; whatever is wrong is a `PipelineError` that names the file."""
    from pipeline.motion import checks

    folder = Path(folder)
    pair = read_pair(folder / "pair.yaml")
    files = sorted(path for path in folder.glob("*.csv") if not path.name.startswith("."))
    if len(files) < 2:
        raise PipelineError(
            f"{folder}: expected at least two demonstrations (*.csv), found {len(files)}; record more"
        )
    tables = [_numbers(path) for path in files]
    layouts = {table.shape[1] for table in tables}
    if len(layouts) > 1:
        raise PipelineError(
            f"{folder}: expected one layout in all files, found lips in some and poses in others; keep one"
        )
    if len(POSE_COLUMNS) in layouts and "target_pose" not in pair:
        raise PipelineError(
            f"{folder}/pair.yaml: expected target_pose ({' '.join(POSE_KEYS)}), as {files[0].name} holds cup poses, found none; "
            "add where the second container stands"
        )
    for path, table in zip(files, tables, strict=True):
        checks.check(path, table)
    return Demonstrations(
        pair["held_object"],
        pair["target_object"],
        tuple(path.name for path in files),
        tuple(table[:, 0] - table[0, 0] for table in tables),
        tuple(table[:, 1:] for table in tables),
        np.array([pair["target_pose"][key] for key in POSE_KEYS], float) if "target_pose" in pair else None,
    )


def read_pair(path: str | Path) -> dict[str, Any]:
    """Read pair.yaml: held_object, target_object, and perhaps target_pose."""
    import yaml

    try:
        pair = yaml.safe_load(Path(path).read_text())
    except (OSError, ValueError, yaml.YAMLError) as error:
        reason = str(error).splitlines()[0]
        raise PipelineError(
            f"{path}: expected held_object and target_object, but it cannot be read: {reason}"
        ) from error
    keys = set(pair) if isinstance(pair, dict) else set()
    names = {"held_object", "target_object"}
    if not names <= keys <= {*names, "target_pose"} or not all(isinstance(pair[name], str) for name in names):
        raise PipelineError(
            f"{path}: expected the keys held_object and target_object with objects' names, and perhaps target_pose, found "
            f"{' '.join(sorted(map(str, keys))) or 'none'}; correct it"
        )
    if "target_pose" in keys and not _is_pose(pair["target_pose"]):
        raise PipelineError(
            f"{path}: expected target_pose with the numbers {' '.join(POSE_KEYS)}, a quaternion of length 1, found "
            f"{pair['target_pose']}; correct it"
        )
    return pair


def _is_pose(pose: Any) -> bool:
    if not isinstance(pose, dict) or set(pose) != set(POSE_KEYS):
        return False
    if not all(isinstance(value, int | float) and np.isfinite(value) for value in pose.values()):
        return False
    return bool(abs(np.linalg.norm([pose[key] for key in POSE_KEYS[3:]]) - 1.0) < 0.01)


def _numbers(path: Path) -> np.ndarray:
    """Return the numbers (T, 5) or (T, 8) of a file."""
    import pandas as pd

    try:
        frame = pd.read_csv(path, skipinitialspace=True)
    except (OSError, ValueError) as error:  # of pandas all are ValueErrors
        reason = str(error).splitlines()[0]
        raise PipelineError(
            f"{path}: expected a CSV table, but it cannot be read: {reason}; export it again"
        ) from error
    columns = tuple(frame.columns)
    if columns not in (LIP_COLUMNS, POSE_COLUMNS):
        raise PipelineError(
            f"{path}: expected the columns {' '.join(LIP_COLUMNS)} or {' '.join(POSE_COLUMNS)}, found "
            f"{' '.join(map(str, columns))[:200]}; metres, radians and seconds are meant, rename or convert them"
        )
    numbers = frame.apply(pd.to_numeric, errors="coerce").to_numpy(float)
    bad = np.argwhere(~np.isfinite(numbers))
    if len(bad):
        row, column = bad[0]
        raise PipelineError(
            f"{path}, line {row + 2}: expected a number in {columns[column]}, found "
            f"{frame.iloc[row, column]}; cut the recording there or mend it"
        )
    return numbers
