"""The pages of reports/watching.pdf: probabilities about the first drop, and how long before it they spoke."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from pipeline.report.style import COLOURS, RC, WORDS
from pipeline.report.watching_numbers import EXECUTION, LIKELY, Curve

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ABOUT_S = np.linspace(-2.5, 2.0, 181)
POUR, FILL = "#0072B2", "#D55E00"
MARKERS = {"label_mapping": "o", "point_mapping": "s", "standard": "^"}
CONTENTS = {"balls": "gel balls", "liquid": "liquid"}


def moments(found: list[Curve], outcomes: Mapping[str, pd.DataFrame]) -> "Figure":
    """Return the page of curves by label mapping: a panel a pair, time from the first gel ball's drop; the bands hold all draws."""
    import matplotlib.pyplot as plt

    shown = [c for c in found if c.classifiers == c.execution[2] == "label_mapping"]
    pairs = list(dict.fromkeys(curve.execution[:2] for curve in shown))
    rows = -(-len(pairs) // 3)
    with plt.rc_context(RC):
        figure, axes = plt.subplots(
            rows, 3, figsize=(7.2, 0.9 + 1.6 * rows), sharex=True, sharey=True, squeeze=False
        )
        for axis, pair in zip(axes.flat, pairs, strict=False):
            _panel(axis, [c for c in shown if c.execution[:2] == pair], outcomes)
            axis.set_title(" into ".join(pair).replace("_", " "), fontsize=8)
        for axis in axes.flat[len(pairs) :]:
            axis.axis("off")
        for column in range(min(3, len(pairs))):
            lowest = axes[(len(pairs) - 1 - column) // 3, column]
            lowest.set_xlabel("time from the first ball's drop (s)")
            lowest.tick_params(labelbottom=True)
        for row in axes:
            row[0].set_ylabel("probability")
        axes[0, 0].set(xlim=(ABOUT_S[0], ABOUT_S[-1]), ylim=(-0.03, 1.03))
        _legend(figure)
        figure.tight_layout(rect=(0.0, 0.0, 1.0, 1.0 - 0.32 / figure.get_figheight()))
    return figure


def _panel(axis: "Axes", shown: list[Curve], outcomes: Mapping[str, pd.DataFrame]) -> None:
    by_key = {contents: table.set_index(EXECUTION) for contents, table in outcomes.items()}
    pour, fill = [], []
    for curve in shown:
        drop_s = by_key["balls"].at[curve.execution, "first_drop_s"]
        if not np.isfinite(drop_s):
            continue
        at = curve.t_s - drop_s
        pour.append(np.interp(ABOUT_S, at, curve.pour, left=np.nan, right=np.nan))
        fill.append(np.interp(ABOUT_S, at, curve.fill, left=np.nan, right=np.nan))
        liquid_s = by_key["liquid"]["first_drop_s"].get(curve.execution, np.nan)
        axis.plot([liquid_s - drop_s] * 2, [-0.03, 0.05], color="0.3", lw=0.8)
    axis.axhline(LIKELY, color="0.7", lw=0.6, ls=":")
    axis.axvline(0.0, color="black", lw=0.8)
    for rows, colour, style in ((pour, POUR, "-"), (fill, FILL, "--")):
        if rows:
            together = np.array(rows)
            known = ~np.isnan(together).any(axis=0)
            x, y = ABOUT_S[known], together[:, known]
            axis.fill_between(x, y.min(axis=0), y.max(axis=0), color=colour, alpha=0.2, lw=0)
            axis.plot(x, np.median(y, axis=0), color=colour, lw=1.3, ls=style)


def _legend(figure: "Figure") -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles = [
        Line2D([], [], color=POUR, lw=1.3, label="p(pour), median of the draws"),
        Line2D([], [], color=FILL, lw=1.3, ls="--", label="p(fill)"),
        Patch(color="0.5", alpha=0.3, lw=0, label="least to greatest"),
        Line2D([], [], color="black", lw=0.8, label="first ball"),
        Line2D([], [], color="0.3", lw=0, marker="|", ms=5, label="first drop of liquid"),
    ]
    figure.legend(handles=handles, loc="upper center", ncols=5, frameon=False, columnspacing=1.2)


def leads(rows: pd.DataFrame) -> "Figure":
    """Return the page of leads: by how many degrees p(pour) passed one half before the first drop, a row a held object."""
    import matplotlib.pyplot as plt

    names = sorted(set(rows["held_object"]))
    kinds = [name for name in CONTENTS if name in set(rows["contents"])]
    with plt.rc_context(RC):
        figure, axes = plt.subplots(
            1,
            len(kinds),
            figsize=(7.2, 1.3 + 0.36 * len(names)),
            sharex=True,
            sharey=True,
            squeeze=False,
            layout="constrained",
        )
        for axis, contents in zip(axes[0], kinds, strict=True):
            _leads(axis, rows[rows["contents"] == contents], names)
            axis.set_title(f"{CONTENTS[contents]} in the held cup", fontsize=8)
            axis.set_xlabel("tilt from p(pour) > ½ to the first drop (°)\nleft of 0: it dropped before")
        axes[0, 0].set_yticks(range(len(names)), [name.replace("_", " ") for name in names])
        axes[0, 0].invert_yaxis()
        figure.legend(
            *axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False
        )
    return figure


def _leads(axis: "Axes", rows: pd.DataFrame, names: list[str]) -> None:
    axis.axvline(0.0, color="black", lw=0.8)
    axis.grid(axis="y", lw=0.3, color="0.85")
    for number, (features, marker) in enumerate(MARKERS.items()):
        own = rows[rows["classifiers"] == features].dropna(subset=["lead_deg"])
        quantiles = own.groupby("held_object")["lead_deg"].quantile([0.05, 0.5, 0.95]).unstack()
        if quantiles.empty:
            continue
        at = [names.index(name) + 0.22 * (number - 1) for name in quantiles.index]
        colour = COLOURS[features]
        axis.hlines(at, quantiles[0.05], quantiles[0.95], color=colour, lw=0.8)
        axis.plot(quantiles[0.5], at, marker, color=colour, ms=3.5, label=WORDS[features])
