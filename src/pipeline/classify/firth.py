"""Firth's logistic regression: the likelihood times Jeffreys' prior, which has a finite estimate for separable data too."""

import numpy as np
from scipy.special import expit
from sklearn.base import BaseEstimator, ClassifierMixin

TOLERANCE = 1e-8
MAX_STEP = 5.0  # of any standardised weight in one iteration, as in Heinze's logistf


class Firth(ClassifierMixin, BaseEstimator):
    """Fits and predicts as scikit-learn's LogisticRegression does; nothing is to be chosen.

    Firth, Bias reduction of maximum likelihood estimates, Biometrika 1993; Heinze and Schemper, A solution to the problem of
    separation in logistic regression, Statistics in Medicine 2002.
    """

    max_iter = 200

    def fit(self, x: np.ndarray, y: np.ndarray) -> "Firth":
        """Fit features (N, F) to labels (N,) by IRLS on the modified score, halving steps that do not improve."""
        design = np.column_stack([x, np.ones(len(x))])
        beta = np.zeros(design.shape[1])
        objective = _objective(design, y, beta)
        n_iterations, largest = 0, np.inf
        while largest > TOLERANCE and n_iterations < self.max_iter:
            step = _step(design, y, beta)
            step /= max(1.0, np.abs(step).max() / MAX_STEP)
            while (new := _objective(design, y, beta + step)) < objective and np.abs(step).max() > TOLERANCE:
                step /= 2.0
            beta, objective = beta + step, new
            n_iterations, largest = n_iterations + 1, np.abs(step).max()
        self.n_iter_ = np.array([n_iterations])
        self.coef_, self.intercept_ = beta[None, :-1], beta[-1:]
        self.classes_ = np.array([False, True])
        return self

    def predict_proba(self, x: np.ndarray) -> np.ndarray:
        """Return the probabilities (N, 2) of both classes for features (N, F)."""
        probability = expit(x @ self.coef_[0] + self.intercept_[0])
        return np.column_stack([1.0 - probability, probability])


def _information(design: np.ndarray, probability: np.ndarray) -> np.ndarray:
    return (design * (probability * (1.0 - probability))[:, None]).T @ design


def _objective(design: np.ndarray, y: np.ndarray, beta: np.ndarray) -> float:
    """Return the penalised log likelihood, log L + log det(I) / 2."""
    linear = design @ beta
    likelihood = -np.logaddexp(0.0, np.where(y, -linear, linear)).sum()
    return float(likelihood + np.linalg.slogdet(_information(design, expit(linear)))[1] / 2.0)


def _step(design: np.ndarray, y: np.ndarray, beta: np.ndarray) -> np.ndarray:
    probability = expit(design @ beta)
    covariance = np.linalg.pinv(_information(design, probability))
    leverage = probability * (1.0 - probability) * np.einsum("nf,fg,ng->n", design, covariance, design)
    return covariance @ design.T @ (y - probability + leverage * (0.5 - probability))
