"""The numbers of the evaluation: scores with intervals over objects, paired tests, calibration, DeLong beside them."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from pipeline.report.claims import CLAIMS, answer
from pipeline.statistics.delong import NORMAL_95, delong_std
from pipeline.statistics.rates import weighted_rates
from pipeline.statistics.resampling import COLUMNS, Resampled, interval, two_sided_p

Numbers = dict[str, float]
PAIRED = (("label_mapping", "standard"), ("point_mapping", "standard"), ("label_mapping", "point_mapping"))
BINS = 10


def by_name(replicates: pd.DataFrame) -> dict[str, np.ndarray]:
    """Return `classify.<experiment>.<features>.<split>.<measure>` → values (1 + R,), replicate 0 first, of a table `replicates`."""
    found = {}
    keys = ["experiment", "features", "split"]
    for key, rows in replicates.sort_values("replicate").groupby(keys, observed=True, sort=False):
        for measure in COLUMNS:
            values = rows[measure].to_numpy()
            if np.isfinite(values[0]):
                found[".".join(["classify", *map(str, key), measure])] = values
    return found


def with_interval(name: str, values: np.ndarray) -> Numbers:
    """Return the value and the ends of its 95 % interval; what does not exist (an area where all have one label) is left out."""
    value, low, high = interval(values)
    if not np.isfinite(value):
        return {}
    return {name: value} | ({f"{name}.low": low, f"{name}.high": high} if np.isfinite(low) else {})


def score_numbers(values: Mapping[str, np.ndarray]) -> Numbers:
    """Return each score with its interval, and the paired differences between feature sets with theirs and a p value."""
    numbers: Numbers = {}
    for name, of_replicates in values.items():
        numbers |= with_interval(name.replace("classify.", "evaluation."), of_replicates)
    for name in values:
        _, experiment, features, split, measure = name.split(".")
        for better, worse in PAIRED:
            other = f"classify.{experiment}.{worse}.{split}.{measure}"
            if features == better and other in values:
                head = f"evaluation.{experiment}.{better}_minus_{worse}.{split}.{measure}"
                difference = values[name] - values[other]
                numbers |= with_interval(head, difference)
                if head in numbers:
                    numbers[f"{head}.p"] = two_sided_p(difference)
    return numbers


def object_numbers(pairs: pd.DataFrame, weights: np.ndarray) -> Numbers:
    """Return each object's mean area over the others, as trainer and as test, with intervals; weights are (1 + R, objects).

    Of one pair of objects nothing can be drawn again: a row or a column of the matrix is resampled by its other objects.
    """
    numbers: Numbers = {}
    names = list(dict.fromkeys(pairs["training_object"]))
    for (experiment, features), rows in pairs.groupby(["experiment", "features"], observed=True):
        areas = rows.pivot_table(
            index="training_object", columns="test_object", values="auc", aggfunc="mean", observed=True
        )
        matrix = areas.reindex(index=names, columns=names).to_numpy(float, copy=True)
        np.fill_diagonal(matrix, np.nan)
        for role, lines in (("trained_on", matrix), ("tested_on", matrix.T)):
            for name, line in zip(names, lines, strict=True):
                told = np.isfinite(line)
                total = weights[:, told].sum(axis=1)
                if told.any():
                    with np.errstate(invalid="ignore"):  # a replicate without any of the others is left out
                        values = weights[:, told] @ line[told] / total
                    numbers |= with_interval(f"evaluation.{experiment}.{features}.{role}.{name}.auc", values)
    return numbers


def fit_numbers(experiment: str, scores: pd.DataFrame) -> Numbers:
    """Return how the fits went: separable sets, converged fits, most iterations, redrawn sets of one class."""
    trained = scores[(scores["features"] != "hydrostatic") & (scores["split"] == "same")]
    head = f"evaluation.{experiment}"
    sets = trained.drop_duplicates(["training_object", "draw"])
    numbers: Numbers = {
        f"{head}.fits": len(trained),
        f"{head}.converged_share": float(trained["converged"].mean()),
        f"{head}.iterations_max": int(trained["n_iterations"].max()),
        f"{head}.redrawn": int(sets["n_redrawn"].sum()),
    }
    for features, rows in trained.groupby("features", observed=True):
        numbers[f"{head}.{features}.separable_share"] = float(rows["separable"].mean())
    return numbers


def calibration(predictions: pd.DataFrame, names: list[str], weights: np.ndarray) -> dict[str, Any]:
    """Return for predictions of one feature set on novel objects the reliability curve of each replicate.

    `predicted`, `observed`: mean probability and share of successes (1 + R, BINS), nan where a bin is empty; `error` (1 + R,): the
    mean distance of the two, weighted by trials (expected calibration error).
    """
    n = len(names)
    trainer, test = (
        pd.Index(names).get_indexer(predictions[column]) for column in ("training_object", "test_object")
    )
    probability = predictions["probability"].to_numpy(float)
    cell = (trainer * n + test) * BINS + np.minimum((probability * BINS).astype(int), BINS - 1)
    counts, predicted, observed = (
        weights_of_cells(weights, np.bincount(cell, values, minlength=n * n * BINS).reshape(n, n, BINS))
        for values in (np.ones(len(cell)), probability, predictions["label"].to_numpy(float))
    )
    with np.errstate(invalid="ignore"):
        predicted, observed = predicted / counts, observed / counts
    gap = np.nan_to_num(np.abs(predicted - observed))
    return {"predicted": predicted, "observed": observed, "error": (gap * counts).sum(1) / counts.sum(1)}


def weights_of_cells(weights: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return Σ over trainers i and tests j of w_i w_j cells[i, j] (1 + R, BINS); no object is novel to itself."""
    off = cells * (1.0 - np.eye(len(cells)))[:, :, None]
    return np.einsum("ri,rj,ijb->rb", weights, weights, off)


