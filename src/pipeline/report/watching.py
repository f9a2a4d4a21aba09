"""What the classifiers say along executed pours: p(pour) against the first drop, p(fill) against the first spill."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipeline import command
from pipeline.artefacts import read_table, write_json

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.models import Model
    from pipeline.watching import Portion, Watcher

SETS = ("label_mapping", "point_mapping", "standard")


def main() -> None:
    """Read trajectories, what was poured along them, and classifiers; write the pages and the numbers."""
    parser = command.parser(__doc__)
    parser.add_argument("--source", required=True, help="whose trials the classifiers learnt from")
    parser.add_argument("--pouring", type=Path, required=True, help="models.json of pouring")
    parser.add_argument("--filling", type=Path, required=True, help="models.json of filling")
    parser.add_argument("--parameters", type=Path, required=True, help="warped parameters of all objects")
    parser.add_argument("--trajectories", type=Path, required=True, help="what the arm did, all pairs")
    for contents in ("balls", "liquid"):
        parser.add_argument(
            f"--{contents}", nargs="+", type=Path, required=True, help="outcomes of all pairs"
        )
    parser.add_argument("--fill", type=float, default=0.5, help="share of the held cup's capacity")
    parser.add_argument("--held-particles", type=int, default=10, help="of the trials of filling")
    parser.add_argument("--spacing-m", type=float, default=0.010, help="of their particles")
    parser.add_argument("--tilt-deg", type=float, default=120.0, help="how far these trials tilt")
    for name in ("--pages", "--numbers"):
        parser.add_argument(name, type=Path, required=True)
    options = parser.parse_args()

    import pandas as pd

    from pipeline.models import read_models
    from pipeline.report import watching_numbers, watching_page
    from pipeline.report.style import save
    from pipeline.watching import Portion

    parameters = read_table(options.parameters, "parameters")
    trajectories = read_table(options.trajectories, "trajectories")
    outcomes = {
        contents: pd.concat([read_table(path, "carried") for path in getattr(options, contents)])
        for contents in ("balls", "liquid")
    }
    models = read_models(options.pouring) + read_models(options.filling)
    portion = Portion(options.held_particles * options.spacing_m**3, np.radians(options.tilt_deg))
    learnt = _watchers(models, parameters, trajectories, options.source, portion)
    warped = parameters[parameters["mapping"] == "label_mapping"].set_index("object")
    fill_m3, radius_m = options.fill * warped["capacity_m3"], warped["radius_m"]
    with command.steps("what the classifiers say along pours", 3) as tell:
        tell("curves")
        curves = watching_numbers.curves(trajectories, learnt, fill_m3, radius_m)
        tell("events")
        events = watching_numbers.events(curves, outcomes)
        tell("pages")
        save([watching_page.moments(curves, outcomes), watching_page.leads(events)], options.pages)
    write_json(options.numbers, watching_numbers.numbers(events))


def _watchers(
    models: "list[Model]",
    parameters: "pd.DataFrame",
    trajectories: "pd.DataFrame",
    training_object: str,
    portion: "Portion",
) -> "dict[tuple[str, str, str], Watcher]":
    """Return a watcher for each (held, target, feature set of its classifiers)."""
    from pipeline.models import chosen
    from pipeline.watching import pair_watcher

    of = {
        (experiment, features): chosen(
            [model for model in models if model.experiment == experiment], features, training_object
        )
        for experiment in ("pouring", "filling")
        for features in SETS
    }
    pairs = trajectories[["held_object", "target_object"]].drop_duplicates().itertuples(index=False)
    return {
        (held, target, features): pair_watcher(
            *(of["pouring", features], of["filling", features], parameters, features, held, target, portion)
        )
        for held, target in pairs
        for features in SETS
    }


if __name__ == "__main__":
    command.run(main)
