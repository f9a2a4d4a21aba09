"""The paper's test: train on 50 trials of one object, test on its others and on those of all other objects (section IV-A)."""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from sklearn.pipeline import Pipeline

from pipeline.classify.regression import FPR_GRID, Score, classifier, iterations, score, separable
from pipeline.errors import PipelineError

MAX_REDRAWS = 1000


@dataclass
class Results:
    """Rows of the tables `predictions` (a frame a classifier), `scores` and `curves`."""

    predictions: list[pd.DataFrame] = field(default_factory=list)
    scores: list[dict[str, Any]] = field(default_factory=list)
    curves: list[pd.DataFrame] = field(default_factory=list)

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
    experiment = str(trials["experiment"].iloc[0])
    objects, labels = trials["object"].to_numpy(), trials[label].to_numpy(bool)
    for training_object in pd.unique(trials["object"]):
        own = np.flatnonzero(objects == training_object)
        for draw in range(draws):
            key = (seed, zlib.crc32(f"{experiment}/{training_object}".encode()), draw)
            chosen, redrawn = draw_training_set(
                labels[own], samples, key, name=f"{experiment}/{training_object}"
            )
            rows = own[chosen]
            for features, values in feature_sets.items():
                fitted = classifier(ridge).fit(values[rows], labels[rows])
                steps, converged = iterations(fitted)
                training = {
                    "n_iterations": steps,
                    "converged": converged,
                    "n_redrawn": redrawn,
                    "separable": separable(values[rows], labels[rows]),
                }
                head = {"experiment": experiment, "features": features}
                _test(results, fitted, head, draw, trials, values, labels, rows, training)
    return results


def _test(
    results: Results,
    fitted: Pipeline,
    head: dict[str, Any],
    draw: int,
    trials: pd.DataFrame,
    values: np.ndarray,
    labels: np.ndarray,
    training_rows: np.ndarray,
    training: dict[str, Any],
) -> None:
    training_object = trials["object"].iloc[training_rows[0]]
    probability = fitted.predict_proba(values)[:, 1]
    for split, rows in _splits(trials["object"].to_numpy(), training_object, training_rows):
        full = {**head, "split": split, "training_object": training_object, "draw": draw}
        results.add_score(full, score(labels[rows], probability[rows]), labels[rows], training)
        tested = {"test_object": trials["object"].to_numpy()[rows], "trial": trials["trial"].to_numpy()[rows]}
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
