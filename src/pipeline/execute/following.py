"""A trajectory is checked against what the arm can do, then followed by its motors; what the arm really did is told."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.execute import kinematics
from pipeline.execute.cell import SPEED_LIMIT_RAD_S, STEP_S, Cell
from pipeline.geometry.frames import inverse

PLAN_S = 1.0 / 60.0
STEPS_A_PLAN = round(PLAN_S / STEP_S)
_LOOK_EVERY = 2  # planned poses between two looks at contacts


@dataclass(frozen=True)
class Plan:
    """Joint angles (T, 7) every PLAN_S, or why there are none."""

    q_rad: np.ndarray
    refused: str = ""


def plan(cell: Cell, T_world_cup: np.ndarray) -> Plan:
    """Return the joint path along cup poses (T, 4, 4) that are PLAN_S apart; refused where limits or contacts forbid it."""
    flange = T_world_cup @ inverse(cell.T_flange_cup)
    q, reached = kinematics.path(cell, flange)
    if reached < len(flange):
        return Plan(q, f"{_at(reached)}: no joint angles within their limits put the cup there")
    speed = np.abs(_spline(q).derivative()(np.arange(len(q)) * PLAN_S)) / SPEED_LIMIT_RAD_S
    if speed.max() > 1.0:
        moment, joint = np.unravel_index(speed.argmax(), speed.shape)
        return Plan(
            q, f"{_at(int(moment))}: joint {joint + 1} would turn at {speed.max():.1f} times its limit"
        )
    for number in range(0, len(q), _LOOK_EVERY):
        cell.pose_arm(q[number])
        cell.follow_flange()
        if contact := cell.touching():
            return Plan(q, f"{_at(number)}: {contact}")
    return Plan(q)


def follow(cell: Cell, q_rad: np.ndarray) -> np.ndarray:
    """Let the motors follow joint angles (T, 7); return the cup poses (T, 4, 4) that came of it, PLAN_S apart."""
    spline = _spline(q_rad)
    speed = spline.derivative()
    cell.pose_arm(q_rad[0])
    poses = [cell.T_world_cup()]
    for number in range(1, (len(q_rad) - 1) * STEPS_A_PLAN + 1):
        time_s = number * STEP_S
        cell.step_towards(spline(time_s), speed(time_s))
        if number % STEPS_A_PLAN == 0:
            poses.append(cell.T_world_cup())
    return np.array(poses)


def _spline(q_rad: np.ndarray) -> CubicSpline:
    return CubicSpline(np.arange(len(q_rad)) * PLAN_S, q_rad, bc_type="clamped")


def _at(number: int) -> str:
    return f"after {number * PLAN_S:.2f} s"
