"""From a fitted scikit-learn classifier to the plain numbers that others predict with."""

from typing import TYPE_CHECKING, Any

import numpy as np
from sklearn.pipeline import Pipeline

from pipeline.models import EXPERIMENT_FEATURES, QUANTITIES, Model

if TYPE_CHECKING:
    from pipeline.classify.protocol import Protocol, TrainingSet

# What the references are with `classify.volume: cavity`.
CAVITY = {"held.volume_m3": "held.capacity_m3", "second.volume_m3": "second.capacity_m3"}
CAVITY |= {"held.tilt_reference_rad": "held.cavity_tilt_reference_rad"}


def trained(
    fitted: Pipeline,
    experiment: str,
    features: str,
    drawn: "TrainingSet",
    protocol: "Protocol",
    training: dict[str, Any],
) -> Model:
    """Return the model of a classifier fitted to a drawn training set; `training` tells how its fit went."""
    names = EXPERIMENT_FEATURES[experiment]
    if protocol.margin != "none" and experiment == "pouring" and features != "standard":
        names = (*names, "margin")
    scaler, regression = fitted[0], fitted[-1]
    return Model(
        experiment=experiment,
        features=features,
        training_object=drawn.training_objects[0],
        draw=drawn.draw,
        feature_names=names,
        variables=tuple(QUANTITIES[name][0] for name in names),
        references=tuple(_reference(name, features, protocol.volume) for name in names),
        mean=_numbers(scaler.mean_),
        std=_numbers(scaler.scale_),
        terms=protocol.terms,
        weights=_numbers(regression.coef_[0]),
        intercept=float(regression.intercept_[0]),
        training_objects=drawn.training_objects,
        samples=len(drawn.rows),
        penalty=protocol.penalty,
        ridge=protocol.ridge if protocol.penalty == "ridge" else 0.0,
        converged=training["converged"],
        separable=training["separable"],
    )


def _reference(name: str, features: str, volume: str) -> str | None:
    reference = QUANTITIES[name][1]
    if features == "standard":
        return None
    return CAVITY.get(reference, reference) if volume == "cavity" else reference


def _numbers(values: np.ndarray) -> tuple[float, ...]:
    return tuple(float(value) for value in values)
