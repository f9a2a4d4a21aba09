"""A robot that pours can watch itself: p(pour) and p(fill) of the state that it is in (section III-A), in microseconds.

p(pour): a cup that was filled so far and is tilted so far has begun to pour. p(fill): if the next portion were poured from where
the lip is now, all of it would end in the second container. Both as the classifiers of the stage `classify` learnt them, from
liquid: an event that they were not asked about, such as a jam of balls at the rim, they do not know.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.special import expit

from pipeline.artefacts import read_table
from pipeline.errors import PipelineError
from pipeline.geometry.frames import rotation_about
from pipeline.models import Model, chosen, expanded
from pipeline.predictions import classifiers

STANDARD = "standard"
UP = np.array([0.0, 0.0, 1.0])


class Watched(NamedTuple):
    """Probabilities of one state: the held cup has begun to pour; what it pours now ends in the second container."""

    pour: float
    fill: float


class Portion(NamedTuple):
    """What p(fill) was learnt with and is asked about: so much, from a cup that is then tilted so far (simulate.filling)."""

    m3: float = 10 * 0.010**3
    tilt_rad: float = np.radians(120.0)


class Watcher:
    """Watches one pair; reads nothing while it does."""

    def __init__(
        self,
        pouring: list[Model],
        filling: list[Model],
        parameters: Mapping[str, Mapping[str, float]],
        offset_m: np.ndarray | None = None,
        portion: Portion | None = None,
    ) -> None:
        """Take the classifiers of one feature set and the warped parameters of the containers `held` and `second`, rad, m, m³.

        offset_m (3,): what must be added to the lip's place, in its frame, for features that go by other points (`offset_m`).
        """
        self._pouring, self._filling = _Ensemble(pouring, parameters), _Ensemble(filling, parameters)
        self._offset_m = np.zeros(3) if offset_m is None else np.asarray(offset_m, float)
        self._portion = portion or Portion()

    def watch(
        self, lip_m: np.ndarray, tilt_rad: float, fill_m3: float, second_fill_m3: float = 0.0
    ) -> Watched:
        """Return the probabilities of one state.

        lip_m (3,): the lip from the centre of the second's opening, metres: along the pour, across it, up. fill_m3: what the held
        cup had in it when it was upright; second_fill_m3: what the second has in it now.
        """
        along, across, up = np.asarray(lip_m, float) + self._offset_m
        pour = self._pouring.probability({"tilt_rad": tilt_rad, "fill_m3": fill_m3})
        asked = {"tilt_rad": self._portion.tilt_rad, "fill_m3": self._portion.m3}
        asked |= {"second_fill_m3": second_fill_m3, "dz_m": up}
        asked |= {"abs_dx_m": abs(along), "abs_dy_m": abs(across)}
        return Watched(pour, self._filling.probability(asked))

    def along(self, trajectory: np.ndarray, fill_m3: float, second_fill_m3: float = 0.0) -> np.ndarray:
        """Return p(pour), p(fill) (T, 2) along a trajectory (T, 4) of the task space: lip x, y, z in metres, tilt in radians."""
        states = np.asarray(trajectory, float)
        return np.array([self.watch(state[:3], state[3], fill_m3, second_fill_m3) for state in states])


class _Ensemble:
    """Classifiers of one set as arrays, a row each: one product answers for all of them."""

    def __init__(self, models: list[Model], parameters: Mapping[str, Mapping[str, float]]) -> None:
        first = models[0]
        self._variables, self._terms = first.variables, first.terms
        self._divisors = [_divisor(reference, parameters, first) for reference in first.references]
        self._mean, self._std, self._weights = (
            np.array([getattr(model, name) for model in models]) for name in ("mean", "std", "weights")
        )
        self._intercept = np.array([model.intercept for model in models])

    def probability(self, values: Mapping[str, float]) -> float:
        """Return the mean over the classifiers."""
        try:
            pairs = zip(self._variables, self._divisors, strict=True)
            features = np.array([values[name] / divisor for name, divisor in pairs])
        except KeyError as error:
            raise PipelineError(
                f"watching: expected classifiers of {' '.join(values)}, found one that needs {error.args[0]}; "
                "learn them with classify.margin: none"
            ) from error
        terms = expanded((features - self._mean) / self._std, self._terms)
        return float(expit(np.einsum("mt,mt->m", terms, self._weights) + self._intercept).mean())


def _divisor(reference: str | None, parameters: Mapping[str, Mapping[str, float]], model: Model) -> float:
    if reference is None:
        return 1.0
    container, _, name = reference.partition(".")
    try:
        return float(parameters[container][name])
    except KeyError as error:
        raise PipelineError(
            f"{model.experiment}/{model.features}: expected the parameter {reference}, found no {error.args[0]}; give it"
        ) from error


def offset_m(held: pd.Series, second: pd.Series) -> np.ndarray:
    """Return what takes the lip from the opening's centre to the offset between the clouds' centres (3,), cup upright, metres.

    held, second: rows of the table `parameters`. The standard features go by these centres; the second stands with its x along
    the pour.
    """
    lip, opening, centre = (_point(held, name) for name in ("lip", "opening", "centre"))
    yaw_rad = float(np.arctan2(*(lip - opening)[1::-1]))
    upright = rotation_about(UP, -yaw_rad)
    return upright @ (centre - lip) - (_point(second, "centre") - _point(second, "opening"))


def _point(row: pd.Series, what: str) -> np.ndarray:
    return np.array([row[f"{what}_{axis}_m"] for axis in "xyz"], float)


def pair_watcher(
    pouring: list[Model],
    filling: list[Model],
    parameters: pd.DataFrame,
    features: str,
    held: str,
    second: str,
    portion: Portion | None = None,
) -> Watcher:
    """Return the watcher of a pair, from classifiers of one feature set and the table `parameters`."""
    mapping = "label_mapping" if features == STANDARD else features
    table = parameters[parameters["mapping"] == mapping].set_index("object")
    for name in (held, second):
        if name not in table.index:
            raise PipelineError(
                f"{name}: expected an object with warped parameters ({' '.join(table.index)}), found none; "
                "run: snakemake -c2 reports/roc.pdf"
            )
    rows = {"held": table.loc[held], "second": table.loc[second]}
    moved = offset_m(rows["held"], rows["second"]) if features == STANDARD else None
    numbers = {container: row.drop("mapping").to_dict() for container, row in rows.items()}
    return Watcher(pouring, filling, numbers, moved, portion)


def from_run(
    processed: str | Path,
    source: str,
    held: str,
    second: str,
    *,
    features: str = "label_mapping",
    training_object: str | None = None,
    portion: Portion | None = None,
) -> Watcher:
    """Return the watcher of a pair from the folder data/processed of a run.

    source: the annotated object; training_object: whose trials the classifiers learnt from, the source's if not given.
    """
    path = Path(processed) / "parametrise" / source / "parameters.parquet"
    parameters = read_table(path, "parameters")
    pouring, filling = (
        chosen(classifiers(processed, experiment), features, training_object or source)
        for experiment in ("pouring", "filling")
    )
    return pair_watcher(pouring, filling, parameters, features, held, second, portion)
