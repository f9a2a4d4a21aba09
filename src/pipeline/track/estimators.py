"""The fitted classifiers as scikit-learn's, made from their plain numbers: what `mlflow.sklearn` loads and serves."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from sklearn.ensemble import VotingClassifier
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import LabelEncoder, PolynomialFeatures, StandardScaler

from pipeline.models import Model

CLASSES = np.array([False, True])


def pipeline_of(model: Model) -> Pipeline:
    """Return one classifier: standardise, perhaps squares and products, logistic regression; classes are False and True."""
    pipeline = _unfitted(model)
    _fill_scaler(pipeline[0], model)
    if model.terms != "linear":
        pipeline[1].fit(np.zeros((1, len(model.feature_names))))
    _fill_regression(pipeline[-1], model)
    return pipeline


def _unfitted(model: Model) -> Pipeline:
    squares = [] if model.terms == "linear" else [PolynomialFeatures(degree=2, include_bias=False)]
    regression = LogisticRegression(C=1.0 / model.ridge if model.ridge > 0 else np.inf)
    return make_pipeline(StandardScaler(), *squares, regression)


def ensemble(models: Sequence[Model]) -> VotingClassifier:
    """Return the classifiers of all draws as one; its probability is their mean, and `estimators_` are they.

    Its input are the features α/α_r by name; column 1 of `predict_proba` is the probability of pouring or of filling.
    """
    # Unfitted here, as after a fit of its own; the fitted ones twice would double what is packed.
    voting = VotingClassifier([(f"draw_{model.draw}", _unfitted(model)) for model in models], voting="soft")
    voting.estimators_ = [pipeline_of(model) for model in models]
    voting.le_, voting.classes_ = LabelEncoder().fit(CLASSES), CLASSES
    return voting


def example(models: Sequence[Model]) -> pd.DataFrame:
    """Return two rows of features as an example: the mean of the training sets, and one standard deviation above."""
    mean = np.mean([model.mean for model in models], axis=0)
    std = np.mean([model.std for model in models], axis=0)
    return pd.DataFrame([mean, mean + std], columns=list(models[0].feature_names))


def probabilities(models: Sequence[Model], rows: pd.DataFrame) -> np.ndarray:
    """Return what the ensemble's `predict_proba` does (N, 2), from the plain numbers."""
    mean = np.mean([model.probability(rows.to_numpy()) for model in models], axis=0)
    return np.column_stack([1.0 - mean, mean])


def _fill_scaler(scaler: StandardScaler, model: Model) -> None:
    scaler.mean_, scaler.scale_ = np.array(model.mean), np.array(model.std)
    scaler.var_, scaler.n_samples_seen_ = scaler.scale_**2, model.samples
    scaler.n_features_in_ = len(model.feature_names)
    scaler.feature_names_in_ = np.array(model.feature_names, dtype=object)


def _fill_regression(regression: LogisticRegression, model: Model) -> None:
    regression.coef_, regression.intercept_ = np.array([model.weights]), np.array([model.intercept])
    regression.classes_, regression.n_features_in_ = CLASSES, len(model.weights)
