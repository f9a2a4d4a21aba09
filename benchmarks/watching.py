"""How long a robot waits for an answer: p(pour) and p(fill) of one state, from the classifiers of the last run.

python benchmarks/watching.py            in the project's folder, after snakemake reports/roc.pdf
"""

import argparse
import sys
import time

import numpy as np

from pipeline import command, watching

CALLS = 20_000


def main() -> None:
    """Print microseconds a call: median and the slowest in a hundred, a line a feature set."""
    parser = command.parser(__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    for name, value in (("--processed", "data/processed"), ("--source", "mug")):
        parser.add_argument(name, default=value)
    parser.add_argument("--pair", default="tall_cup/wide_bowl", help="held/target")
    options = parser.parse_args()
    held, target = options.pair.split("/")
    states = np.random.default_rng(1).uniform([-0.2, -0.02, 0.0, 0.0], [0.0, 0.02, 0.2, 2.0], (CALLS, 4))
    for features in ("label_mapping", "point_mapping", "standard"):
        one = watching.from_run(options.processed, options.source, held, target, features=features)
        taken_us = np.zeros(CALLS)
        for number, (*lip_m, tilt_rad) in enumerate(states):
            begun = time.perf_counter()
            one.watch(lip_m, tilt_rad, 2e-4)
            taken_us[number] = 1e6 * (time.perf_counter() - begun)
        slowest = np.quantile(taken_us, 0.99)
        sys.stdout.write(
            f"{features:15} median {np.median(taken_us):6.1f} us, 99 % below {slowest:6.1f} us\n"
        )


if __name__ == "__main__":
    command.run(main)
