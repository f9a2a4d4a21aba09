"""The page of the conditioned primitive: what it makes of pairs that it was not shown, beside the one that is scaled to them."""

from typing import TYPE_CHECKING

import numpy as np

from pipeline.report.style import COLOURS, RC, WORDS

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pipeline.motion.conditioned import ConditionedProMP
    from pipeline.motion.promp import ProMP

PHASE = np.linspace(0.0, 1.0, 201)
SHOWN = {0: "X, along the pour (m)", 2: "Z, up (m)", 3: "tilt (rad)"}
STYLES = {"label_mapping": "--", "conditioned": "-"}


def draw(
    conditioned: "ConditionedProMP", scaled: "ProMP", parameters: "pd.DataFrame", pairs: list[tuple[str, str]]
) -> "Figure":
    """Return a row a pair (held, target): means and two standard deviations of both, metres and radians.

    scaled: the primitive of label mapping, dimensionless; parameters: the table `parameters`.
    """
    import matplotlib.pyplot as plt

    with plt.rc_context(RC):
        figure, axes = plt.subplots(
            len(pairs),
            3,
            figsize=(7.2, 0.7 + 1.45 * len(pairs)),
            sharex=True,
            sharey="col",
            squeeze=False,
            layout="constrained",
        )
        for row, pair in zip(axes, pairs, strict=True):
            _row(row, conditioned, scaled, parameters, pair)
        for axis, word in zip(axes[0], SHOWN.values(), strict=True):
            axis.set_title(word, fontsize=8)
        for axis in axes[-1]:
            axis.set(xlabel="phase", xlim=(0.0, 1.0))
        handles, _ = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles=handles, loc="outside upper center", ncols=2, frameon=False)
    return figure


def _row(
    row: "np.ndarray",
    conditioned: "ConditionedProMP",
    scaled: "ProMP",
    parameters: "pd.DataFrame",
    pair: tuple[str, str],
) -> None:
    from pipeline.motion import scaling
    from pipeline.motion.conditioned import log_parameters

    both = {
        "label_mapping": scaled.scaled(scaling.factors(parameters, "label_mapping", *pair)),
        "conditioned": conditioned.given(log_parameters(parameters, "label_mapping", *pair)),
    }
    for features, promp in both.items():
        for axis, number in zip(row, SHOWN, strict=True):
            _band(axis, promp, number, features)
    row[0].set_ylabel("\ninto ".join(pair).replace("_", " "))


def _band(axis: "Axes", promp: "ProMP", number: int, features: str) -> None:
    mean, deviation = promp.mean(PHASE)[:, number], promp.deviation(PHASE)[:, number]
    colour, word = (
        COLOURS[features],
        {"label_mapping": "scaled by label mapping"}.get(features, WORDS[features]),
    )
    axis.fill_between(PHASE, mean - 2.0 * deviation, mean + 2.0 * deviation, color=colour, alpha=0.2, lw=0)
    axis.plot(PHASE, mean, STYLES[features], color=colour, lw=1.3, label=f"{word}, ± 2 standard deviations")
