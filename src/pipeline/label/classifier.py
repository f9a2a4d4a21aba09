"""One logistic regression a part, trained on the annotated source (section II-B)."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler

from pipeline.errors import PipelineError

PARTS = ("container", "rim", "handle")


@dataclass(frozen=True)
class PartClassifier:
    """Three independent classifiers of a point's neighbourhood; a constant where the source is all or nothing of a part."""

    models: tuple[Pipeline | float, ...]

    def probabilities(self, features: np.ndarray) -> np.ndarray:
        """Return p(part) of points with features (N, F) as (N, 3), in the order of `PARTS`."""
        columns = [
            np.full(len(features), model) if isinstance(model, float) else model.predict_proba(features)[:, 1]
            for model in self.models
        ]
        return np.column_stack(columns)


def train(features: np.ndarray, parts: np.ndarray, ridge: float) -> PartClassifier:
    """Fit one classifier a part to features (N, F) and labels (N, 3), classes weighted as if equally frequent.

    The ridge is large because neighbouring points are far from independent: a scan holds some hundred neighbourhoods,
    not as many as it has points, and weights that trust every point are sure of themselves on other objects, and wrong.
    """
    return PartClassifier(tuple(_train(features, part, ridge) for part in parts.T))


def _train(features: np.ndarray, part: np.ndarray, ridge: float) -> Pipeline | float:
    if part.all() or not part.any():
        return float(part[0])
    regression = LogisticRegression(C=1.0 / ridge, solver="newton-cholesky", class_weight="balanced")
    return make_pipeline(StandardScaler(), regression).fit(features, part)


def transfer_annotation(
    painted_m: np.ndarray,
    painted_parts: np.ndarray,
    points_m: np.ndarray,
    *,
    name: str,
    reach_m: float = 0.01,
) -> np.ndarray:
    """Return the parts (N, 3) of points (N, 3): those of the nearest painted point (M, 3), (M, 3 bool).

    Raises PipelineError where the annotation and the scan do not lie on each other (median distance over `reach_m`).
    """
    distance, index = cKDTree(painted_m).query(points_m)
    if np.median(distance) > reach_m:
        raise PipelineError(
            f"{name}: the annotated points should lie on the scan of the source, but are {np.median(distance):.3f} m away "
            "(median); annotate this scan, in its own world frame and in metres"
        )
    return painted_parts[index]
