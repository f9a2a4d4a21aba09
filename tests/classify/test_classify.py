import numpy as np
import pandas as pd
import pytest

from pipeline.classify.features import Parameters, features
from pipeline.classify.protocol import (
    Protocol,
    Results,
    ceiling,
    draw_training_set,
    evaluate,
    training_sets,
)
from pipeline.classify.regression import FPR_GRID, classifier, iterations, score, separable
from pipeline.errors import PipelineError
from pipeline.geometry import frames
from pipeline.statistics.resampling import Resampled, object_weights


def trials(n: int = 200, objects: tuple[str, ...] = ("cup", "bowl"), seed: int = 0) -> pd.DataFrame:
    """Return pouring trials of cylinders that differ in size, labelled by a plane in dimensionless features."""
    rng, tables = np.random.default_rng(seed), []
    for size, name in enumerate(objects, start=1):
        tilt, fill = rng.uniform(0, 2.0, n), rng.uniform(0.05, 1.0, n)
        table = pd.DataFrame(
            {"trial": np.arange(n), "experiment": "pouring", "object": name, "held_object": name}
        )
        table["tilt_rad"], table["fill_m3"] = tilt, fill * size * 1e-4
        table[["lip_x_m", "lip_y_m", "lip_z_m"]] = [0.04 * size, 0.0, 0.1 * size]
        table["hydrostatic_margin"] = tilt / 1.2 + fill - 1.2
        table["poured"] = table["hydrostatic_margin"] + rng.normal(0, 0.05, n) > 0.0
        tables.append(table)
    return pd.concat(tables, ignore_index=True)


def parameters(objects: tuple[str, ...] = ("cup", "bowl")) -> Parameters:
    rows, rims = {}, {}
    for size, name in enumerate(objects, start=1):
        rows[name] = {"volume_m3": size * 1e-4, "height_m": 0.1 * size, "radius_m": 0.04 * size}
        rows[name] |= {f"opening_{a}_m": v for a, v in zip("xyz", (0.0, 0.0, 0.1 * size), strict=True)}
        rows[name] |= {f"centre_{a}_m": v for a, v in zip("xyz", (0.0, 0.0, 0.05 * size), strict=True)}
        rims[name] = pd.DataFrame(
            {
                "x_m": [0.04 * size, -0.04 * size],
                "y_m": [0.0, 0.0],
                "z_m": [0.1 * size, 0.1 * size],
                "tilt_reference_rad": [0.9, 0.5],
            }
        )
    return Parameters(pd.DataFrame(rows).T, rims)


def nothing_yet(table: pd.DataFrame) -> Results:
    names = list(pd.unique(table["object"]))
    return Results(Resampled(names, object_weights(len(names), 10, 0)))


def evaluated(table: pd.DataFrame, sets: dict[str, np.ndarray], draws: int = 1, **protocol) -> Results:
    """Return the results of training sets of 50."""
    results = nothing_yet(table)
    evaluate(table, table["poured"].to_numpy(), sets, Protocol(50, draws, 1, **protocol), results)
    return results


def test_pouring_features_are_divided_by_the_references_at_the_lip():
    table = trials()
    found = features(table, parameters(), standard=False)
    size = np.where(table["object"] == "cup", 1e-4, 2e-4)
    np.testing.assert_allclose(found, np.column_stack([table["tilt_rad"] / 0.9, table["fill_m3"] / size]))
    standard = features(table, parameters(), standard=True)
    np.testing.assert_array_equal(standard, table[["tilt_rad", "fill_m3"]])


def test_filling_features_of_a_trial_by_hand():
    # The cup pours along +y (yaw 90°), its lip 2 cm beyond the bowl's centre, 1 cm to the side and 3 cm above its opening.
    yaw = frames.rotation_about(np.array([0.0, 0.0, 1.0]), np.pi / 2)
    T_world_held = frames.transform(yaw, np.array([0.01, 0.02 - 0.04, 0.2 + 0.03 - 0.1]))
    table = pd.DataFrame(
        {
            "experiment": ["filling"],
            "object": "bowl",
            "held_object": "cup",
            **{"tilt_rad": 2.0, "fill_m3": 1e-5, "second_fill_m3": 5e-5},
            **{"lip_x_m": 0.04, "lip_y_m": 0.0, "lip_z_m": 0.1},
            **{"axis_x": -1.0, "axis_y": 0.0, "axis_z": 0.0},
            "T_world_held": [T_world_held.ravel()],
            "T_world_second": [np.eye(4).ravel()],
        }
    )
    found = features(table, parameters(), standard=False)[0]
    np.testing.assert_allclose(found, [2.0 / 0.9, 0.1, 0.25, 0.03 / 0.1, 0.02 / 0.08, 0.01 / 0.08])
    standard = features(table, parameters(), standard=True)[0]
    centre = T_world_held[:3, 3] + [0.0, 0.0, 0.05] - [0.0, 0.0, 0.1]
    np.testing.assert_allclose(standard, [2.0, 1e-5, 5e-5, centre[2], abs(centre[1]), abs(centre[0])])


def test_an_object_without_parameters_is_named():
    with pytest.raises(PipelineError, match="bowl"):
        features(trials(), parameters(("cup",)), standard=True)


