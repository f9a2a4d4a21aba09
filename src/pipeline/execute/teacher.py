"""Show pours with a pair of containers: a scripted hand guides the arm, and what the arm did is recorded.

The teacher of the demonstration pair knows that pair alone, in metres and radians of the cell: no radius, lip or tilt reference
of another. Who shows several pairs (`--sees-the-pair`) sees each of them, its height, its rim, and goes by distances that people
keep. All numbers below were fixed before a novel pair was run.
"""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline import command
from pipeline.artefacts import replacing
from pipeline.errors import PipelineError
from pipeline.execute import containers, following
from pipeline.execute.cell import Cell, Solid, T_cup_flange
from pipeline.execute.task import Task

# A pour of a tall cup into a wide bowl: the lip comes in high, just past the rim, sinks as the cup tilts, the cup is emptied to
# the last ball and taken back.
START_M = np.array([-0.240, 0.0, 0.150])
POUR_M = np.array([-0.045, 0.0, 0.055])
END_M = np.array([-0.200, 0.0, 0.160])
CARRIED_RAD, EMPTY_RAD, END_RAD = 0.60, 2.45, 0.90  # carried; emptied; taken back
IN_S, SINK_S, CARRIED_S, TILT_S = (0.0, 1.7), (1.5, 3.4), (0.5, 1.9), (1.9, 4.1)
HOLD_S, BACK_S = 0.7, 1.6
# How people vary from pour to pour: standard deviations; ours.
START_SD_M = np.array([0.020, 0.015, 0.012])
POUR_SD_M = np.array([0.008, 0.006, 0.007])
END_SD_M = np.array([0.020, 0.015, 0.015])
TILT_SD_RAD, CARRIED_SD_RAD, TEMPO_SD, HOLD_SD_S = 0.06, 0.05, 0.07, 0.08
WANDER_SD_M, WANDER_S = 0.0015, 0.5  # a hand's slow drift
_ATTEMPTS = 10
# With a pair that is seen: distances from the second's near rim, of the carried cup's foot above that rim, and the share of the
# tilt at which a half full cup would run over. Those of the numbers above.
BEFORE_RIM_M, PAST_RIM_M, BACK_M = 0.168, 0.027, 0.128
FOOT_M, FOOT_BACK_M, CARRIED_SHARE = 0.020, 0.030, 0.57


@dataclass(frozen=True)
class Meant:
    """What the teacher means to do: the lip's places (3,) from the opening's centre, metres, and the tilt it is carried with."""

    start_m: np.ndarray
    pour_m: np.ndarray
    end_m: np.ndarray
    carried_rad: float


DEMONSTRATED = Meant(START_M, POUR_M, END_M, CARRIED_RAD)


def seen(cup: Solid, second: Solid) -> Meant:
    """Return what the teacher means with a pair that it sees: the lip just past the near rim, the foot above it on the way.

    Distances are the demonstration pair's, in metres; nothing is scaled but the tilt that does not spill yet.
    """
    rim_m = second.radius_m
    over = np.arctan2(cup.height_m / 2.0, cup.radius_m)
    return Meant(
        np.array([-rim_m - BEFORE_RIM_M, 0.0, cup.height_m + FOOT_M]),
        np.array([-max(rim_m - PAST_RIM_M, 0.0), 0.0, POUR_M[2]]),
        np.array([-rim_m - BACK_M, 0.0, cup.height_m + FOOT_BACK_M]),
        float(CARRIED_SHARE * over),
    )


def draw(rng: np.random.Generator, meant: Meant = DEMONSTRATED) -> np.ndarray:
    """Return one pour (T, 4) every PLAN_S: lip relative to the opening's centre x, y, z in metres, tilt in radians."""
    start = meant.start_m + START_SD_M * rng.standard_normal(3)
    pour = meant.pour_m + POUR_SD_M * rng.standard_normal(3)
    end = meant.end_m + END_SD_M * rng.standard_normal(3)
    carried = meant.carried_rad + CARRIED_SD_RAD * rng.standard_normal()
    empty = EMPTY_RAD + TILT_SD_RAD * rng.standard_normal()
    tempo = np.exp(TEMPO_SD * rng.standard_normal())
    back_s = TILT_S[1] + max(0.2, HOLD_S + HOLD_SD_S * rng.standard_normal())
    length_s = (back_s + BACK_S) / tempo
    t = np.arange(round(length_s / following.PLAN_S) + 1) * following.PLAN_S * tempo
    back = _moved(t, back_s, back_s + BACK_S)
    in_, sink = _moved(t, *IN_S), _moved(t, *SINK_S)
    way = np.column_stack([in_, in_, sink])
    lip = start + way * (pour - start) + back[:, None] * (end - pour)
    tilt = carried * _moved(t, *CARRIED_S) + (empty - carried) * _moved(t, *TILT_S) + (END_RAD - empty) * back
    return np.column_stack([lip + _wander(t, rng), tilt])


