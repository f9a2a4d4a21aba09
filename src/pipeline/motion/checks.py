"""What is usually wrong with a recorded pour, each named in one sentence."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pipeline.errors import PipelineError

LEAST_ROWS = 20
# A gap is much longer than the other steps, and long enough for a hand to have moved.
GAP_STEPS, GAP_S = 5.0, 0.2
SHORTEST_S, LONGEST_S = 0.3, 300.0  # of a pour
REACH_M = 3.0  # of an arm
FASTEST_M_S = 5.0  # of a hand
TURN_RAD = 2.0 * np.pi
LEAST_TILT_RAD = 0.2  # 11 degrees: less is carrying
FROM_BEYOND_M = 0.05
# A cup is taken back when it ends at less than this share of its largest tilt.
TAKEN_BACK = 0.75


def check(path: Path, table: np.ndarray) -> None:
    """Raise a `PipelineError` for the first thing wrong with a table (T, 5) of lips or (T, 8) of poses, time first."""
    _rows(path, table)
    _time(path, table[:, 0])
    place, what = table[:, 1:4], "lip_x_m lip_y_m lip_z_m" if table.shape[1] == 5 else "x_m y_m z_m"
    _place(path, table[:, 0], place, what)
    if table.shape[1] == 5:
        tilts(path, table[:, 4])
    else:
        _quaternions(path, table[:, 4:])


def tilts(path: str | Path, tilt_rad: np.ndarray) -> None:
    """Check the tilt (T,) of a pour."""
    largest = np.abs(tilt_rad).max()
    if largest > TURN_RAD:
        raise PipelineError(
            f"{path}: expected tilt_rad in radians, found {largest:.4g}, more than a turn; is it in degrees? multiply by "
            "pi/180"
        )
    if tilt_rad.max() - tilt_rad[0] < LEAST_TILT_RAD:
        turned = "tilts the other way" if tilt_rad.min() < -LEAST_TILT_RAD else "never tilts"
        raise PipelineError(
            f"{path}: expected a pour, with a tilt that grows by at least {LEAST_TILT_RAD} rad, found one that {turned} "
            f"({tilt_rad.min():.3g} to {tilt_rad.max():.3g} rad); remove the file or record it again"
        )


def together(files: Sequence[str], trajectories: Sequence[np.ndarray]) -> None:
    """Check the pours (T_i, 4) of a folder, lip x, y, z in metres and tilt in radians, against the frame and each other."""
    for name, one in zip(files, trajectories, strict=True):
        start_m, there_m = one[0, 0], one[one[:, 3].argmax(), 0]
        if start_m > FROM_BEYOND_M and there_m < start_m - FROM_BEYOND_M:
            raise PipelineError(
                f"{name}: expected a lip that comes along x towards the opening, found that it begins {start_m:.3g} m "
                f"beyond its centre and comes back to {there_m:.3g} m; is x the other way round? turn x and y about"
            )
    back = [one[-1, 3] < one[0, 3] + TAKEN_BACK * (one[:, 3].max() - one[0, 3]) for one in trajectories]
    if any(back) and not all(back):
        raise PipelineError(
            f"{files[back.index(False)]}: expected a cup that is taken back at the end, as in {files[back.index(True)]}, found a "
            "recording that ends while it is tilted; record the pour again or remove the file"
        )


def _rows(path: Path, table: np.ndarray) -> None:
    if len(table) < LEAST_ROWS:
        raise PipelineError(
            f"{path}: expected at least {LEAST_ROWS} rows, found {len(table)}; record more often"
        )


def _time(path: Path, t_s: np.ndarray) -> None:
    step_s = np.diff(t_s)
    if (step_s <= 0.0).any():
        row = int(np.argmax(step_s <= 0.0))
        raise PipelineError(
            f"{path}, line {row + 3}: expected t_s to grow, found {t_s[row + 1]:g} after {t_s[row]:g}; sort or cut the rows"
        )
    if t_s[-1] - t_s[0] > LONGEST_S:
        raise PipelineError(
            f"{path}: expected a pour of less than {LONGEST_S:g} s, found {t_s[-1] - t_s[0]:.4g}; is t_s in milliseconds? give "
            "seconds"
        )
    if t_s[-1] - t_s[0] < SHORTEST_S:
        raise PipelineError(
            f"{path}: expected a pour of at least {SHORTEST_S:g} s, found {t_s[-1] - t_s[0]:.3g}; is t_s in minutes? give "
            "seconds"
        )
    longest = int(np.argmax(step_s))
    if step_s[longest] > max(GAP_STEPS * np.median(step_s), GAP_S):
        raise PipelineError(
            f"{path}, line {longest + 3}: expected steps of about {np.median(step_s):.3g} s, found a gap of "
            f"{step_s[longest]:.3g} s after t_s = {t_s[longest]:g}; record the pour again or remove the file"
        )


def _place(path: Path, t_s: np.ndarray, place_m: np.ndarray, what: str) -> None:
    furthest = np.abs(place_m).max()
    if furthest > REACH_M:
        raise PipelineError(
            f"{path}: expected {what} in metres within an arm's reach ({REACH_M:g} m), found {furthest:.4g}; are they in "
            "millimetres? divide by 1000"
        )
    speed = np.linalg.norm(np.diff(place_m, axis=0), axis=1) / np.diff(t_s)
    row = int(np.argmax(speed))
    if speed[row] > FASTEST_M_S:
        raise PipelineError(
            f"{path}, line {row + 3}: expected a hand's motion, found a jump of "
            f"{np.linalg.norm(place_m[row + 1] - place_m[row]):.3g} m in one step; record the pour again or mend it"
        )


def _quaternions(path: Path, quaternions: np.ndarray) -> None:
    length = np.linalg.norm(quaternions, axis=1)
    row = int(np.argmax(np.abs(length - 1.0)))
    if abs(length[row] - 1.0) > 0.01:
        raise PipelineError(
            f"{path}, line {row + 2}: expected a quaternion qx qy qz qw of length 1, found {length[row]:.3g}; normalise it"
        )
