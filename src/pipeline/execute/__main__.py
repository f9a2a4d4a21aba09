"""Execute motor primitives with a pair of containers: sample, rescale, check against the arm, follow.

Writes what the arm did, and which trajectories were refused before it moved. What is poured on the way is not computed here.
"""

import argparse
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline import artefacts, command

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.execute.cell import Cell
    from pipeline.execute.following import Plan
    from pipeline.execute.primitives import Primitive
    from pipeline.execute.task import Task

Row = dict[str, Any]
Sample = Callable[[int, int, int], np.ndarray]


def main() -> None:
    """Run every draw of every feature set with one pair."""
    options = _options()
    import pandas as pd

    from pipeline.execute import primitives
    from pipeline.motion.demonstrations import read_pair

    parameters, shown = (
        artefacts.read_table(options.parameters, "parameters"),
        read_pair(options.demonstration),
    )
    names, demonstrated = (options.held[0], options.target[0]), (shown["held_object"], shown["target_object"])
    attempts: list[dict[str, Any]] = []
    trajectories: list[pd.DataFrame] = []
    for features, path in options.primitives:
        primitive = primitives.read(path, parameters, features, names, demonstrated)
        head = {"held_object": names[0], "target_object": names[1], "features": features}
        for attempt, done in _executed(options, primitive, f"{names[0]} into {names[1]}, {features}"):
            attempts.append({**head, **attempt})
            if done is not None:
                trajectories.append(done.assign(**head))
    artefacts.write_table(options.attempts_table, pd.DataFrame(attempts), "attempts")
    columns = artefacts.TABLES["trajectories"].names
    empty = pd.DataFrame(columns=columns)
    artefacts.write_table(
        options.trajectories, pd.concat(trajectories) if trajectories else empty, "trajectories"
    )


def _options() -> argparse.Namespace:
    parser = command.parser(__doc__)
    for role in ("--held", "--target"):
        parser.add_argument(role, type=command.name_and_path, required=True, metavar="NAME=FILE")
    parser.add_argument("--parameters", type=Path, required=True, help="warped parameters of all objects")
    parser.add_argument(
        "--primitives", nargs="+", type=command.name_and_path, required=True, metavar="FEATURES=FILE"
    )
    parser.add_argument("--demonstration", type=Path, required=True, help="pair.yaml of the demonstrations")
    parser.add_argument("--draws", type=int, default=10, help="executions a feature set")
    parser.add_argument(
        "--attempts", type=int, default=10, help="samples a draw until the arm can follow one"
    )
    parser.add_argument("--seed", type=int, default=8, help="of the draws")
    parser.add_argument("--trajectories", type=Path, required=True, help="where the arm's poses are written")
    parser.add_argument("--attempts-table", type=Path, required=True, help="where refusals are written")
    return parser.parse_args()


def _executed(
    options: argparse.Namespace, primitive: "Primitive", what: str
) -> "Iterator[tuple[Row, pd.DataFrame | None]]":
    """Yield what there is to say about each sample (draw, attempt), and what the arm did if it could follow it."""
    from pipeline.execute import containers, following
    from pipeline.execute.cell import Cell, T_cup_flange
    from pipeline.execute.task import Task

    task, sample = primitive.task, _sampler(primitive, options.seed)
    cup, second = (containers.solid(*each) for each in (options.held, options.target))
    # What really is where: the containers' own rims.
    lip_m = containers.lip_m(options.held[1], task.yaw_rad)
    own = Task(lip_m, task.yaw_rad, containers.opening_m(options.target[1]))
    with Cell(cup, second, task.T_world_second, T_cup_flange(cup, task.yaw_rad)) as cell:
        for draw in command.progress(range(options.draws), options.draws, what):
            tries = tried(partial(sample, draw), partial(_planned, cell, task), options.attempts)
            for attempt, (wanted, found) in enumerate(tries):
                done, off_m = None, np.nan
                if not found.refused:
                    poses = following.follow(cell, found.q_rad)
                    off_m = float(np.abs(task.trajectory(poses)[:, :3] - wanted[:, :3]).max())
                    done = _table(poses, own, task.T_world_second).assign(draw=draw)
                said = {"draw": draw, "attempt": attempt, "refused": found.refused, "off_plan_m": off_m}
                yield {**said, "duration_s": (len(wanted) - 1) * following.PLAN_S}, done


def _planned(cell: "Cell", task: "Task", wanted: np.ndarray) -> "Plan":
    from pipeline.execute import following

    return following.plan(cell, task.cup_poses(wanted))


def tried(
    sample: Callable[[int, int], np.ndarray], plan: Callable[[np.ndarray], "Plan"], attempts: int
) -> "Iterator[tuple[np.ndarray, Plan]]":
    """Yield the samples (T, 4) of a draw with their plans until one is not refused; `sample` is told the attempt, and how high.

    Each refusal as the second container would be touched raises those to come by a standard deviation.
    """
    from pipeline.execute.cell import SECOND

    higher = 0
    for attempt in range(attempts):
        wanted = sample(attempt, higher)
        found = plan(wanted)
        yield wanted, found
        if not found.refused:
            break
        higher += SECOND in found.refused


def _sampler(primitive: "Primitive", seed: int) -> Sample:
    """Return what draws a trajectory (T, 4), metres and radians, every PLAN_S: the same random numbers for every feature set."""
    from pipeline.execute.following import PLAN_S

    phase = np.linspace(0.0, 1.0, round(primitive.duration_s / PLAN_S) + 1)
    own = zlib.crc32("/".join(primitive.pair).encode())

    def sample(draw: int, attempt: int, higher: int) -> np.ndarray:
        return primitive.samples(phase, 1, np.random.default_rng([seed, own, draw, attempt]), higher)[0]

    return sample


def _table(T_world_held: np.ndarray, own: "Task", T_world_second: np.ndarray) -> "pd.DataFrame":
    import pandas as pd
    from scipy.spatial.transform import Rotation

    from pipeline.execute.following import PLAN_S

    quaternions = Rotation.from_matrix(T_world_held[:, :3, :3]).as_quat()
    lip = own.trajectory(T_world_held, T_world_second)
    values = np.column_stack(
        [np.arange(len(T_world_held)) * PLAN_S, T_world_held[:, :3, 3], quaternions, lip]
    )
    names = ["t_s", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw", "lip_x_m", "lip_y_m", "lip_z_m", "tilt_rad"]
    second = {"second_x_m": T_world_second[0, 3], "second_y_m": T_world_second[1, 3]}
    return pd.DataFrame(values, columns=names).assign(**second)


if __name__ == "__main__":
    command.run(main)