def _moved(t: np.ndarray, begin_s: float, end_s: float) -> np.ndarray:
    """Return the share of a movement that is done at times t: minimum jerk, as of a human arm (Flash and Hogan 1985)."""
    u = np.clip((t - begin_s) / (end_s - begin_s), 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


def _wander(t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    from scipy.interpolate import CubicSpline

    knots = np.arange(0.0, t[-1] + WANDER_S, WANDER_S)
    return CubicSpline(knots, WANDER_SD_M * rng.standard_normal((len(knots), 3)), bc_type="natural")(t)


def demonstrations(
    cell: Cell, task: Task, count: int, seed: int, meant: Meant = DEMONSTRATED
) -> Iterator[np.ndarray]:
    """Yield `count` pours (T, 4) every PLAN_S as the arm did them; what it cannot follow, the teacher shows anew."""
    for number in range(count):
        for attempt in range(_ATTEMPTS):
            wanted = draw(np.random.default_rng([seed, number, attempt]), meant)
            plan = following.plan(cell, task.cup_poses(wanted))
            if not plan.refused:
                yield task.trajectory(following.follow(cell, plan.q_rad))
                break
            command.say(f"pour {number}: the arm cannot follow {plan.refused}; shown again")
        else:
            raise PipelineError(
                f"pour {number}: expected one of {_ATTEMPTS} pours that the arm can follow, found none, the last refused "
                f"{plan.refused}; choose another demonstration pair"
            )


def main() -> None:
    """Write the pours, and the pair's names."""
    parser = command.parser(__doc__)
    parser.add_argument("--held", required=True, metavar="NAME=FILE", help="the cup, prepared by simulate")
    parser.add_argument("--target", required=True, metavar="NAME=FILE", help="the second container, prepared")
    parser.add_argument("--pours", type=int, default=10, help="how many")
    parser.add_argument("--seed", type=int, default=6, help="of the variation")
    parser.add_argument(
        "--sees-the-pair", action="store_true", help="go by this pair's rim and height, not the shipped one's"
    )
    parser.add_argument("--output", type=Path, required=True, help="folder of the CSV files and pair.yaml")
    options = parser.parse_args()

    (held, held_path), (target, target_path) = map(command.name_and_path, (options.held, options.target))
    cup, second = containers.solid(held, held_path), containers.solid(target, target_path)
    yaw_rad = containers.spout_yaw_rad(held_path) if options.sees_the_pair else 0.0
    task = Task(containers.lip_m(held_path, yaw_rad), yaw_rad, containers.opening_m(target_path))
    meant, seed = DEMONSTRATED, options.seed
    if options.sees_the_pair:
        meant, seed = seen(cup, second), seed + zlib.crc32(f"{held}/{target}".encode())
    with Cell(cup, second, task.T_world_second, T_cup_flange(cup, task.yaw_rad)) as cell:
        for number, pour in enumerate(demonstrations(cell, task, options.pours, seed, meant)):
            _write(options.output / f"pour_{number:02d}.csv", pour)
    with replacing(options.output / "pair.yaml") as temporary:
        temporary.write_text(f"held_object: {held}\ntarget_object: {target}\n")


def _write(path: Path, pour: np.ndarray) -> None:
    lines = ["t_s,lip_x_m,lip_y_m,lip_z_m,tilt_rad"]
    for number, row in enumerate(pour):
        lines.append(",".join(f"{value:.6f}" for value in (number * following.PLAN_S, *row)))
    with replacing(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    command.run(main)
