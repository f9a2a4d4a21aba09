"""What `classify` starts from: its options, and trials, outcomes and features read from the files that they name."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipeline import command
from pipeline.artefacts import read_mesh, read_table

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.classify.features import Parameters
    from pipeline.classify.protocol import Protocol


@dataclass(frozen=True)
class Inputs:
    """All objects' trials without failed ones, whether each was a success (N,), and the features (N, F) of each set."""

    trials: "pd.DataFrame"
    labels: np.ndarray
    feature_sets: dict[str, np.ndarray]


def parser(doc: str | None) -> argparse.ArgumentParser:
    """Return the options of the stage."""
    options = command.parser(doc)
    options.add_argument("--experiment", choices=["pouring", "filling"], required=True)
    options.add_argument("--trials", type=Path, nargs="+", required=True, help="one table an object")
    options.add_argument("--parameters", type=Path, nargs="+", required=True, help="of all objects")
    options.add_argument("--tilt-references", type=Path, nargs="+", required=True, help="of all objects")
    options.add_argument("--samples", type=int, default=50, help="trials a classifier is trained on")
    options.add_argument("--draws", type=int, default=20, help="training sets an object")
    options.add_argument(
        "--penalty", choices=["ridge", "firth"], default="ridge", help="what keeps weights finite"
    )
    options.add_argument(
        "--ridge", type=float, default=1.0, help="weight of the squared standardised weights"
    )
    options.add_argument("--terms", choices=["linear", "quadratic"], default="linear")
    options.add_argument(
        "--volume", choices=["hull", "cavity"], default="hull", help="needs --meshes: cavity"
    )
    options.add_argument("--margin", choices=["none", "hull"], default="none", help="needs --clouds: hull")
    options.add_argument("--training-objects", type=int, default=1, help="objects a training set is from")
    options.add_argument("--held-cups", choices=["shared", "disjoint"], default="shared")
    options.add_argument(
        "--filled", choices=["none_outside", "none_spilled", "some_arrive"], default="none_outside"
    )
    options.add_argument("--meshes", nargs="+", default=[], metavar="NAME=FILE", help="fused meshes")
    options.add_argument("--clouds", nargs="+", default=[], metavar="NAME=FOLDER", help="of both mappings")
    options.add_argument("--resamples", type=int, default=500, help="bootstrap replicates over objects")
    options.add_argument("--seed", type=int, default=0)
    return options


def protocol(options: argparse.Namespace) -> "Protocol":
    """Return how classifiers are trained and tested."""
    from pipeline.classify.protocol import Protocol

    return Protocol(
        samples=options.samples,
        draws=options.draws,
        seed=options.seed,
        ridge=options.ridge,
        penalty=options.penalty,
        terms=options.terms,
        volume=options.volume,
        margin=options.margin,
        training_objects=options.training_objects,
        held_cups=options.held_cups,
    )


def read(options: argparse.Namespace) -> Inputs:
    """Read the files that the options name."""
    from pipeline.classify.features import FEATURE_SETS, MAPPINGS, features

    trials = _tables(options.trials, "trials")
    trials = trials[~trials["failed"]].reset_index(drop=True)
    mappings = {mapping: _parameters(options, mapping) for mapping in MAPPINGS}
    feature_sets = {
        name: features(trials, mappings.get(name, mappings["label_mapping"]), standard=name not in mappings)
        for name in FEATURE_SETS
    }
    if options.margin == "hull" and options.experiment == "pouring":
        for mapping in MAPPINGS:
            added = _margins(options, trials, mappings[mapping], mapping)
            feature_sets[mapping] = np.column_stack([feature_sets[mapping], added])
    return Inputs(trials, outcomes(trials, options.experiment, options.filled), feature_sets)


def outcomes(trials: "pd.DataFrame", experiment: str, filled: str) -> np.ndarray:
    """Return whether each trial (N,) poured or filled, by one of the readings of `filled`.

    none_outside: what stays in the held cup is outside, too. none_spilled: it is not. some_arrive: the second holds more than
    before.
    """
    if experiment == "pouring":
        return trials["poured"].to_numpy(bool)
    if filled == "none_outside":
        return trials["filled"].to_numpy(bool)
    lost = trials["n_spilled"] + trials["n_leaked"]
    arrived = trials["n_left"] - lost
    return (lost == 0 if filled == "none_spilled" else arrived > 0).to_numpy(bool)


def _tables(paths: Sequence[Path], table: str) -> "pd.DataFrame":
    import pandas as pd

    return pd.concat([read_table(path, table) for path in paths], ignore_index=True)


def _parameters(options: argparse.Namespace, mapping: str) -> "Parameters":
    from pipeline.classify.features import parameters_of

    found = parameters_of(
        _tables(options.parameters, "parameters"),
        _tables(options.tilt_references, "tilt_references"),
        mapping,
    )
    if options.volume == "hull":
        return found
    from pipeline.classify.cavities import with_cavities

    return with_cavities(
        found, {name: read_mesh(path) for name, path in map(command.name_and_path, options.meshes)}
    )


def _margins(
    options: argparse.Namespace, trials: "pd.DataFrame", parameters: "Parameters", mapping: str
) -> np.ndarray:
    from pipeline.classify.cavities import margins

    folders = dict(map(command.name_and_path, options.clouds))
    clouds = {name: read_table(folder / f"{mapping}.parquet", "mapping") for name, folder in folders.items()}
    return margins(trials, parameters, clouds)
