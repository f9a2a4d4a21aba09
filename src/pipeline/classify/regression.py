"""Logistic regression by iteratively reweighted least squares (section III-A), and what is said of its predictions."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import linprog
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import auc, roc_curve
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from pipeline.classify.firth import Firth
from pipeline.models import expanded

FPR_GRID = np.linspace(0.0, 1.0, 101)


@dataclass(frozen=True)
class Score:
    """How well probabilities separate labels. `tpr` (101,) is read at `FPR_GRID`; `brier` is nan for bare margins."""

    auc: float
    brier: float
    tpr: np.ndarray

    def tpr_at(self, fpr: float) -> float:
        """Return the true positive rate at one of `FPR_GRID`'s false positive rates."""
        return float(self.tpr[np.argmin(np.abs(FPR_GRID - fpr))])


def classifier(ridge: float, penalty: str = "ridge", terms: str = "linear") -> Pipeline:
    """Return an unfitted model: standardise, then logistic regression by IRLS (Newton's method) with a penalty.

    ridge: the loss is the sum of the negative log likelihoods plus ridge/2 × the squared standardised weights; the intercept
    is free. firth: Jeffreys' prior instead, where nothing is to be chosen. Without a penalty most sets of 50 samples have no
    estimate, because a plane separates them. `terms` linear or quadratic, of the standardised features.
    """
    irls: Any = (
        Firth()
        if penalty == "firth"
        else LogisticRegression(C=1.0 / ridge, solver="newton-cholesky", tol=1e-8)
    )
    if terms == "linear":
        return make_pipeline(StandardScaler(), irls)
    return make_pipeline(StandardScaler(), FunctionTransformer(expanded, kw_args={"terms": terms}), irls)


def iterations(fitted: Pipeline) -> tuple[int, bool]:
    """Return the number of IRLS iterations of a fitted classifier and whether they converged."""
    regression = fitted[-1]
    return int(regression.n_iter_[0]), bool(regression.n_iter_[0] < regression.max_iter)


def separable(features: np.ndarray, labels: np.ndarray) -> bool:
    """Return whether a plane separates the classes of features (N, F), labels (N,): is there w, b with ±(x·w + b) ≥ 1?"""
    signs = np.where(labels, 1.0, -1.0)[:, None]
    scaled = StandardScaler().fit_transform(features)
    constraints = -signs * np.hstack([scaled, np.ones((len(scaled), 1))])
    n_unknown = constraints.shape[1]
    result = linprog(
        np.zeros(n_unknown), constraints, -np.ones(len(scaled)), bounds=[(None, None)] * n_unknown
    )
    return result.status == 0


def score(labels: np.ndarray, probabilities: np.ndarray, *, margins: bool = False) -> Score:
    """Return the score of probabilities (or any `margins` that grow with them) for labels, both (N,)."""
    fpr, tpr, _ = roc_curve(labels, probabilities, drop_intermediate=False)
    at_most = np.searchsorted(fpr, FPR_GRID + 1e-12, side="right") - 1
    brier = np.nan if margins else np.mean((probabilities - labels) ** 2)
    return Score(float(auc(fpr, tpr)), float(brier), tpr[at_most])
