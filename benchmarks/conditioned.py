"""How true the conditioned primitive is for a pair that it was not shown: each pair of `primitives.pairs` left out in its turn.

    python benchmarks/conditioned.py         in the project's folder, after snakemake reports/execution.pdf

Share of the values of the left-out pair's pours in the 95 % bands, and how far the mean is from theirs when the lip is over the
opening (phase 0.3 to 0.7), beside a primitive that is scaled by label mapping from one other pair (mean over these).
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from pipeline import command
from pipeline.artefacts import read_table
from pipeline.motion import demonstrations, phase, scaling
from pipeline.motion.conditioned import log_parameters
from pipeline.primitives import conditioned
from pipeline.primitives.learning import task_space, without_rests

MAPPING = "label_mapping"
AT = np.linspace(0.0, 1.0, 101)
THERE = (AT > 0.3) & (AT < 0.7)
_Z = 1.959964


def main() -> None:
    """Print a line a pair, and the means."""
    parser = command.parser(__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    for name, value in (("--processed", "data/processed"), ("--source", "mug")):
        parser.add_argument(name, default=value)
    options = parser.parse_args()
    processed = Path(options.processed)
    parameters, rims = (
        read_table(processed / "parametrise" / options.source / f"{name}.parquet", name)
        for name in ("parameters", "tilt_references")
    )
    folders = sorted(processed.glob("execute/*/*/demonstrations"))
    shown = [demonstrations.read(folder) for folder in folders]
    pours = [_values(one, parameters, rims) for one in shown]
    factors = [scaling.factors(parameters, MAPPING, one.held_object, one.target_object) for one in shown]
    rows = []
    for out, one in enumerate(shown):
        others = [each for number, each in enumerate(shown) if number != out]
        learnt = conditioned.learn(others, parameters, rims, n_basis=20, prior_demonstrations=5.0)
        given = learnt.given(log_parameters(parameters, MAPPING, one.held_object, one.target_object))
        inside = np.abs(pours[out] - given.mean(AT)) < _Z * given.deviation(AT)
        scaled = [pours[n].mean(axis=0) / factors[n] * factors[out] for n in range(len(shown)) if n != out]
        off = [
            np.abs(mean - pours[out].mean(axis=0))[THERE].mean(axis=0) for mean in (given.mean(AT), *scaled)
        ]
        rows.append([inside.mean(), *off[0], *np.mean(off[1:], axis=0)])
        _say(f"{one.held_object}/{one.target_object}", rows[-1])
    _say("mean", np.mean(rows, axis=0))


def _say(name: str, row: "np.ndarray | list[float]") -> None:
    inside, *off = row
    words = [
        f"{what}: x {1e3 * x:.0f} y {1e3 * y:.0f} z {1e3 * z:.0f} mm tilt {np.degrees(tilt):.0f} deg"
        for what, (x, y, z, tilt) in (("off", off[:4]), ("scaled from another", off[4:]))
    ]
    sys.stdout.write(f"{name:24} in the bands {100 * inside:5.1f} %   {'   '.join(words)}\n")


def _values(one: demonstrations.Demonstrations, parameters, rims) -> np.ndarray:
    """Return the pours (N, 101, 4) of a pair at even phases, metres and radians."""
    times_s, moving = without_rests(one, task_space(one, parameters, rims, MAPPING))
    phases = phase.aligned(times_s, [pour[:, 3] for pour in moving])
    return np.array(
        [
            np.column_stack([np.interp(AT, at, pour[:, d]) for d in range(4)])
            for at, pour in zip(phases, moving, strict=True)
        ]
    )


if __name__ == "__main__":
    command.run(main)
