"""Simulate an object's trials: `prepare` it, then `pouring` from it, or `filling` it from held cups (paper, Section IV-A)."""

import argparse
from pathlib import Path

import numpy as np

from pipeline import artefacts, command


def main() -> None:
    """Read the options; prepare an object, or run all trials of one object and experiment, in one process."""
    options = _options()
    if options.experiment == "prepare":
        _prepare(options)
    else:
        import pandas as pd

        rows = _pouring(options) if options.experiment == "pouring" else _filling(options)
        artefacts.write_table(options.trials_table, pd.DataFrame(rows), "trials")


def _options() -> argparse.Namespace:
    parser = command.parser(__doc__)
    experiments = parser.add_subparsers(dest="experiment", required=True)
    prepare, pouring, filling = (
        experiments.add_parser(
            name, help=text, allow_abbrev=False, formatter_class=argparse.ArgumentDefaultsHelpFormatter
        )
        for name, text in (
            ("prepare", "make the object ready, once for all its trials"),
            ("pouring", "tilt the object, filled at random"),
            ("filling", "pour into the object"),
        )
    )
    prepare.add_argument("--object", required=True, help="name of the object")
    prepare.add_argument("--mesh", type=Path, required=True, help="its fused mesh (PLY, metres, upright)")
    prepare.add_argument("--spacing-m", type=float, default=0.010, help="particle spacing")
    prepare.add_argument("--container", type=Path, required=True, help="where it is written (NPZ)")
    for experiment in (pouring, filling):
        experiment.add_argument("--object", required=True, help="name of the object")
        experiment.add_argument("--container", type=Path, required=True, help="what `prepare` made of it")
        experiment.add_argument(
            "--trials-table", type=Path, required=True, help="where the trials are written"
        )
        experiment.add_argument(
            "--engine", default="liquid", help="what is poured: liquid, bullet or bullet_fluid"
        )
        experiment.add_argument(
            "--device", default="cpu", choices=("cpu", "cuda"), help="what the liquid is computed on"
        )
        experiment.add_argument(
            "--ranges",
            default="relative",
            choices=("relative", "absolute"),
            help="to the objects, or absolute",
        )
        experiment.add_argument("--seed", type=int, default=4, help="of the whole experiment")
        experiment.add_argument("--trials", type=int, default=1000, help="number of trials")
    pouring.add_argument("--fill-min", type=float, default=0.05, help="least fill, share of the capacity")
    pouring.add_argument("--fill-max", type=float, default=1.0, help="largest fill, share of the capacity")
    pouring.add_argument("--tilt-max-deg", type=float, default=120.0, help="largest tilt")
    pouring.add_argument("--threshold", type=int, default=1, help="particles that make a pour")
    filling.add_argument(
        "--held", nargs="+", required=True, metavar="NAME=FILE", help="held cups, prepared, in order"
    )
    filling.add_argument("--held-particles", type=int, default=10, help="particles in the held cup")
    filling.add_argument("--tilt-deg", type=float, default=120.0, help="tilt of the held cup")
    filling.add_argument(
        "--offset-max-radii", type=float, default=1.5, help="largest |dx|, |dy|, radii of the object"
    )
    filling.add_argument(
        "--height-min", type=float, default=0.1, help="least height, heights of the held cup"
    )
    filling.add_argument(
        "--height-max", type=float, default=1.0, help="largest height, heights of the held cup"
    )
    filling.add_argument(
        "--free-room-max-particles",
        type=int,
        default=20,
        help="most free room in the nearly full half, particles",
    )
    return parser.parse_args()


def _prepare(options: argparse.Namespace) -> None:
    from pipeline.simulate import prepared

    mesh = artefacts.read_mesh(options.mesh)
    with command.steps(f"preparing {options.object}", 4) as tell:
        ready = prepared.container(options.object, *mesh, options.spacing_m, tell=tell)
        tell("liquid at rest at every level")
        arrays = prepared.to_arrays(ready)
    artefacts.write_arrays(options.container, arrays)


def _pouring(options: argparse.Namespace) -> list[dict]:
    from pipeline.simulate import batches, draws, engines, prepared, trials

    engine, card = engines.engine(options.engine), batches.card(options.device, options.engine)
    protocol = draws.Pouring(
        options.fill_min,
        options.fill_max,
        float(np.radians(options.tilt_max_deg)),
        options.threshold,
        options.ranges,
    )
    cup = prepared.from_arrays(options.object, artefacts.read_arrays(options.container), engine)
    numbers = command.progress(range(options.trials), options.trials, f"pouring {options.object}")
    if card:
        return batches.pourings(
            card, (trials.pouring(cup, protocol, number, options.seed) for number in numbers)
        )
    return [trials.pouring_trial(cup, protocol, number, options.seed) for number in numbers]


def _filling(options: argparse.Namespace) -> list[dict]:
    from pipeline.simulate import batches, draws, engines, prepared, trials

    engine, card = engines.engine(options.engine), batches.card(options.device, options.engine)
    protocol = draws.Filling(
        held_particles=options.held_particles,
        tilt_rad=float(np.radians(options.tilt_deg)),
        offset_max_radii=options.offset_max_radii,
        height_min=options.height_min,
        height_max=options.height_max,
        free_room_max_particles=options.free_room_max_particles,
        ranges=options.ranges,
    )
    second = prepared.from_arrays(options.object, artefacts.read_arrays(options.container), engine)
    held = [
        prepared.from_arrays(name, artefacts.read_arrays(path), engine)
        for name, path in map(command.name_and_path, options.held)
    ]
    numbers = command.progress(range(options.trials), options.trials, f"filling {options.object}")
    with trials.FillingExperiment(second, held, protocol) as experiment:
        if card:
            return batches.fillings(card, (experiment.filling(number, options.seed) for number in numbers))
        return [experiment.trial(number, options.seed) for number in numbers]


if __name__ == "__main__":
    command.run(main)
