"""The paper's claims about its Fig. 3, each as a number and whether it holds here (section IV-A)."""

from collections.abc import Callable

Metrics = dict[str, float]

ALIKE = 0.01  # areas under the curve nearer than this are alike: one is not above the other


def claims(metrics: Metrics) -> Metrics:
    """Return `claims.<name>` (the number) and `claims.<name>.holds` (1 or 0) of each claim that the metrics can tell."""
    found: Metrics = {}
    for name, (number, holds) in CLAIMS.items():
        try:
            value = number(metrics)
        except KeyError:
            continue  # a single object has no novel ones
        found[f"claims.{name}"], found[f"claims.{name}.holds"] = value, int(holds(value))
    return found


def _auc(metrics: Metrics, experiment: str, features: str, split: str) -> float:
    return metrics[f"classify.{experiment}.{features}.{split}.auc"]


def _standard_behind_on_training_object(metrics: Metrics) -> float:
    return _auc(metrics, "filling", "label_mapping", "same") - _auc(metrics, "filling", "standard", "same")


def _smaller_drop(experiment: str) -> Callable[[Metrics], float]:
    def number(metrics: Metrics) -> float:
        drops = {
            features: _auc(metrics, experiment, features, "same")
            - _auc(metrics, experiment, features, "novel")
            for features in ("label_mapping", "point_mapping", "standard")
        }
        return drops["standard"] - max(drops["label_mapping"], drops["point_mapping"])

    return number


def _label_over_point(experiment: str) -> Callable[[Metrics], float]:
    return lambda metrics: (
        _auc(metrics, experiment, "label_mapping", "novel")
        - _auc(metrics, experiment, "point_mapping", "novel")
    )


# Each: a number from the metrics, and when it agrees with the paper's words.
CLAIMS: dict[str, tuple[Callable[[Metrics], float], Callable[[float], bool]]] = {
    "pouring_same_alike": (
        lambda metrics: metrics["classify.pouring.same_auc_difference_max"],
        lambda x: x < 1e-6,
    ),
    "filling_standard_behind_on_training_object": (_standard_behind_on_training_object, lambda x: x > ALIKE),
    "pouring_smaller_drop_when_warped": (_smaller_drop("pouring"), lambda x: x > ALIKE),
    "filling_smaller_drop_when_warped": (_smaller_drop("filling"), lambda x: x > ALIKE),
    "pouring_label_above_point_mapping": (_label_over_point("pouring"), lambda x: x > ALIKE),
    "filling_label_like_point_mapping": (_label_over_point("filling"), lambda x: abs(x) < ALIKE),
    "pouring_true_positives_at_almost_no_false": (
        lambda metrics: metrics["classify.pouring.label_mapping.novel.tpr_at_fpr_01"],
        lambda x: x > 0.5,
    ),
}
