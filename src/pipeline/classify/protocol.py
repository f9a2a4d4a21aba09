"""The paper's test: train on 50 trials of one object, test on its others and on those of all other objects (section IV-A)."""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from sklearn import config_context

from pipeline.classify.regression import FPR_GRID, Score, classifier, iterations, score, separable
from pipeline.classify.trained import trained
from pipeline.command import progress
from pipeline.errors import PipelineError
from pipeline.models import Model
from pipeline.statistics.resampling import Resampled

MAX_REDRAWS = 1000


@dataclass(frozen=True)
class Protocol:
    """How classifiers are trained and tested; the defaults are the paper's, and what it leaves open.

    A set of `samples` trials is from `training_objects` objects. held_cups disjoint: half of the held cups, drawn anew for each
    set, are in training sets, the others in tests.
    """

    samples: int
    draws: int
    seed: int
    ridge: float = 1.0
    penalty: str = "ridge"
    terms: str = "linear"
    volume: str = "hull"
    margin: str = "none"
    training_objects: int = 1
    held_cups: str = "shared"


@dataclass(frozen=True)
class TrainingSet:
    """The rows of a training set, how often it was redrawn, and which rows (N,) its classifiers may be tested on."""

    training_objects: tuple[str, ...]
    draw: int
    rows: np.ndarray
    n_redrawn: int
    testable: np.ndarray


@dataclass
class Results:
    """What classifiers did: rows of the table `scores`, the classifiers themselves, and what two more tables are made of."""

    resampled: Resampled
    keep_predictions: bool = True
    scores: list[dict[str, Any]] = field(default_factory=list)
    models: list[Model] = field(default_factory=list)
    _curves: list[tuple[dict[str, Any], np.ndarray]] = field(default_factory=list)
    _tested: list[tuple[dict[str, Any], np.ndarray, np.ndarray]] = field(default_factory=list)

    def add_score(
        self, head: dict[str, Any], outcome: Score, labels: np.ndarray, training: dict[str, Any]
    ) -> None:
        """Record how one classifier did on one split."""
        rates = {f"tpr_at_fpr_{percent:02d}": outcome.tpr_at(percent / 100) for percent in (0, 1, 5)}
        counts = {"n_test": len(labels), "n_positive": int(labels.sum())}
        self.scores.append(
            {**head, "auc": outcome.auc, "brier": outcome.brier, **rates, **counts, **training}
        )
        self._curves.append((head, outcome.tpr))

    def add_predictions(self, head: dict[str, Any], rows: np.ndarray, probability: np.ndarray) -> None:
        """Record what one classifier said of some rows of the trials, both (n,)."""
        if self.keep_predictions:
            self._tested.append((head, rows, probability.astype(np.float32)))

    def curves(self) -> pd.DataFrame:
        """Return the table `curves`."""
        heads = _repeated([head for head, _ in self._curves], [len(FPR_GRID)] * len(self._curves))
        tpr = np.concatenate([tpr for _, tpr in self._curves])
        return heads.assign(fpr=np.tile(FPR_GRID, len(self._curves)), tpr=tpr)

    def predictions(self, trials: pd.DataFrame, labels: np.ndarray) -> pd.DataFrame:
        """Return the table `predictions` of the trials (N rows) and labels (N,) that were tested on."""
        heads = _repeated([head for head, _, _ in self._tested], [len(rows) for _, rows, _ in self._tested])
        rows = np.concatenate([rows for _, rows, _ in self._tested])
        return heads.assign(
            test_object=trials["object"].astype("category").array.take(rows),
            trial=trials["trial"].to_numpy()[rows],
            probability=np.concatenate([probability for _, _, probability in self._tested]),
            label=labels[rows],
        )


def _repeated(heads: list[dict[str, Any]], counts: list[int]) -> pd.DataFrame:
    """Return a table in which row k repeats heads[k] counts[k] times; texts as categories, of which there are few."""
    table = pd.DataFrame(heads)
    texts = [name for name, value in heads[0].items() if isinstance(value, str)]
    each = table.astype(dict.fromkeys(texts, "category"))
    return each.take(np.repeat(np.arange(len(each)), counts)).reset_index(drop=True)


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


# Thousands of small fits: scikit-learn would check its parameters each time.
@config_context(skip_parameter_validation=True)
def evaluate(
    trials: pd.DataFrame,
    labels: np.ndarray,
    feature_sets: dict[str, np.ndarray],
    protocol: Protocol,
    results: Results,
    told: str = "",
) -> None:
    """Train and test every feature set on every object: `trials` (N rows), labels (N,), features (N, F) each.

    All feature sets see the same draws. The draws of an object depend on its name and the seed alone. `told`: what progress is
    called, none when empty.
    """
    experiment = str(trials["experiment"].iloc[0])
    sets, total = training_sets(trials, labels, protocol), trials["object"].nunique() * protocol.draws
    objects = trials["object"].to_numpy()
    groups = results.resampled.groups(objects)
    for drawn in progress(sets, total, told) if told else sets:
        tests = list(splits(objects, drawn))
        for features, values in feature_sets.items():
            fitted, training = fit(values[drawn.rows], labels[drawn.rows], protocol, drawn.n_redrawn)
            results.models.append(trained(fitted, experiment, features, drawn, protocol, training))
            probability = fitted.predict_proba(values)[:, 1]
            head = {"experiment": experiment, "features": features, "draw": drawn.draw}
            for split, rows in tests:
                full = {**head, "training_object": drawn.training_objects[0], "split": split}
                _test(results, full, rows, labels[rows], probability[rows], groups[rows], training)


