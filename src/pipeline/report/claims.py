"""The paper's claims about its Fig. 3, each in its words, as a number, and whether it holds here (sections III-A and IV-A).

A number is a function of metrics by name (`classify.<experiment>.<features>.<split>.<measure>`), which are numbers or arrays of one
value a bootstrap replicate.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

Metrics = Mapping[str, Any]

ALIKE = 0.01  # areas under the curve nearer than this are alike: one is not above the other
NEAR_CEILING = 0.05  # our reading of "reliably": so near to the area that hydrostatics reaches
SETS = ("label_mapping", "point_mapping", "standard")


@dataclass(frozen=True)
class Claim:
    """The paper's `words` in a section, what `number` is of the metrics, when it `holds`, and `why` where it does not."""

    name: str
    section: str
    words: str
    measure: str
    number: Callable[[Metrics], Any]
    holds: Callable[[float], bool]
    why: str = ""


def answer(holds: Callable[[float], bool], value: float, low: float, high: float) -> dict[str, Any]:
    """Return a claim's number with its interval, whether it holds, and whether the whole interval is on one side (`sure`)."""
    held = bool(holds(value))
    sure = all(bool(holds(end)) == held for end in (low, high))
    return {"value": value, "low": low, "high": high, "holds": held, "sure": sure}


def claims(metrics: Metrics) -> dict[str, float]:
    """Return `claims.<name>` (the number) and `claims.<name>.holds` (1 or 0) of each claim that the metrics can tell."""
    found: dict[str, float] = {}
    for claim in CLAIMS:
        try:
            value = float(claim.number(metrics))
        except KeyError:
            continue  # a single object has no novel ones
        found[f"claims.{claim.name}"], found[f"claims.{claim.name}.holds"] = value, int(claim.holds(value))
    return found


def _auc(metrics: Metrics, experiment: str, features: str, split: str) -> Any:
    return metrics[f"classify.{experiment}.{features}.{split}.auc"]


def _drop(metrics: Metrics, experiment: str, features: str) -> Any:
    return _auc(metrics, experiment, features, "same") - _auc(metrics, experiment, features, "novel")


def _above(experiment: str, better: str, worse: str, split: str) -> Callable[[Metrics], Any]:
    return lambda metrics: _auc(metrics, experiment, better, split) - _auc(metrics, experiment, worse, split)


def _least_drop(experiment: str) -> Callable[[Metrics], Any]:
    return lambda metrics: _extreme(np.minimum, [_drop(metrics, experiment, features) for features in SETS])


def _smaller_drop(experiment: str) -> Callable[[Metrics], Any]:
    def number(metrics: Metrics) -> Any:
        warped = [_drop(metrics, experiment, features) for features in SETS[:2]]
        return _drop(metrics, experiment, "standard") - _extreme(np.maximum, warped)

    return number


def _better_separation(experiment: str) -> Callable[[Metrics], Any]:
    def number(metrics: Metrics) -> Any:
        warped = [_auc(metrics, experiment, features, "novel") for features in SETS[:2]]
        return _extreme(np.minimum, warped) - _auc(metrics, experiment, "standard", "novel")

    return number


def _extreme(function: Callable[..., Any], values: list[Any]) -> Any:
    """Return the least or greatest, replicate by replicate; of numbers a number."""
    result = values[0]
    for value in values[1:]:
        result = function(result, value)
    return result


_DROP_WORDS = "the performance of all three classifiers decreases when generalizing to novel objects"
_LESS_WORDS = "the drop in performance is considerably less when using the warped parameters"
_SEPARATION_WORDS = (
    "the features based on the warped parameters are better at separating the positive and negative examples "
    "across different objects"
)
_RELIABLE_WORDS = (
    "the warping parameters can be used to reliably generalize the constraints of the pouring task between "
    "different containers"
)

