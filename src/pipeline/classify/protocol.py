"""The paper's test: train on 50 trials of one object, test on its others and on those of all other objects (section IV-A)."""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from pipeline.classify.regression import FPR_GRID, Score, classifier, iterations, score, separable
from pipeline.classify.trained import trained
from pipeline.errors import PipelineError
from pipeline.models import Model

MAX_REDRAWS = 1000


@dataclass
class Results:
    """Rows of the tables `predictions` (a frame a classifier), `scores` and `curves`, and the classifiers themselves."""

    predictions: list[pd.DataFrame] = field(default_factory=list)
    scores: list[dict[str, Any]] = field(default_factory=list)
    curves: list[pd.DataFrame] = field(default_factory=list)
    models: list[Model] = field(default_factory=list)

    def add_score(
        self, head: dict[str, Any], outcome: Score, labels: np.ndarray, training: dict[str, Any]
    ) -> None:
        """Record how one classifier did on one split."""
        rates = {f"tpr_at_fpr_{percent:02d}": outcome.tpr_at(percent / 100) for percent in (0, 1, 5)}
        counts = {"n_test": len(labels), "n_positive": int(labels.sum())}
        self.scores.append(
            {**head, "auc": outcome.auc, "brier": outcome.brier, **rates, **counts, **training}
        )
        self.curves.append(pd.DataFrame({**head, "fpr": FPR_GRID, "tpr": outcome.tpr}))


def draw_training_set(
    labels: np.ndarray, samples: int, seed: tuple[int, ...], *, name: str
) -> tuple[np.ndarray, int]:
    """Return the rows of a random training set with both classes, and how often a set of one class was redrawn."""
    if len(labels) <= samples or labels.all() or not labels.any():
        raise PipelineError(
            f"{name}: expected more than {samples} trials with both outcomes, found {len(labels)} trials, "
            f"{int(labels.sum())} of them positive; raise its number of trials or lower classify.samples"
        )
    rng = np.random.default_rng(seed)
    for redrawn in range(MAX_REDRAWS):
        rows = rng.choice(len(labels), samples, replace=False)
        if 0 < labels[rows].sum() < samples:
            return rows, redrawn
    raise PipelineError(f"{name}: {MAX_REDRAWS} training sets of {samples} trials had one outcome only")


def evaluate(
    trials: pd.DataFrame,
    label: str,
    feature_sets: dict[str, np.ndarray],
    *,
    samples: int,
    draws: int,
    ridge: float,
    seed: int,
) -> Results:
    """Train and test every feature set on every object; `trials` (N rows), `label` a column, features (N, F) each.

    All feature sets see the same draws. The draws of an object depend on its name and the seed alone.
    """
    results = Results()
    labels = trials[label].to_numpy(bool)
    for head, rows, redrawn in _training_sets(trials, labels, samples, draws, seed):
        for features, values in feature_sets.items():
            fitted = classifier(ridge).fit(values[rows], labels[rows])
            n_iterations, converged = iterations(fitted)
            training = {
                **{"n_iterations": n_iterations, "converged": converged, "n_redrawn": redrawn},
                "separable": separable(values[rows], labels[rows]),
            }
            results.models.append(trained(fitted, {**head, "features": features}, ridge, len(rows), training))
            probability = fitted.predict_proba(values)[:, 1]
            _test(results, {**head, "features": features}, trials, labels, probability, rows, training)
    return results


def _training_sets(
    trials: pd.DataFrame, labels: np.ndarray, samples: int, draws: int, seed: int
) -> Iterator[tuple[dict[str, Any], np.ndarray, int]]:
    """Yield for each object and draw: what it is called, the rows drawn, and how often they were redrawn."""
    experiment = str(trials["experiment"].iloc[0])
    for name in pd.unique(trials["object"]):
        own = np.flatnonzero(trials["object"] == name)
        for draw in range(draws):
            key = (seed, zlib.crc32(f"{experiment}/{name}".encode()), draw)
            chosen, redrawn = draw_training_set(labels[own], samples, key, name=f"{experiment}/{name}")
            yield {"experiment": experiment, "training_object": name, "draw": draw}, own[chosen], redrawn


def _test(
    results: Results,
    head: dict[str, Any],
    trials: pd.DataFrame,
    labels: np.ndarray,
    probability: np.ndarray,
    training_rows: np.ndarray,
    training: dict[str, Any],
) -> None:
    objects = trials["object"].to_numpy()
    for split, rows in _splits(objects, head["training_object"], training_rows):
        full = {**head, "split": split}
        results.add_score(full, score(labels[rows], probability[rows]), labels[rows], training)
        tested = {"test_object": objects[rows], "trial": trials["trial"].to_numpy()[rows]}
        outcome = {"probability": probability[rows].astype(np.float32), "label": labels[rows]}
        results.predictions.append(pd.DataFrame({**full, **tested, **outcome}))


def _splits(
    objects: np.ndarray, training_object: str, training_rows: np.ndarray
) -> Iterator[tuple[str, np.ndarray]]:
    own = np.flatnonzero(objects == training_object)
    yield "same", np.setdiff1d(own, training_rows)
    novel = np.flatnonzero(objects != training_object)
    if len(novel):
        yield "novel", novel


def ceiling(trials: pd.DataFrame, label: str, results: Results) -> None:
    """Add the hydrostatic answer to the same trials as features `hydrostatic`: nothing is trained, draw 0."""
    training = {"n_iterations": 0, "converged": True, "n_redrawn": 0, "separable": False}
    objects = trials["object"].to_numpy()
    labels, margins = trials[label].to_numpy(bool), trials["hydrostatic_margin"].to_numpy()
    for name in pd.unique(trials["object"]):
        for split, rows in _splits(objects, name, np.array([], dtype=int)):
            head = {"experiment": trials["experiment"].iloc[0], "features": "hydrostatic", "split": split}
            outcome = score(labels[rows], margins[rows], margins=True)
            results.add_score({**head, "training_object": name, "draw": 0}, outcome, labels[rows], training)
