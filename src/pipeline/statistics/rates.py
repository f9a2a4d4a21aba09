"""ROC measures of weighted groups of trials, many weightings at once."""

import numpy as np
from numba import njit

MEASURES = ("auc", "partial_auc", "tpr_at_fpr_00", "tpr_at_fpr_01", "tpr_at_fpr_05")
FPRS = np.array([0.0, 0.01, 0.05])
PARTIAL_FPR = 0.1  # the partial area is the mean true positive rate up to this false positive rate


def weighted_rates(
    labels: np.ndarray, scores: np.ndarray, groups: np.ndarray, weights: np.ndarray
) -> np.ndarray:
    """Return `MEASURES` (R, 5) of labels (N,) and scores (N,) when group g of `groups` (N,) counts weights[:, g] times.

    Weights are (R, G). The rates are those of the pooled trials, under one threshold; nan where a class has no weight.
    """
    order = np.argsort(-scores, kind="stable")
    ends = np.append(np.flatnonzero(np.diff(scores[order])), len(order) - 1)
    tie_end = np.zeros(len(order), dtype=np.bool_)
    tie_end[ends] = True
    counts = [np.bincount(groups[labels == true], minlength=weights.shape[1]) for true in (True, False)]
    weights = np.asarray(weights, float)
    positives, negatives = (weights @ count for count in counts)
    return _sweep(labels[order], groups[order].astype(np.int64), tie_end, weights, positives, negatives)


@njit(cache=True)
def _sweep(
    labels: np.ndarray,
    groups: np.ndarray,
    tie_end: np.ndarray,
    weights: np.ndarray,
    positives: np.ndarray,
    negatives: np.ndarray,
) -> np.ndarray:
    out = np.full((len(weights), 5), np.nan)
    for r in range(len(weights)):
        if positives[r] > 0.0 and negatives[r] > 0.0:
            _measure(labels, groups, tie_end, weights[r], positives[r], negatives[r], out[r])
    return out


@njit(cache=True)
def _measure(
    labels: np.ndarray,
    groups: np.ndarray,
    tie_end: np.ndarray,
    weight: np.ndarray,
    positives: float,
    negatives: float,
    out: np.ndarray,
) -> None:
    area = partial = true = false = true_before = false_before = 0.0
    limit, found = PARTIAL_FPR * negatives, np.zeros(len(FPRS))
    allowed = (FPRS + 1e-12) * negatives
    for n in range(len(labels)):
        if labels[n]:
            true += weight[groups[n]]
        else:
            false += weight[groups[n]]
        if not tie_end[n]:
            continue
        step = false - false_before
        if false_before < limit:
            if step > 0.0:
                inside = min(step, limit - false_before)
                partial += inside * (true_before + (true - true_before) * inside / step / 2.0)
            for k in range(len(allowed)):
                if false <= allowed[k]:
                    found[k] = true
        if step > 0.0:
            area += step * (true + true_before) / 2.0
        true_before, false_before = true, false
    out[0], out[1] = area / positives / negatives, partial / positives / limit
    out[2:] = found / positives
