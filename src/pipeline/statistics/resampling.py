"""Bootstrap over objects, jointly as trainers and as tests; replicate 0 has each object once.

Objects are what is sampled: trials of one object share its shape, so more of them tell nothing about other objects. A replicate
draws objects with replacement. A classifier counts as often as its training object was drawn, a novel trial as often as its own
object was; an object drawn twice is still no novel one to itself. Every table made from the same names and seed has the same
replicates, so that two of them can be compared replicate by replicate.
"""

from collections import defaultdict
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from pipeline.statistics.rates import MEASURES, weighted_rates

COLUMNS = (*MEASURES, "brier")
LEVEL = 0.95


def object_weights(n_objects: int, n_replicates: int, seed: int) -> np.ndarray:
    """Return how often each object counts (1 + n_replicates, n_objects): row 0 once each, then bootstrap draws.

    With two objects or more, a draw of one object alone is drawn again: it has no novel ones.
    """
    rng = np.random.default_rng(seed)
    rows = [np.ones(n_objects)]
    while len(rows) <= n_replicates:
        row = np.bincount(rng.integers(n_objects, size=n_objects), minlength=n_objects).astype(float)
        if np.count_nonzero(row) > 1 or n_objects == 1:
            rows.append(row)
    return np.array(rows)


@dataclass
class Resampled:
    """Collects the tests of classifiers; `names` are all objects, `weights` (R, G) theirs by `object_weights`."""

    names: list[str]
    weights: np.ndarray
    _values: dict[tuple, list[np.ndarray]] = field(default_factory=lambda: defaultdict(list))
    _pairs: dict[tuple, list[np.ndarray]] = field(default_factory=lambda: defaultdict(list))

    def groups(self, objects: np.ndarray) -> np.ndarray:
        """Return the number (N,) in `names` of each of `objects` (N,)."""
        return pd.Index(self.names).get_indexer(objects)

    def add(
        self,
        key: tuple,
        trainer: str,
        groups: np.ndarray,
        labels: np.ndarray,
        scores: np.ndarray,
        *,
        margins: bool = False,
    ) -> None:
        """Add one classifier's test on trials (N,) of objects by their number, `groups`; `key` says which mean it belongs to.

        Scores that are `margins` instead of probabilities have no Brier score.
        """
        own = self.names.index(trainer)
        alone = bool((groups == own).all())
        drawn = np.flatnonzero(self.weights[:, own] > 0)
        n_once = 1 if alone else len(drawn)
        once = self.weights[drawn][:n_once] if not alone else np.ones((1, len(self.names)))
        present = np.unique(groups)
        rows = np.vstack([once, np.eye(len(self.names))[present]])
        brier = np.full(len(rows), np.nan) if margins else _brier(labels, scores, groups, rows)
        measured = np.column_stack([weighted_rates(labels, scores, groups, rows), brier])
        values = np.full((len(self.weights), len(COLUMNS)), np.nan)
        values[drawn] = measured[:n_once]
        self._values[(*key, trainer)].append(values)
        for group, row in zip(present, measured[n_once:], strict=True):
            self._pairs[(*key, trainer, self.names[group])].append(row)

    def table(self, *key_names: str) -> pd.DataFrame:
        """Return a row a key and replicate: means over the draws of each trainer, then over trainers as often as drawn."""
        by_key: dict[tuple, list[tuple[np.ndarray, np.ndarray]]] = defaultdict(list)
        for (*key_parts, trainer), draws in self._values.items():
            weight = self.weights[:, [self.names.index(trainer)]]
            by_key[tuple(key_parts)].append((weight, _mean(draws)))
        frames = []
        for key, trainers in by_key.items():
            head = dict(zip(key_names, key, strict=True))
            frame = pd.DataFrame(_weighted_mean(trainers), columns=list(COLUMNS))
            frames.append(frame.assign(**head, replicate=np.arange(len(self.weights))))
        return pd.concat(frames, ignore_index=True)

    def pairs(self, *key_names: str) -> pd.DataFrame:
        """Return a row a key, trainer and tested object: means over draws of what is measured on that object alone."""
        rows = [
            {
                **dict(zip((*key_names, "training_object", "test_object"), key, strict=True)),
                **dict(zip(COLUMNS, _mean(draws), strict=True)),
            }
            for key, draws in self._pairs.items()
        ]
        return pd.DataFrame(rows)


def _mean(draws: list[np.ndarray]) -> np.ndarray:
    """Return the mean over draws; one whose test had one outcome only is left out."""
    values = np.array(draws)
    count = np.isfinite(values).sum(axis=0)
    return np.divide(np.nansum(values, axis=0), count, out=np.full(values.shape[1:], np.nan), where=count > 0)


def _weighted_mean(trainers: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    total = sum(np.where(np.isfinite(values), weight, 0.0) for weight, values in trainers)
    summed = sum(weight * np.nan_to_num(values) for weight, values in trainers)
    return np.divide(summed, total, out=np.full_like(summed, np.nan), where=np.asarray(total) > 0)


def _brier(labels: np.ndarray, scores: np.ndarray, groups: np.ndarray, weights: np.ndarray) -> np.ndarray:
    count = np.bincount(groups, minlength=weights.shape[1])
    squared = np.bincount(groups, (scores - labels) ** 2, minlength=weights.shape[1])
    total = weights @ count
    return np.divide(weights @ squared, total, out=np.full(len(weights), np.nan), where=total > 0)


def interval(values: np.ndarray) -> tuple[float, float, float]:
    """Return the value of replicate 0 and the ends of its 95 % percentile interval over the others; nan ones are left out."""
    replicates = values[1:][np.isfinite(values[1:])]
    if not len(replicates):
        return float(values[0]), float("nan"), float("nan")
    low, high = np.quantile(replicates, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return float(values[0]), float(low), float(high)


def two_sided_p(differences: np.ndarray) -> float:
    """Return the bootstrap's p value that a difference is none: twice the smaller tail of replicates 1 …, at least 2 / (n + 1)."""
    replicates = differences[1:][np.isfinite(differences[1:])]
    tail = min(np.count_nonzero(replicates <= 0.0), np.count_nonzero(replicates >= 0.0))
    return float(min(1.0, 2.0 * (tail + 1) / (len(replicates) + 1)))
