import numpy as np
import pandas as pd
import pytest
from sklearn.metrics import brier_score_loss, roc_auc_score

from pipeline.classify.regression import score
from pipeline.statistics.delong import NORMAL_95, delong_std
from pipeline.statistics.rates import MEASURES, PARTIAL_FPR, weighted_rates
from pipeline.statistics.resampling import COLUMNS, Resampled, interval, object_weights, two_sided_p


def trials_of(n: int = 400, n_objects: int = 4, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return groups, labels and scores with ties; each object shifts its scores."""
    rng = np.random.default_rng(seed)
    groups = rng.integers(n_objects, size=n)
    labels = rng.random(n) < 0.4
    scores = np.clip(0.3 + 0.2 * labels + 0.05 * groups + rng.normal(0, 0.15, n), 0, 1)
    return groups, labels, np.round(scores, 2)


def test_rates_are_those_of_scikit_learn_on_the_repeated_trials():
    groups, labels, scores = trials_of()
    weights = np.array([[1, 1, 1, 1], [0, 2, 1, 3]])
    for weight, found in zip(weights, weighted_rates(labels, scores, groups, weights), strict=True):
        again = np.repeat(np.arange(len(labels)), weight[groups])
        y, s = labels[again], scores[again]
        outcome, measures = score(y, s), dict(zip(MEASURES, found, strict=True))
        assert measures["auc"] == pytest.approx(outcome.auc, abs=1e-12)
        for percent in (0, 1, 5):
            assert measures[f"tpr_at_fpr_{percent:02d}"] == pytest.approx(outcome.tpr_at(percent / 100))
        # scikit-learn's partial area is standardised after McClish: chance 0.5, perfect 1.
        low, high = PARTIAL_FPR**2 / 2, PARTIAL_FPR
        standardised = (1 + (measures["partial_auc"] * PARTIAL_FPR - low) / (high - low)) / 2
        assert standardised == pytest.approx(roc_auc_score(y, s, max_fpr=PARTIAL_FPR), abs=1e-12)


def test_a_weighting_without_one_of_the_classes_has_no_rates():
    groups, labels = np.array([0, 0, 1]), np.array([True, False, True])
    assert np.isnan(weighted_rates(labels, np.array([0.9, 0.1, 0.8]), groups, np.array([[0.0, 1.0]]))).all()


def resampled(n_replicates: int = 50) -> tuple[Resampled, dict, list[str]]:
    names = ["a", "b", "c", "d"]
    collected, data = Resampled(names, object_weights(4, n_replicates, 1)), {}
    for i, trainer in enumerate(names):
        for draw in range(2):
            groups, labels, scores = trials_of(seed=10 * i + draw)
            novel = groups != i
            data[trainer, draw] = groups[novel], labels[novel], scores[novel]
            tested = collected.groups(np.array(names)[groups[novel]])
            collected.add(("x", "novel"), trainer, tested, labels[novel], scores[novel])
    return collected, data, names


def test_a_replicate_counts_objects_as_trainers_and_as_tests():
    collected, data, names = resampled()
    table = collected.table("features", "split")
    for replicate in (0, 1, 7):
        weight = collected.weights[replicate]
        means, counts = [], []
        for i, trainer in enumerate(names):
            draws = []
            for draw in range(2):
                groups, labels, scores = data[trainer, draw]
                again = np.repeat(np.arange(len(groups)), weight[groups].astype(int))
                if weight[i] and 0 < labels[again].sum() < len(again):
                    y, s = labels[again], scores[again]
                    draws.append((roc_auc_score(y, s), brier_score_loss(y, s)))
            if draws:
                means.append(np.mean(draws, axis=0))
                counts.append(weight[i])
        expected = np.average(means, axis=0, weights=counts)
        found = table[table["replicate"] == replicate][["auc", "brier"]].to_numpy()[0]
        np.testing.assert_allclose(found, expected, atol=1e-12)


def test_pairs_are_measured_on_one_object_alone():
    collected, data, _ = resampled()
    pairs = collected.pairs("features", "split").set_index(["training_object", "test_object"])
    assert len(pairs) == 12
    expected = []
    for draw in range(2):
        groups, labels, scores = data["a", draw]
        expected.append(roc_auc_score(labels[groups == 2], scores[groups == 2]))
    assert pairs.loc[("a", "c"), "auc"] == pytest.approx(np.mean(expected))


def test_two_tables_have_the_same_replicates():
    one, other = (resampled()[0].table("features", "split") for _ in range(2))
    pd.testing.assert_frame_equal(one, other)
    assert set(COLUMNS) < set(one)


def test_draws_of_one_object_alone_do_not_occur_unless_it_is_the_only_one():
    weights = object_weights(2, 100, 0)
    assert (weights.sum(axis=1) == 2).all()
    assert (np.count_nonzero(weights, axis=1) == 2).all()
    np.testing.assert_array_equal(object_weights(1, 3, 0), np.ones((4, 1)))


def test_delong_covers_the_true_area_of_normal_scores_and_is_too_narrow_when_objects_differ():
    """Two normal distributions one apart have the area Φ(1/√2) = 0.7602."""
    rng = np.random.default_rng(5)
    hits, widths = [], []
    for _ in range(300):
        y = np.arange(200) % 2 == 0
        s = rng.normal(size=200) + y
        area, half = roc_auc_score(y, s), NORMAL_95 * delong_std(y, s)
        hits.append(abs(area - 0.7602) < half)
        widths.append(half)
    assert 0.91 < np.mean(hits) < 0.98
    # Ten objects with thresholds of their own: the mean over objects is known far less well than trials promise.
    names = [f"o{i}" for i in range(10)]
    slope = rng.normal(1.0, 1.0, 10)
    groups = np.repeat(np.arange(10), 200)
    y = np.arange(2000) % 2 == 0
    s = slope[groups] * y + rng.normal(size=2000)
    values = weighted_rates(y, s, groups, object_weights(len(names), 400, 0))[:, 0]
    _, low, high = interval(values)
    assert (high - low) / 2 > 2 * NORMAL_95 * delong_std(y, s)


def test_p_values_of_a_clear_and_of_no_difference():
    rng = np.random.default_rng(0)
    assert two_sided_p(np.append(1.0, rng.normal(1.0, 0.1, 999))) == pytest.approx(0.002)
    assert two_sided_p(np.append(0.0, rng.normal(0.0, 0.1, 999))) > 0.5