def test_rescaled_features_give_the_same_scores_on_the_training_object():
    table = trials()
    sets = {"standard": features(table, parameters(), standard=True)}
    sets["label_mapping"] = features(table, parameters(), standard=False)
    results = evaluated(table, sets, draws=3)
    scores = pd.DataFrame(results.scores)
    same = scores[scores["split"] == "same"].pivot(
        index=["training_object", "draw"], columns="features", values="auc"
    )
    np.testing.assert_allclose(same["standard"], same["label_mapping"], atol=1e-9)
    novel = scores[scores["split"] == "novel"].groupby("features")["auc"].mean()
    assert novel["label_mapping"] > novel["standard"] + 0.01


def test_splits_leave_out_the_training_samples_and_hold_all_others():
    table = trials()
    results = evaluated(table, {"standard": features(table, parameters(), standard=True)})
    predictions = results.predictions(table, table["poured"].to_numpy(bool))
    for (split, training, _), tested in predictions.groupby(
        ["split", "training_object", "draw"], observed=True
    ):
        own = tested["test_object"] == training
        assert len(tested) == (150 if split == "same" else 200)
        assert own.all() if split == "same" else not own.any()


def test_draws_of_an_object_do_not_depend_on_the_others():
    table = trials()
    alone = table[table["object"] == "cup"].reset_index(drop=True)
    both, one = (
        evaluated(t, {"standard": features(t, parameters(), standard=True)}, draws=2) for t in (table, alone)
    )
    same = [score for score in both.scores if score["training_object"] == "cup" and score["split"] == "same"]
    assert same == one.scores


def test_one_class_draws_are_redrawn_and_one_class_objects_refused():
    labels = np.zeros(200, dtype=bool)
    labels[:2] = True
    redrawn = [draw_training_set(labels, 50, (seed,), name="cup")[1] for seed in range(20)]
    assert max(redrawn) > 0
    with pytest.raises(PipelineError, match=r"pouring/cup.*both outcomes.*200 trials, 0"):
        draw_training_set(np.zeros(200, dtype=bool), 50, (0,), name="pouring/cup")


def test_irls_solves_the_penalised_likelihood_s_equation():
    rng = np.random.default_rng(3)
    x = rng.normal(size=(300, 2)) * [1.0, 100.0]
    y = rng.random(300) < 1 / (1 + np.exp(-x @ [1.0, 0.02]))
    fitted = classifier(ridge=2.0).fit(x, y)
    standardised, weights = fitted[0].transform(x), fitted[1].coef_[0]
    residual = fitted.predict_proba(x)[:, 1] - y
    np.testing.assert_allclose(standardised.T @ residual + 2.0 * weights, 0.0, atol=1e-6)
    assert iterations(fitted)[1]


def test_separation_is_told():
    x = np.linspace(-1.0, 1.0, 50)[:, None]
    assert separable(x, x[:, 0] > 0.1)
    mixed = x[:, 0] > 0.1
    mixed[[0, -1]] = ~mixed[[0, -1]]
    assert not separable(x, mixed)


def test_roc_is_read_at_fixed_rates_without_interpolating():
    # Scores .9 + .8 - .7 + .1 -: at no false positive half of the true ones are found.
    outcome = score(
        np.array([True, True, False, True, True, False]), np.array([0.9, 0.8, 0.7, 0.6, 0.5, 0.1])
    )
    assert outcome.tpr_at(0.0) == 0.5
    assert outcome.tpr_at(0.49) == 0.5
    assert outcome.tpr_at(0.5) == 1.0
    assert outcome.auc == pytest.approx(0.75)
    assert len(outcome.tpr) == len(FPR_GRID)


def test_the_ceiling_scores_the_margin_itself():
    results = nothing_yet(trials())
    ceiling(trials(), trials()["poured"].to_numpy(), results)
    assert {score["split"] for score in results.scores} == {"same", "novel"}
    assert min(score["auc"] for score in results.scores) > 0.98
    assert all(np.isnan(score["brier"]) for score in results.scores)


def test_replicate_zero_is_the_mean_of_the_scores():
    table = trials(objects=("cup", "bowl", "mug"))
    results = evaluated(
        table, {"standard": features(table, parameters(("cup", "bowl", "mug")), standard=True)}, 3
    )
    scores = pd.DataFrame(results.scores).groupby("split")[["auc", "brier", "tpr_at_fpr_01"]].mean()
    replicates = results.resampled.table("features", "split")
    first = replicates[replicates["replicate"] == 0].set_index("split")
    np.testing.assert_allclose(first.loc[scores.index, scores.columns], scores, atol=1e-12)


def sets_of(**protocol) -> tuple[pd.DataFrame, list]:
    table = trials(objects=("cup", "bowl", "mug"))
    table["held_object"] = np.tile(["cup", "mug", "jug", "can"], len(table) // 4)
    return table, list(training_sets(table, table["poured"].to_numpy(), Protocol(50, 2, 1, **protocol)))


def test_disjoint_held_cups_are_in_training_or_in_tests():
    table, sets = sets_of(held_cups="disjoint")
    held = table["held_object"].to_numpy()
    for drawn in sets:
        assert set(held[drawn.rows]) & set(held[drawn.testable]) == set()
        assert len(set(held[drawn.testable])) == 2
    table, sets = sets_of()
    assert all(drawn.testable.all() for drawn in sets)


def test_more_training_objects_share_the_samples_and_are_not_novel():
    table, sets = sets_of(training_objects=2)
    objects = table["object"].to_numpy()
    for drawn in sets:
        assert len(drawn.rows) == 50
        assert set(objects[drawn.rows]) == set(drawn.training_objects)
        assert len(drawn.training_objects) == 2
    assert len(sets_of(training_objects=9)[1][0].training_objects) == 2  # one stays novel