def fit(
    values: np.ndarray, labels: np.ndarray, protocol: Protocol, n_redrawn: int
) -> tuple[Any, dict[str, Any]]:
    """Return a classifier fitted to features (N, F) and labels (N,), and what is to be said of the fit."""
    fitted = classifier(protocol.ridge, protocol.penalty, protocol.terms).fit(values, labels)
    n_iterations, converged = iterations(fitted)
    terms = fitted[:-1].transform(values)
    training = {"n_iterations": n_iterations, "converged": converged, "n_redrawn": n_redrawn}
    return fitted, {**training, "separable": separable(terms, labels)}


def training_sets(trials: pd.DataFrame, labels: np.ndarray, protocol: Protocol) -> Iterator[TrainingSet]:
    """Yield the training sets of each object and draw."""
    experiment = str(trials["experiment"].iloc[0])
    objects = trials["object"].to_numpy()
    for name in pd.unique(trials["object"]):
        for draw in range(protocol.draws):
            key = (protocol.seed, zlib.crc32(f"{experiment}/{name}".encode()), draw)
            chosen = _training_objects(str(name), objects, protocol, key)
            for_training, testable = _held_cups(trials, protocol, key)
            own = np.flatnonzero(np.isin(objects, chosen) & for_training)
            rows, redrawn = draw_training_set(labels[own], protocol.samples, key, name=f"{experiment}/{name}")
            yield TrainingSet(chosen, draw, own[rows], redrawn, testable)


def _training_objects(
    name: str, objects: np.ndarray, protocol: Protocol, key: tuple[int, ...]
) -> tuple[str, ...]:
    """Return the object and as many others, at random, as the protocol asks for."""
    others = [str(other) for other in pd.unique(objects) if other != name]
    n_others = min(protocol.training_objects - 1, max(0, len(others) - 1))  # one stays novel
    return (name, *np.random.default_rng((*key, 2)).choice(others, n_others, replace=False).tolist())


def _held_cups(
    trials: pd.DataFrame, protocol: Protocol, key: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Return which trials (N,) may train and which may test; in pouring, where the cup is the object, all may."""
    held = trials["held_object"].to_numpy()
    if protocol.held_cups == "shared" or (held == trials["object"]).all():
        every = np.ones(len(trials), dtype=bool)
        return every, every
    cups = np.random.default_rng((*key, 1)).permutation(np.unique(held.astype(str)))
    for_training = np.isin(held, cups[: (len(cups) + 1) // 2])
    return for_training, ~for_training


def _test(
    results: Results,
    head: dict[str, Any],
    rows: np.ndarray,
    labels: np.ndarray,
    probability: np.ndarray,
    groups: np.ndarray,
    training: dict[str, Any],
) -> None:
    """Record what one classifier said of some `rows` of the trials, their labels, and their objects by number, all (n,)."""
    results.add_score(head, score(labels, probability), labels, training)
    key = head["features"], head["split"]
    results.resampled.add(key, head["training_object"], groups, labels, probability)
    results.add_predictions(head, rows, probability)


def splits(objects: np.ndarray, drawn: TrainingSet) -> Iterator[tuple[str, np.ndarray]]:
    """Yield `same` and the rows of the training objects that were not drawn, then `novel` and those of other objects."""
    own = np.isin(objects, drawn.training_objects)
    yield "same", np.setdiff1d(np.flatnonzero(own & drawn.testable), drawn.rows)
    novel = np.flatnonzero(~own & drawn.testable)
    if len(novel):
        yield "novel", novel


def ceiling(trials: pd.DataFrame, labels: np.ndarray, results: Results) -> None:
    """Add the hydrostatic answer to the same trials as features `hydrostatic`: nothing is trained, draw 0."""
    training = {"n_iterations": 0, "converged": True, "n_redrawn": 0, "separable": False}
    objects, margins = trials["object"].to_numpy(), trials["hydrostatic_margin"].to_numpy()
    every, groups = np.ones(len(trials), dtype=bool), results.resampled.groups(objects)
    for name in map(str, pd.unique(trials["object"])):
        for split, rows in splits(objects, TrainingSet((name,), 0, np.array([], dtype=int), 0, every)):
            head = {"experiment": trials["experiment"].iloc[0], "features": "hydrostatic", "split": split}
            outcome = score(labels[rows], margins[rows], margins=True)
            results.add_score({**head, "training_object": name, "draw": 0}, outcome, labels[rows], training)
            results.resampled.add(
                ("hydrostatic", split), name, groups[rows], labels[rows], margins[rows], margins=True
            )