CLAIMS = (
    Claim(
        "pouring_same_alike",
        "IV-A",
        "the classifiers generally achieved similar levels of performance when evaluated on the training object",
        "pouring: largest difference of areas between the feature sets, same object",
        lambda metrics: metrics["classify.pouring.same_auc_difference_max"],
        lambda x: x < 1e-6,
    ),
    Claim(
        "filling_standard_behind_on_training_object",
        "IV-A",
        "the standard features performed considerably worse in the filling experiment, as different cups were used "
        "for pouring",
        "filling, same object: area, label mapping − standard",
        _above("filling", "label_mapping", "standard", "same"),
        lambda x: x > ALIKE,
        "All trials tilt by 120° and hold ten particles: as constants these features are harmless, divided by the held cup's "
        "parameters they only tell which cup it is, and 50 samples overfit that.",
    ),
    *(
        Claim(
            f"{experiment}_all_drop",
            "IV-A",
            _DROP_WORDS,
            f"{experiment}: least drop of the area of the three, same − novel",
            _least_drop(experiment),
            lambda x: x > 0.0,
        )
        for experiment in ("pouring", "filling")
    ),
    *(
        Claim(
            f"{experiment}_smaller_drop_when_warped",
            "IV-A",
            _LESS_WORDS,
            f"{experiment}: drop of standard − greater drop of the two warped",
            _smaller_drop(experiment),
            lambda x: x > ALIKE,
        )
        for experiment in ("pouring", "filling")
    ),
    *(
        Claim(
            f"{experiment}_warped_separate_better",
            "IV-A",
            _SEPARATION_WORDS,
            f"{experiment}, novel objects: area, lesser of the two warped − standard",
            _better_separation(experiment),
            lambda x: x > ALIKE,
        )
        for experiment in ("pouring", "filling")
    ),
    Claim(
        "filling_label_like_point_mapping",
        "IV-A",
        "the two warping methods performed similarly well on the filling experiment",
        "filling, novel objects: area, label − point mapping",
        _above("filling", "label_mapping", "point_mapping", "novel"),
        lambda x: abs(x) < ALIKE,
    ),
    Claim(
        "pouring_label_above_point_mapping",
        "IV-A",
        "the label mapping approach performed better in the pouring experiment",
        "pouring, novel objects: area, label − point mapping",
        _above("pouring", "label_mapping", "point_mapping", "novel"),
        lambda x: x > ALIKE,
        "On complete scans both mappings give nearly the same hulls.",
    ),
    Claim(
        "pouring_true_positives_at_almost_no_false",
        "IV-A",
        "detecting more than 50% of the true positives with almost no false positives",
        "pouring, novel objects, label mapping: true positive rate at 1 % false positives",
        lambda metrics: metrics["classify.pouring.label_mapping.novel.tpr_at_fpr_01"],
        lambda x: x > 0.5,
    ),
    Claim(
        "filling_misses_are_learnt",
        "III-A",
        "these features allow the robot to learn when the poured liquid will miss the second container",
        "filling with uniform fills, novel objects, label mapping: area",
        lambda metrics: metrics["classify.filling.label_mapping.novel.relative.auc"],
        lambda x: x > 0.75,  # our reading: half way from chance to perfect
    ),
    Claim(
        "filling_overflow_is_predicted",
        "III-A",
        "… as well as predict when the container will overflow",
        "filling with little room, novel objects, label mapping: area",
        lambda metrics: metrics["classify.filling.label_mapping.novel.free_room.auc"],
        lambda x: x > 0.75,
        "Almost full containers overflow in nearly every trial that hits, so that few positive ones are left to rank.",
    ),
    *(
        Claim(
            f"{experiment}_reliable_on_novel_objects",
            "IV-A",
            _RELIABLE_WORDS,
            f"{experiment}, novel objects: area, hydrostatics − label mapping",
            _above(experiment, "hydrostatic", "label_mapping", "novel"),
            lambda x: x < NEAR_CEILING,
            why,
        )
        for experiment, why in (
            ("pouring", ""),
            (
                "filling",
                "A plane through six features is no model of a stream that must land in a circle and find room.",
            ),
        )
    ),
)
