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
    limits = np.vstack([(FPRS[:, None] + 1e-12) * negatives, PARTIAL_FPR * negatives])
    sums = np.zeros((2 + len(FPRS), len(weights)))
    _sweep(
        labels[order], groups[order].astype(np.int64), tie_end, np.ascontiguousarray(weights.T), limits, sums
    )
    out = np.full((len(weights), 2 + len(FPRS)), np.nan)
    both = (positives > 0.0) & (negatives > 0.0)
    positives, negatives, sums = positives[both], negatives[both], sums[:, both]
    out[both, 0] = sums[0] / positives / negatives
    out[both, 1] = sums[1] / positives / limits[-1, both]
    out[both, 2:] = (sums[2:] / positives).T
    return out


@njit(cache=True)
def _sweep(
    labels: np.ndarray,
    groups: np.ndarray,
    tie_end: np.ndarray,
    weights: np.ndarray,
    limits: np.ndarray,
    sums: np.ndarray,
) -> None:
    """Go down the sorted trials (N,) once for all weightings, weights (G, R); the inner loops run over R, in vectors.

    Adds to sums (5, R): the area, that up to the last of `limits` (4, R), true positives at the others; in units of weight.
    """
    n_weightings = weights.shape[1]
    true, false = np.zeros(n_weightings), np.zeros(n_weightings)
    true_before, false_before = np.zeros(n_weightings), np.zeros(n_weightings)
    area, partial, found = sums[0], sums[1], sums[2:]
    early = True
    for n in range(len(labels)):
        weight = weights[groups[n]]
        if labels[n]:
            for r in range(n_weightings):
                true[r] += weight[r]
        else:
            for r in range(n_weightings):
                false[r] += weight[r]
        if not tie_end[n]:
            continue
        if early:
            room = 0.0
            for r in range(n_weightings):
                step = false[r] - false_before[r]
                inside = max(min(step, limits[3, r] - false_before[r]), 0.0)
                share = inside / step if step > 0.0 else 0.0
                partial[r] += inside * (true_before[r] + (true[r] - true_before[r]) * share / 2.0)
                room = max(room, limits[3, r] - false[r])
                for k in range(3):
                    if false[r] <= limits[k, r]:
                        found[k, r] = true[r]
            early = room > 0.0
        for r in range(n_weightings):
            area[r] += (false[r] - false_before[r]) * (true[r] + true_before[r]) / 2.0
            true_before[r], false_before[r] = true[r], false[r]
