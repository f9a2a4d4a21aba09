import numpy as np
import pytest

from pipeline.classify.protocol import Protocol, TrainingSet
from pipeline.classify.regression import classifier
from pipeline.classify.trained import trained
from pipeline.errors import PipelineError
from pipeline.models import chosen, expanded, mean_probability, read_models, write_models


def fitted(seed: int = 0, features: str = "label_mapping", **protocol: str):
    """Return a fitted scikit-learn classifier of pouring, its model and the features it saw."""
    rng = np.random.default_rng(seed)
    x = rng.uniform([0.0, 0.05], [2.0, 0.8], (80, 2))
    y = x[:, 0] + x[:, 1] + rng.normal(0, 0.2, 80) > 1.3
    pipeline = classifier(1.0, **protocol).fit(x, y)
    drawn = TrainingSet(("cup",), seed, np.arange(80), 0, np.ones(80, dtype=bool))
    training = {"converged": True, "separable": False}
    return (
        pipeline,
        trained(pipeline, "pouring", features, drawn, Protocol(80, 1, 0, **protocol), training),
        x,
    )


@pytest.mark.parametrize("protocol", [{}, {"penalty": "firth"}, {"terms": "quadratic"}])
def test_a_model_that_was_written_predicts_what_the_fitted_one_did(tmp_path, protocol):
    pipeline, model, x = fitted(**protocol)
    write_models(tmp_path / "models.json", [model])
    (read,) = read_models(tmp_path / "models.json")
    assert read == model
    np.testing.assert_allclose(read.probability(x), pipeline.predict_proba(x)[:, 1], rtol=1e-13)


def test_features_are_variables_over_references():
    held = {"tilt_reference_rad": 1.2, "volume_m3": 2e-4}
    values = fitted()[1].feature_values({"tilt_rad": [0.6, 1.2], "fill_m3": 1e-4}, {"held": held})
    np.testing.assert_allclose(values, [[0.5, 0.5], [1.0, 0.5]])
    standard = fitted(features="standard")[1].feature_values({"tilt_rad": 0.6, "fill_m3": 1e-4}, {})
    np.testing.assert_allclose(standard, [[0.6, 1e-4]])
    with pytest.raises(PipelineError, match="volume_m3"):
        fitted()[1].feature_values({"tilt_rad": 0.6, "fill_m3": 1e-4}, {"held": {"tilt_reference_rad": 1.2}})


def test_mean_and_spread_are_over_classifiers():
    models, (_, _, x) = [fitted(seed)[1] for seed in range(3)], fitted()
    mean, spread = mean_probability(chosen(models, "label_mapping", "cup"), x)
    each = [model.probability(x) for model in models]
    np.testing.assert_allclose(mean, np.mean(each, axis=0))
    np.testing.assert_allclose(spread, np.std(each, axis=0))
    with pytest.raises(PipelineError, match="found training objects cup"):
        chosen(models, "label_mapping", "cap")


def test_quadratic_terms_are_the_features_and_all_their_products():
    np.testing.assert_array_equal(expanded(np.array([[2.0, 3.0]]), "quadratic"), [[2, 3, 4, 6, 9]])


def test_another_json_file_is_refused(tmp_path):
    (tmp_path / "models.json").write_text("[{}]")
    with pytest.raises(PipelineError, match=r"models\.json: expected a list of classifiers"):
        read_models(tmp_path / "models.json")
    with pytest.raises(PipelineError, match="expected the features tilt fill, found 3 columns"):
        fitted()[1].probability(np.zeros((1, 3)))
