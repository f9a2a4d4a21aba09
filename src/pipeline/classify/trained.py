"""From a fitted scikit-learn classifier to the plain numbers that others predict with."""

from typing import Any

import numpy as np
from sklearn.pipeline import Pipeline

from pipeline.models import EXPERIMENT_FEATURES, QUANTITIES, Model


def trained(
    fitted: Pipeline, head: dict[str, Any], ridge: float, samples: int, training: dict[str, Any]
) -> Model:
    """Return the model of a fitted classifier; `head` names it, `training` tells how its fit went."""
    names = EXPERIMENT_FEATURES[head["experiment"]]
    variables, references = zip(*(QUANTITIES[name] for name in names), strict=True)
    if head["features"] == "standard":
        references = (None,) * len(names)
    scaler, regression = fitted[0], fitted[-1]
    return Model(
        **head,
        feature_names=names,
        variables=variables,
        references=references,
        mean=_numbers(scaler.mean_),
        std=_numbers(scaler.scale_),
        terms="linear",
        weights=_numbers(regression.coef_[0]),
        intercept=float(regression.intercept_[0]),
        training_objects=(head["training_object"],),
        samples=samples,
        penalty="ridge",
        ridge=ridge,
        converged=training["converged"],
        separable=training["separable"],
    )


def _numbers(values: np.ndarray) -> tuple[float, ...]:
    return tuple(float(value) for value in values)
