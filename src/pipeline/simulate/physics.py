"""Measure the liquid against hydrostatics: in `references` of known shape, or in a scanned `object` and its finished trials."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline import artefacts, command

if TYPE_CHECKING:
    from pipeline.simulate.liquid import Vessel
    from pipeline.simulate.measures import Row

FILLS = (0.15, 0.30, 0.50, 0.70, 0.90)  # shares of the capacity
COUNTS = (20, 40, 60, 80, 100, 120, 140, 160, 200, 240, 280)
FULLEST = 0.9  # particles at rest, share of what a vessel holds
SPACINGS = (1.4, 1.0, 0.7)  # of the default
LEAK_TRIALS = 100


def main() -> None:
    """Read the options, run the checks and write their rows."""
    options = _options()
    import pandas as pd

    rows = _references(options) if options.what == "references" else _object(options)
    artefacts.write_table(options.measurements, pd.DataFrame(rows), "physics")


def _options() -> argparse.Namespace:
    parser = command.parser(__doc__)
    kinds = parser.add_subparsers(dest="what", required=True)
    formatter = argparse.ArgumentDefaultsHelpFormatter
    references = kinds.add_parser("references", allow_abbrev=False, formatter_class=formatter)
    one = kinds.add_parser("object", allow_abbrev=False, formatter_class=formatter)
    for kind in (references, one):
        kind.add_argument("--measurements", type=Path, required=True, help="where the rows are written")
        kind.add_argument("--spacing-m", type=float, default=0.010, help="default particle spacing")
        kind.add_argument("--seed", type=int, default=4, help="of the particles' jitter")
    one.add_argument("--object", required=True, help="name of the object")
    one.add_argument("--mesh", type=Path, required=True, help="its fused mesh (PLY, metres, upright)")
    one.add_argument("--pouring", type=Path, required=True, help="its finished pouring trials")
    one.add_argument("--filling", type=Path, required=True, help="its finished filling trials")
    one.add_argument("--held", nargs="+", required=True, metavar="NAME=MESH", help="held cups")
    one.add_argument("--threshold", type=int, default=1, help="particles that make a pour")
    one.add_argument("--convergence-trials", type=int, default=50, help="trials that run again")
    return parser.parse_args()


def _references(options: argparse.Namespace) -> "list[Row]":
    from pipeline.simulate import measures
    from pipeline.simulate.liquid import holds, vessel
    from pipeline.simulate.references import THIN_M, references

    rows: list[Row] = []
    for reference in references():
        cup, name = reference.cavity(), reference.name
        for spacing_m in (options.spacing_m, options.spacing_m / 2):
            ready = vessel(cup, spacing_m)
            command.say(f"{name}, {spacing_m * 1e3:g} mm: lowered by {ready.lowered:.2f} spacings")
            scale = round((options.spacing_m / spacing_m) ** 3)
            counts = [n * scale for n in COUNTS if n * scale <= FULLEST * holds(ready)]
            if scale == 1:
                for n in counts:
                    rows += measures.at_rest(reference, ready, n, options.seed)
                rows += measures.calming(name, ready, counts[len(counts) // 2], options.seed)
            if name != "bowl":
                for share in FILLS:
                    rows += measures.spill_angle(name, ready, share, options.seed)
    for reference in references(THIN_M):
        ready = vessel(reference.cavity(), options.spacing_m)
        rows += measures.leaks(reference.name, ready, LEAK_TRIALS, options.seed)
    return rows


def _object(options: argparse.Namespace) -> "list[Row]":
    from pipeline.simulate import measures
    from pipeline.simulate.liquid import vessel

    cup = _cavity(options.object, options.mesh)
    vessels = {factor: vessel(cup, factor * options.spacing_m) for factor in SPACINGS}
    rows = [row for factor in SPACINGS for row in measures.overflow(options.object, vessels[factor])]
    rows += measures.retained(options.object, vessels[1.0], options.seed)
    return rows + _convergence(options, (vessels[1.0], vessel(cup, options.spacing_m / 2)))


def _convergence(options: argparse.Namespace, pair: "tuple[Vessel, Vessel]") -> "list[Row]":
    from pipeline.simulate import convergence
    from pipeline.simulate.liquid import vessel

    name, n, rows = options.object, options.convergence_trials, []
    pours = artefacts.read_table(options.pouring, "trials").head(n)
    for found in command.progress(pours.itertuples(), len(pours), f"pouring {name} again"):
        trial = convergence.trial_of(found)
        rows += convergence.pouring(name, pair, trial, options.threshold)
    fillings = artefacts.read_table(options.filling, "trials").head(n)
    held = {name: pair}
    for cup_name, path in map(command.name_and_path, options.held):
        if cup_name in set(fillings["held_object"]) - {name}:
            cup = _cavity(cup_name, path)
            held[cup_name] = (vessel(cup, options.spacing_m), vessel(cup, options.spacing_m / 2))
    for found in command.progress(fillings.itertuples(), len(fillings), f"filling {name} again"):
        rows += convergence.filling(name, pair, held, convergence.trial_of(found))
    return rows


def _cavity(name: str, mesh: Path):
    from pipeline.geometry.cavity import cavity

    return cavity(*artefacts.read_mesh(mesh), name=name)


if __name__ == "__main__":
    command.run(main)
