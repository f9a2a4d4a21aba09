"""DeLong, DeLong and Clarke-Pearson's variance of the area under one ROC curve, as if trials were independent (Biometrics 1988)."""

import numpy as np
from scipy.stats import rankdata

NORMAL_95 = 1.959964


def delong_std(labels: np.ndarray, scores: np.ndarray) -> float:
    """Return the standard deviation of the area under the curve of labels (N,) and scores (N,).

    By midranks: Sun and Xu, Fast implementation of DeLong's algorithm, IEEE Signal Processing Letters 2014.
    """
    labels = np.asarray(labels, bool)
    positive, negative = scores[labels], scores[~labels]
    ranks = rankdata(scores)
    n_positive, n_negative = len(positive), len(negative)
    of_positive = (ranks[labels] - rankdata(positive)) / n_negative
    of_negative = 1.0 - (ranks[~labels] - rankdata(negative)) / n_positive
    return float(np.sqrt(of_positive.var(ddof=1) / n_positive + of_negative.var(ddof=1) / n_negative))
