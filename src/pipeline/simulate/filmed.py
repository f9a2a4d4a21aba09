"""Where the balls are in each frame of a film, as they are carried and as they fly: one execution again, watched."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipeline import artefacts, command
from pipeline.simulate import carry
from pipeline.simulate.carrying import carry as carried
from pipeline.simulate.carrying import motion

if TYPE_CHECKING:
    import pandas as pd

NOWHERE = np.zeros((0, 3))


class Recorder:
    """Balls' places (n, 3) in the world a frame, of the cup's and of the others apart."""

    def __init__(self, every_s: float) -> None:
        self.every_s = every_s
        self.seen: tuple[dict[int, np.ndarray], dict[int, np.ndarray]] = {}, {}

    def of(self, which: int):
        """Return what a simulation tells: only the first step of each frame is kept."""

        def watch(time_s: float, x_world: np.ndarray) -> None:
            self.seen[which].setdefault(int(time_s / self.every_s + 1e-6), x_world.copy())

        return watch

    def frames(self, count: int) -> list[np.ndarray]:
        """Return the balls (n, 3) in each frame; what lies still at the end of a simulation stays where it is."""
        latest, frames = [NOWHERE, NOWHERE], []
        for number in range(count):
            latest = [seen.get(number, last) for seen, last in zip(self.seen, latest, strict=True)]
            frames.append(np.concatenate(latest))
        return frames


def main() -> None:
    """Write the balls of one execution, frame by frame."""
    parser = carry.parser(__doc__)
    parser.add_argument("--features", default="label_mapping", help="whose motor primitive")
    parser.add_argument("--frames-a-second", type=int, default=12)
    parser.add_argument("--film", type=Path, required=True, help="where the balls are written (NPZ)")
    options = parser.parse_args()

    run = carry.first(options.trajectories, options.features)
    artefacts.write_arrays(options.film, _filmed(options, run) if len(run) else _nothing(options))


def _filmed(options: argparse.Namespace, run: "pd.DataFrame") -> artefacts.Arrays:
    draw = int(run["draw"].iloc[0])
    held, second = carry.pots(options, artefacts.read_arrays(options.target[1]))
    T_world_held, T_world_second = artefacts.poses(run), artefacts.T_world_second(run)
    time_s = run["t_s"].to_numpy()
    moving = motion(T_world_held, float(time_s[1] - time_s[0]), held.matter.step_s)
    recorder = Recorder(1.0 / options.frames_a_second)
    watch = recorder.of(0), recorder.of(1)
    carried(held, second, moving, T_world_second, options.balls, options.seed + draw, watch)
    frames = recorder.frames(int(time_s[-1] * options.frames_a_second) + 1)
    return {
        "balls_m": np.concatenate(frames),
        "counts": np.array([len(frame) for frame in frames]),
        "radius_m": np.array(held.radius_m),
        "draw": np.array(draw),
        "every_s": np.array(recorder.every_s),
    }


def _nothing(options: argparse.Namespace) -> artefacts.Arrays:
    """Return the film of no execution, as the arm could follow no sample: no frames, draw -1."""
    every_s = np.array(1.0 / options.frames_a_second)
    none = {"counts": np.zeros(0, int), "radius_m": np.array(0.0), "draw": np.array(-1)}
    return {"balls_m": NOWHERE, "every_s": every_s, **none}


if __name__ == "__main__":
    command.run(main)
