"""Learn a motor primitive of pouring from demonstrations with one pair, in the space of one feature set."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline import artefacts, command
from pipeline.errors import PipelineError

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.motion.demonstrations import Demonstrations
    from pipeline.primitives.learning import Learnt

FEATURES = ("label_mapping", "point_mapping", "standard")


def main() -> None:
    """Read the demonstrations and the pair's warped parameters; write promp.json and what it was learnt from."""
    parser = command.parser(__doc__)
    parser.add_argument("--demonstrations", type=Path, required=True, help="folder with pair.yaml and *.csv")
    for option in ("--parameters", "--tilt-references"):
        parser.add_argument(option, type=Path, required=True, help="warped parameters of all objects")
    parser.add_argument("--features", choices=FEATURES, required=True)
    parser.add_argument("--basis", type=int, default=20, help="basis functions a dimension")
    parser.add_argument(
        "--prior-demonstrations", type=float, default=5.0, help="how many the prior counts as"
    )
    parser.add_argument("--samples", type=int, default=2000, help="trajectories drawn to tell how safe it is")
    parser.add_argument("--seed", type=int, default=0, help="of these")
    parser.add_argument("--primitive", type=Path, required=True, help="promp.json")
    parser.add_argument("--trajectories", type=Path, required=True, help="what it was learnt from, a table")
    options = parser.parse_args()

    from pipeline.motion import demonstrations
    from pipeline.primitives.learning import learn

    shown = demonstrations.read(options.demonstrations)
    parameters = artefacts.read_table(options.parameters, "parameters")
    rims = artefacts.read_table(options.tilt_references, "tilt_references")
    try:
        learnt = learn(
            shown,
            parameters,
            rims,
            options.features,
            n_basis=options.basis,
            prior_demonstrations=options.prior_demonstrations,
        )
    except PipelineError as error:
        raise PipelineError(f"{options.demonstrations}: {error}") from error
    about = {
        **{"features": options.features, "pours": len(shown.files), "references": learnt.references.tolist()},
        **{"held_object": shown.held_object, "target_object": shown.target_object},
        "tilted_outside": _safety(learnt, parameters, shown, options.samples, options.seed),
    }
    artefacts.write_json(options.primitive, {**learnt.promp.to_json(), "learnt_from": about})
    artefacts.write_table(options.trajectories, _table(learnt), "demonstrations")


def _safety(
    learnt: "Learnt", parameters: "pd.DataFrame", shown: "Demonstrations", samples: int, seed: int
) -> dict[str, Any]:
    """Return how often the primitive, with the demonstrated pair, tilts too far outside; the ruler is the label mapping for all."""
    from pipeline.motion import scaling
    from pipeline.motion.safety import safety

    ruler = scaling.factors(parameters, "label_mapping", shown.held_object, shown.target_object)
    measured = learnt.promp.scaled(learnt.references / ruler)
    return asdict(safety(measured, np.random.default_rng(seed), samples=samples))


def _table(learnt: "Learnt") -> "pd.DataFrame":
    import pandas as pd

    names = ["x", "y", "z", "tilt"]
    rows = [
        pd.DataFrame(one, columns=names).assign(pour=number, phase=phase)
        for number, (one, phase) in enumerate(zip(learnt.trajectories, learnt.phases, strict=True))
    ]
    return pd.concat(rows, ignore_index=True)


if __name__ == "__main__":
    command.run(main)