def delong_numbers(
    experiment: str, predictions: pd.DataFrame, names: list[str], weights: np.ndarray
) -> Numbers:
    """Return half widths of 95 % intervals of single classifiers' areas on novel objects, means over training objects at draw 0.

    By DeLong, as if trials were independent; by the bootstrap over tested objects; and how much too narrow the first is.
    """
    numbers: Numbers = {}
    first = predictions[predictions["draw"] == 0]
    for features, of_set in first.groupby("features", observed=True):
        halves = []
        for _, rows in of_set.groupby("training_object", observed=True):
            labels, scores = rows["label"].to_numpy(), rows["probability"].to_numpy(float)
            if labels.all() or not labels.any():
                continue
            groups = pd.Index(names).get_indexer(rows["test_object"])
            _, low, high = interval(weighted_rates(labels, scores, groups, weights)[:, 0])
            halves.append((NORMAL_95 * delong_std(labels, scores), (high - low) / 2.0))
        if halves:
            delong, objects = np.mean(halves, axis=0)
            head = f"evaluation.{experiment}.{features}.novel.auc_half_width"
            numbers |= {f"{head}.delong": float(delong), f"{head}.over_objects": float(objects)}
            numbers[f"{head}.ratio"] = float(objects / delong)
    return numbers


def halves(
    predictions: pd.DataFrame, half_of: pd.Series, names: list[str], weights: np.ndarray
) -> dict[str, np.ndarray]:
    """Return `classify.filling.<features>.novel.<half>.auc` → values (1 + R,) of novel fillings of each half alone.

    `half_of` has the half of each trial by (object, trial).
    """
    found = {}
    index = pd.MultiIndex.from_frame(predictions[["test_object", "trial"]].astype({"test_object": str}))
    half = half_of.reindex(index).to_numpy()
    for name in pd.unique(half):
        resampled = Resampled(names, weights)
        for (features, trainer, _), rows in predictions[half == name].groupby(
            ["features", "training_object", "draw"], observed=True
        ):
            tested = resampled.groups(rows["test_object"].astype(str).to_numpy())
            resampled.add(
                (features,),
                str(trainer),
                tested,
                rows["label"].to_numpy(),
                rows["probability"].to_numpy(float),
            )
        for features, rows in resampled.table("features").groupby("features"):
            found[f"classify.filling.{features}.novel.{name}.auc"] = rows["auc"].to_numpy()
    return found


def claim_rows(values: Mapping[str, np.ndarray]) -> pd.DataFrame:
    """Return a row a claim that the values can tell: name, section, words, measure, value, low, high, holds, sure, why.

    `sure`: the whole interval is on one side.
    """
    rows = []
    for claim in CLAIMS:
        try:
            numbers = np.atleast_1d(claim.number(values))
        except KeyError:
            continue
        value, low, high = interval(numbers) if len(numbers) > 1 else (float(numbers[0]),) * 3
        if not np.isfinite([value, low, high]).all():
            continue  # too few objects, or one of them has one outcome only
        answered = answer(claim.holds, value, low, high)
        head = {"name": claim.name, "section": claim.section, "words": claim.words, "measure": claim.measure}
        rows.append({**head, **answered, "why": "" if answered["holds"] else claim.why})
    return pd.DataFrame(rows)
