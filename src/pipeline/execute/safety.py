"""How often motor primitives would tilt a cup too far outside the second container's opening, a pair: by drawing trajectories.

What is drawn is not executed and may be refused; lip and opening are where they really are, whatever the feature set believes.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline import artefacts, command

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.execute.primitives import Primitive


def main() -> None:
    """Write the probabilities of all pairs and motor primitives."""
    parser = command.parser(__doc__)
    parser.add_argument("--pairs", nargs="+", required=True, metavar="HELD/TARGET")
    parser.add_argument(
        "--containers", nargs="+", type=command.name_and_path, required=True, metavar="NAME=FILE"
    )
    parser.add_argument("--parameters", type=Path, required=True, help="warped parameters of all objects")
    parser.add_argument(
        "--primitives", nargs="+", type=command.name_and_path, required=True, metavar="FEATURES=FILE"
    )
    parser.add_argument("--demonstration", type=Path, required=True, help="pair.yaml of the demonstrations")
    parser.add_argument("--samples", type=int, default=2000, help="trajectories drawn a pair and primitive")
    parser.add_argument("--seed", type=int, default=8, help="of these")
    parser.add_argument("--safety", type=Path, required=True, help="where the table is written")
    options = parser.parse_args()

    import pandas as pd

    from pipeline.execute import primitives
    from pipeline.motion.demonstrations import read_pair

    parameters, shown = (
        artefacts.read_table(options.parameters, "parameters"),
        read_pair(options.demonstration),
    )
    demonstrated, containers = (shown["held_object"], shown["target_object"]), dict(options.containers)
    rows = []
    for pair in command.progress(options.pairs, len(options.pairs), "drawing pours: pairs"):
        held, target = pair.split("/")
        for features, path in options.primitives:
            primitive = primitives.read(path, parameters, features, (held, target), demonstrated)
            rng = np.random.default_rng(options.seed)
            found = tilted_outside(
                primitive, containers[held], containers[target], parameters, options.samples, rng
            )
            rows.append({"held_object": held, "target_object": target, "features": features, **found})
    artefacts.write_table(options.safety, pd.DataFrame(rows), "safety")


def tilted_outside(
    primitive: "Primitive",
    held: Path,
    target: Path,
    parameters: "pd.DataFrame",
    samples: int,
    rng: np.random.Generator,
) -> dict[str, Any]:
    """Return the shares of drawn trajectories, and their number, that tilt beyond the reference while the lip is outside.

    The ruler is the label mapping's for all: radius of the second's opening, tilt reference of the held.
    """
    from pipeline.execute import containers
    from pipeline.motion import safety, scaling

    task = primitive.task
    drawn = primitive.samples(np.linspace(0.0, 1.0, safety.STEPS), samples, rng)
    own = task.own(drawn, containers.lip_m(held, task.yaw_rad), containers.opening_m(target))
    radius_m, _, _, tilt_rad = scaling.factors(parameters, "label_mapping", *primitive.pair)
    way_in, ever = safety.unsafe(own, radius_m, tilt_rad)
    return {"samples": samples, "way_in": float(way_in.mean()), "ever": float(ever.mean())}


if __name__ == "__main__":
    command.run(main)
