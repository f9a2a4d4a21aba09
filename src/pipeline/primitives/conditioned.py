"""Learn a motor primitive of pouring from demonstrations with several pairs, conditioned on the pair (section IV-C)."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipeline import artefacts, command

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.motion.conditioned import ConditionedProMP
    from pipeline.motion.demonstrations import Demonstrations

MAPPING = "label_mapping"


def main() -> None:
    """Read the demonstrations of all pairs and the warped parameters; write promp.json."""
    parser = command.parser(__doc__)
    parser.add_argument(
        "--demonstrations", nargs="+", type=Path, required=True, help="folders with pair.yaml and *.csv"
    )
    for option in ("--parameters", "--tilt-references"):
        parser.add_argument(option, type=Path, required=True, help="warped parameters of all objects")
    parser.add_argument("--basis", type=int, default=20, help="basis functions a dimension")
    parser.add_argument(
        "--prior-demonstrations", type=float, default=5.0, help="how many the prior counts as"
    )
    parser.add_argument("--primitive", type=Path, required=True, help="promp.json")
    options = parser.parse_args()

    from pipeline.motion import demonstrations
    from pipeline.motion.conditioned import HELD, TARGET

    shown = [demonstrations.read(folder) for folder in options.demonstrations]
    parameters = artefacts.read_table(options.parameters, "parameters")
    rims = artefacts.read_table(options.tilt_references, "tilt_references")
    learnt = learn(
        shown,
        parameters,
        rims,
        n_basis=options.basis,
        prior_demonstrations=options.prior_demonstrations,
    )
    pairs = [f"{one.held_object}/{one.target_object}" for one in shown]
    names = [f"held.{name}" for name in HELD] + [f"second.{name}" for name in TARGET]
    about = {"pours": sum(len(one.files) for one in shown), "pairs": pairs, "logarithms_of": names}
    artefacts.write_json(options.primitive, {**learnt.to_json(), "learnt_from": about})


def learn(
    shown: "list[Demonstrations]",
    parameters: "pd.DataFrame",
    rims: "pd.DataFrame",
    *,
    n_basis: int,
    prior_demonstrations: float,
) -> "ConditionedProMP":
    """Return the primitive, in metres and radians: rests cut off, phases aligned over all pairs.

    parameters, rims: the tables `parameters` and `tilt_references`. Errors: fewer than two pairs.
    """
    from pipeline.motion import phase
    from pipeline.motion.conditioned import ConditionedProMP, log_parameters
    from pipeline.primitives.learning import task_space, without_rests

    times_s: list[np.ndarray] = []
    trajectories: list[np.ndarray] = []
    contexts = []
    for one in shown:
        moments, moved = without_rests(one, task_space(one, parameters, rims, MAPPING))
        times_s, trajectories = times_s + moments, trajectories + moved
        own = log_parameters(parameters, MAPPING, one.held_object, one.target_object)
        contexts += [own] * len(moved)
    return ConditionedProMP.fit(
        trajectories,
        np.array(contexts),
        phase.aligned(times_s, [one[:, 3] for one in trajectories]),
        n_basis=n_basis,
        prior_demonstrations=prior_demonstrations,
        duration_s=float(np.mean([t[-1] - t[0] for t in times_s])),
    )


if __name__ == "__main__":
    command.run(main)
