"""The fitted classifiers as scikit-learn's, made from their plain numbers: what `mlflow.sklearn` loads and serves."""

import zipfile
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
    steps = [_scaler(model)]
    if model.terms != "linear":
        steps.append(
            PolynomialFeatures(degree=2, include_bias=False).fit(np.zeros((1, len(model.feature_names))))
        )
    return make_pipeline(*steps, _regression(model))


def ensemble(models: Sequence[Model]) -> VotingClassifier:
    """Return the classifiers of all draws as one; its probability is their mean, and `estimators_` are they.

    Its input are the features α/α_r by name; column 1 of `predict_proba` is the probability of pouring or of filling.
    """
    fitted = [pipeline_of(model) for model in models]
    voting = VotingClassifier(
        [(f"draw_{model.draw}", one) for model, one in zip(models, fitted, strict=True)], voting="soft"
    )
    voting.estimators_, voting.le_, voting.classes_ = fitted, LabelEncoder().fit(CLASSES), CLASSES
    return voting


def packed(models: Sequence[Model]) -> bytes:
    """Return the ensemble as a file of skops, which holds no code."""
    import skops.io

    return skops.io.dumps(ensemble(models), compression=zipfile.ZIP_DEFLATED)


def example(models: Sequence[Model]) -> pd.DataFrame:
    """Return two rows of features as an example: the mean of the training sets, and one standard deviation above."""
    mean = np.mean([model.mean for model in models], axis=0)
    std = np.mean([model.std for model in models], axis=0)
    return pd.DataFrame([mean, mean + std], columns=list(models[0].feature_names))


def _scaler(model: Model) -> StandardScaler:
    scaler = StandardScaler()
    scaler.mean_, scaler.scale_ = np.array(model.mean), np.array(model.std)
    scaler.var_, scaler.n_samples_seen_ = scaler.scale_**2, model.samples
    scaler.n_features_in_ = len(model.feature_names)
    scaler.feature_names_in_ = np.array(model.feature_names, dtype=object)
    return scaler


def _regression(model: Model) -> LogisticRegression:
    regression = LogisticRegression(C=1.0 / model.ridge if model.ridge > 0 else np.inf)
    regression.coef_, regression.intercept_ = np.array([model.weights]), np.array([model.intercept])
    regression.classes_, regression.n_features_in_ = CLASSES, len(model.weights)
    return regression
