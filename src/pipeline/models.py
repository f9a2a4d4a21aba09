"""Fitted classifiers as plain numbers, for whoever predicts: p(pour) and p(fill) from the features of section III-A.

A feature is α/α_r: a variable of the trial over a parameter of one of its containers (`QUANTITIES`). The stage `classify` writes
the classifiers of an experiment as one JSON file, `classify/<experiment>/models.json`; nothing in it is code.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.artefacts import read_json, write_json
from pipeline.errors import PipelineError

# Feature → variable α and reference α_r as container.parameter. In pouring, held is the only container. Offsets are of the held
# cup's lip from the centre of the second's opening: up, along the pour and across it, before tilting.
QUANTITIES = {
    "tilt": ("tilt_rad", "held.tilt_reference_rad"),
    "fill": ("fill_m3", "held.volume_m3"),
    "second_fill": ("second_fill_m3", "second.volume_m3"),
    "height": ("dz_m", "held.height_m"),
    "along": ("abs_dx_m", "second.radius_m"),
    "across": ("abs_dy_m", "second.radius_m"),
    # Optional (classify.margin): the fill less what is left below the lip in the tilted hull, brimful before.
    "margin": ("fill_minus_kept_m3", "held.volume_m3"),
}
EXPERIMENT_FEATURES = {
    "pouring": ("tilt", "fill"),
    "filling": ("tilt", "fill", "second_fill", "height", "along", "across"),
}
TERMS = ("linear", "quadratic")
FAR = 3.0  # standard deviations from the mean of a training set


def expanded(standardised: np.ndarray, terms: str) -> np.ndarray:
    """Return the terms of standardised features (N, F): themselves, or with all squares and products behind them."""
    if terms == "linear":
        return standardised
    first, second = np.triu_indices(standardised.shape[1])
    return np.hstack([standardised, standardised[:, first] * standardised[:, second]])


@dataclass(frozen=True)
class Model:
    """One logistic regression: p = 1 / (1 + exp(-(weights · terms + intercept))) of features standardised by mean and std.

    `variables` and `references` say what each of `feature_names` is; a reference None is one (standard features, in rad, m³, m,
    whose offsets are between the centres of the two clouds). `training_objects` are where the `samples` trials came from.
    `converged` and `separable` tell of the fit: did IRLS end, and does a plane separate the training set?
    """

    experiment: str
    features: str
    training_object: str
    draw: int
    feature_names: tuple[str, ...]
    variables: tuple[str, ...]
    references: tuple[str | None, ...]
    mean: tuple[float, ...]
    std: tuple[float, ...]
    terms: str
    weights: tuple[float, ...]
    intercept: float
    training_objects: tuple[str, ...]
    samples: int
    penalty: str
    ridge: float
    converged: bool
    separable: bool

    def probability(self, values: np.ndarray) -> np.ndarray:
        """Return the probability (N,) of pouring or filling for features (N, F), α/α_r in the order of `feature_names`."""
        from scipy.special import expit

        values = np.atleast_2d(np.asarray(values, float))
        if values.shape[1] != len(self.feature_names):
            raise PipelineError(
                f"{self.experiment}/{self.features}: expected the features {' '.join(self.feature_names)}, "
                f"found {values.shape[1]} columns; give one a feature"
            )
        standardised = (values - np.array(self.mean)) / np.array(self.std)
        return expit(expanded(standardised, self.terms) @ np.array(self.weights) + self.intercept)

    def feature_values(
        self, variables: Mapping[str, Any], parameters: Mapping[str, Mapping[str, float]]
    ) -> np.ndarray:
        """Return the features α/α_r (N, F) of `variables` (numbers or arrays (N,), by the names in `self.variables`).

        `parameters` are those of the containers: {"held": {"tilt_reference_rad": …, "volume_m3": …}, "second": {…}}, in rad, m, m³.
        """
        columns = []
        for variable, reference in zip(self.variables, self.references, strict=True):
            container, _, parameter = (reference or "..").partition(".")
            try:
                divisor = parameters[container][parameter] if reference else 1.0
                columns.append(np.atleast_1d(np.asarray(variables[variable], float)) / divisor)
            except KeyError as error:
                raise PipelineError(
                    f"{self.experiment}/{self.features}: expected {variable} and {reference or 'no parameter'}, "
                    f"found no {error.args[0]}; give it"
                ) from error
        return np.column_stack(np.broadcast_arrays(*columns))


def write_models(path: str | Path, models: Iterable[Model]) -> None:
    """Write classifiers as JSON, a list of objects with the fields of `Model`."""
    write_json(path, [asdict(model) for model in models])


def read_models(path: str | Path) -> list[Model]:
    """Read the classifiers that `write_models` wrote."""
    rows: Any = read_json(path)
    names = {field.name for field in fields(Model)}
    if not isinstance(rows, list) or not all(isinstance(row, dict) and set(row) == names for row in rows):
        raise PipelineError(
            f"{path}: expected a list of classifiers with {' '.join(sorted(names))}, found something else; "
            "remove the file and run the workflow again"
        )
    return [Model(**_with_tuples(row)) for row in rows]


def _with_tuples(row: dict[str, Any]) -> dict[str, Any]:
    return {key: tuple(value) if isinstance(value, list) else value for key, value in row.items()}


def chosen(models: Iterable[Model], features: str, training_object: str | None = None) -> list[Model]:
    """Return the classifiers of a feature set, of all draws, of all training objects or one; none is an error."""
    of_set = [model for model in models if model.features == features]
    found = [model for model in of_set if training_object in (None, model.training_object)]
    if not found:
        trained = " ".join(sorted({model.training_object for model in of_set})) or "none"
        raise PipelineError(
            f"classifiers of {features} on {training_object or 'any object'}: expected some, found training objects {trained}; "
            "name one of these"
        )
    return found


def beyond(models: Sequence[Model], values: np.ndarray) -> dict[str, tuple[float, float]]:
    """Return the features of one question (1, F) that lie further from the trials that were learnt from than `FAR` deviations.

    With mean and standard deviation of these trials, means over the classifiers.
    """
    mean, std = (np.mean([getattr(model, what) for model in models], axis=0) for what in ("mean", "std"))
    far = np.abs(np.ravel(values) - mean) > FAR * std
    told = zip(models[0].feature_names, mean.tolist(), std.tolist(), far, strict=True)
    return {name: (middle, spread) for name, middle, spread, is_far in told if is_far}


def mean_probability(models: Iterable[Model], values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and standard deviation (N,) over classifiers of their probabilities for features (N, F)."""
    each = np.stack([model.probability(values) for model in models])
    return each.mean(axis=0), each.std(axis=0)
