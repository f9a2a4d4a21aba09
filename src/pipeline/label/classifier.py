"""One logistic regression a part, trained on the annotated source (section II-B)."""

from dataclasses import dataclass

import numpy as np

PARTS = ("container", "rim", "handle")
SURE = 800.0  # the logit of what the source is all or nothing of


@dataclass(frozen=True)
class PartClassifier:
    """Three independent classifiers of a point's neighbourhood: logit = features · weights (F, 3) + offsets (3,)."""

    weights: np.ndarray
    offsets: np.ndarray

    def probabilities(self, features: np.ndarray) -> np.ndarray:
        """Return p(part) of points with features (N, F) as (N, 3), in the order of `PARTS`."""
        logit = features @ self.weights + self.offsets
        return 0.5 * (1.0 + np.tanh(logit / 2.0))


def train(features: np.ndarray, parts: np.ndarray, ridge: float) -> PartClassifier:
    """Fit one classifier a part to features (N, F) and labels (N, 3), classes weighted as if equally frequent.

    The ridge is large because neighbouring points are far from independent: a scan holds some hundred neighbourhoods,
    not as many as it has points, and weights that trust every point are sure of themselves on other objects, and wrong.
    """
    weights, offsets = zip(*(_train(features, part, ridge) for part in parts.T), strict=True)
    return PartClassifier(np.column_stack(weights), np.array(offsets))


def _train(features: np.ndarray, part: np.ndarray, ridge: float) -> tuple[np.ndarray, float]:
    if part.all() or not part.any():
        return np.zeros(features.shape[1]), SURE if part[0] else -SURE
    from sklearn.linear_model import LogisticRegression
    from sklearn.preprocessing import StandardScaler

    scaler = StandardScaler().fit(features)
    regression = LogisticRegression(C=1.0 / ridge, solver="newton-cholesky", class_weight="balanced")
    regression.fit(scaler.transform(features), part)
    weights = regression.coef_[0] / scaler.scale_
    return weights, float(regression.intercept_[0] - weights @ scaler.mean_)
