"""Fill a held cup and carry it along poses that a robot's arm has done: what ends in the second container, and what beside it?

Reads the stage execute's trajectories; one row an execution.
"""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline import artefacts, command

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.simulate.carrying import Carried, Motion
    from pipeline.simulate.spheres import Pot

TILT_AXIS_WORLD = np.array([0.0, 1.0, 0.0])  # of the table "trajectories": pours go along +x


def main() -> None:
    """Carry along every trajectory of a pair."""
    options = _options()
    import pandas as pd

    trajectories = artefacts.read_table(options.trajectories, "trajectories")
    runs = [run for _, run in trajectories.groupby(["features", "draw"], sort=True)]
    rows = []
    if runs:
        carrier = (_Liquid if options.contents == "liquid" else _Balls)(options)
        told = command.progress(runs, len(runs), f"{options.held[0]} into {options.target[0]}")
        rows = [{**_names(run), **carrier.carry(run)} for run in told]
    columns = artefacts.TABLES["carried"].names
    artefacts.write_table(options.outcomes, pd.DataFrame(rows, columns=columns), "carried")


def _names(run: "pd.DataFrame") -> dict[str, Any]:
    return {key: run[key].iloc[0] for key in ("held_object", "target_object", "features", "draw")}


def _options() -> argparse.Namespace:
    options = parser(__doc__)
    options.add_argument("--contents", default="balls", choices=("balls", "liquid"), help="what is poured")
    options.add_argument("--outcomes", type=Path, required=True, help="where the table is written")
    return options.parse_args()


def parser(doc: str | None) -> argparse.ArgumentParser:
    """Return the options that say what is carried."""
    parser = command.parser(doc)
    for role in ("--held", "--target"):
        parser.add_argument(role, type=command.name_and_path, required=True, metavar="NAME=FILE")
    parser.add_argument("--trajectories", type=Path, required=True, help="what the arm did")
    parser.add_argument("--fill", type=float, default=0.5, help="share of the held cup's capacity")
    parser.add_argument("--balls", type=int, default=105, help="gel balls that this is")
    parser.add_argument("--seed", type=int, default=8, help="of the balls' places")
    return parser


def pots(options: argparse.Namespace, second: artefacts.Arrays) -> "tuple[Pot, Pot]":
    """Return both containers for balls of one size: so large that the held cup, filled as wanted, holds as many as wanted."""
    from pipeline.simulate import gel, prepared

    held = prepared.from_arrays(options.held[0], artefacts.read_arrays(options.held[1]))
    target = prepared.from_arrays(options.target[0], second)
    spacing_m = (options.fill * held.cavity.capacity_m3 / options.balls) ** (1.0 / 3.0)
    pot = gel.prepare(held.cavity, *held.coarse, spacing_m)
    return pot, gel.alike(pot, target.cavity, *target.coarse)


def first(path: Path, features: str) -> "pd.DataFrame":
    """Return the trajectory of the first execution of a feature set; no rows when the arm could follow none of its samples."""
    table = artefacts.read_table(path, "trajectories")
    table = table[table["features"] == features]
    return table[table["draw"] == table["draw"].min()]


class _Balls:
    """Carries gel balls."""

    def __init__(self, options: argparse.Namespace) -> None:
        second = artefacts.read_arrays(options.target[1])
        self.options = options
        self.held, self.second = pots(options, second)
        self.radius_m = _radius_m(second["cavity_rim_m"])

    def carry(self, run: "pd.DataFrame") -> dict[str, Any]:
        from pipeline.simulate.carrying import carry

        moving = _motion(run, self.held.matter.step_s)
        seed = self.options.seed + int(run["draw"].iloc[0])
        T_world_second = artefacts.T_world_second(run)
        carried = carry(self.held, self.second, moving, T_world_second, self.options.balls, seed)
        return outcome(carried, arrived_s(run, self.radius_m))


class _Liquid:
    """Carries the liquid, in particles of the size that the containers were prepared for."""

    def __init__(self, options: argparse.Namespace) -> None:
        from pipeline.simulate import liquid, prepared

        held, second = (
            prepared.from_arrays(name, artefacts.read_arrays(path))
            for name, path in (options.held, options.target)
        )
        self.options, self.held, self.second = options, held.vessel, second.vessel
        self.n = liquid.particles_for(held.vessel, options.fill * held.cavity.capacity_m3)
        self.radius_m = _radius_m(second.cavity.rim_m)

    def carry(self, run: "pd.DataFrame") -> dict[str, Any]:
        from pipeline.simulate import carrying_liquid

        moving = _motion(run, carrying_liquid.step_s(self.held, self.second))
        axis = moving.T_world_cup[0, :3, :3].T @ TILT_AXIS_WORLD
        seed, arrived = self.options.seed + int(run["draw"].iloc[0]), arrived_s(run, self.radius_m)
        carried = carrying_liquid.carry(
            self.held, self.second, moving, artefacts.T_world_second(run), axis, self.n, arrived, seed
        )
        return carried._asdict()


def _motion(run: "pd.DataFrame", step_s: float) -> "Motion":
    from pipeline.simulate.carrying import motion

    time_s = run["t_s"].to_numpy()
    return motion(artefacts.poses(run), float(time_s[1] - time_s[0]), step_s)


def _radius_m(rim_m: np.ndarray) -> float:
    return float(np.linalg.norm((rim_m - rim_m.mean(axis=0))[:, :2], axis=1).mean())


def arrived_s(run: "pd.DataFrame", radius_m: float) -> float:
    """Return when the lip is above the opening for the first time; inf if it never is."""
    inside = (np.hypot(run["lip_x_m"], run["lip_y_m"]) <= radius_m).to_numpy()
    return float(run["t_s"].to_numpy()[inside.argmax()]) if inside.any() else np.inf


def outcome(carried: "Carried", arrived_s: float) -> dict[str, Any]:
    """Return the counts of an execution with balls.

    Of those outside, some overflowed: they had been in. Some came early: they left before the lip was above the opening.
    """
    gone_s = np.array([ball.time_s for ball in carried.balls])
    outside = np.array([ball.outside for ball in carried.balls], dtype=bool)
    landed = np.array([ball.landed for ball in carried.balls], dtype=bool)
    return {
        "n_balls": carried.n,
        "n_poured": len(gone_s),
        "n_in_target": carried.n_in_target,
        "n_spilled": int(outside.sum()),
        "n_overflowed": int((outside & landed).sum()),
        "n_early": int((outside & ~landed & (gone_s < arrived_s)).sum()),
        "n_leaked": carried.n_leaked,
        "first_drop_s": float(gone_s.min()) if len(gone_s) else np.nan,
        "first_spill_s": float(gone_s[outside].min()) if outside.any() else np.nan,
        "failed": carried.failed,
    }


if __name__ == "__main__":
    command.run(main)
