"""The page on engines: a column an engine, the same trials as the liquid's; which labels differ, and where."""

from typing import TYPE_CHECKING

import numpy as np

from pipeline.report.engines import LABELS, NEAR, WORDS, kappa
from pipeline.report.style import RC

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's colours with a marker each, so that print in grey tells them apart as well.
BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#7F7F7F"


def draw(both: "pd.DataFrame") -> "Figure":
    """Return the page (A4, portrait) from the trials that the liquid and other engines ran."""
    import matplotlib.pyplot as plt

    engines = list(dict.fromkeys(both["engine"]))
    with plt.rc_context(
        {**RC, "font.size": 7, "axes.labelsize": 7, "axes.titlesize": 8, "legend.fontsize": 6}
    ):
        figure = plt.figure(figsize=(8.27, 11.69))
        grid = figure.add_gridspec(
            5, max(2, len(engines)), left=0.12, right=0.97, top=0.96, bottom=0.05, hspace=0.55, wspace=0.3
        )
        for column, engine in enumerate(engines):
            rows, word = both[both["engine"] == engine], WORDS[engine]
            pours = rows[rows["experiment"] == "pouring"]
            axes = [figure.add_subplot(grid[row, column]) for row in range(5)]
            kappas(axes[0], rows, word)
            shares(axes[1], pours, word)
            plane(axes[2], pours, word)
            for axis, experiment in zip(axes[3:], LABELS, strict=True):
                margins(axis, rows[rows["experiment"] == experiment], word)
                axis.set_title(f"Where labels differ: {experiment}")
    return figure


def kappas(axis: "Axes", rows: "pd.DataFrame", word: str) -> None:
    """Cohen's κ of the labels, by object."""
    names = list(dict.fromkeys(rows["object"]))
    for k, (experiment, colour) in enumerate(zip(LABELS, (BLUE, ORANGE), strict=True)):
        part = rows[rows["experiment"] == experiment]
        if part.empty:
            continue
        values = [
            kappa(own["label_liquid"], own["label_other"])
            for own in (part[part["object"] == name] for name in names)
        ]
        total = kappa(part["label_liquid"], part["label_other"])
        label = f"{experiment}: {total:.2f} in all ({len(part)})"
        at = np.arange(len(names)) + 0.3 * (k - 0.5)
        axis.plot(values, at, marker="os"[k], ms=3.5, color=colour, ls="none", label=label)
    axis.set_yticks(range(len(names)), [name.replace("_", " ") for name in names])
    axis.set_ylim(-0.7, len(names) + 1.5)
    axis.set(title=f"Liquid and {word}", xlabel="Cohen's κ of the labels", xlim=(-0.3, 1.05))
    axis.legend(frameon=False, loc="upper left", ncol=2, handletextpad=0.1, columnspacing=0.8)


def shares(axis: "Axes", pours: "pd.DataFrame", word: str) -> None:
    """How much of the fill has left, by both."""
    axis.plot([0, 100], [0, 100], color=GREY, lw=0.8, ls="--")
    axis.plot(100 * pours["left_liquid"], 100 * pours["left_other"], ls="none", marker=".", ms=3, color=BLUE)
    axis.set(title="Poured", xlabel="by the liquid (% of the fill)", ylabel=f"by {word} (%)")


def plane(axis: "Axes", pours: "pd.DataFrame", word: str) -> None:
    """Pours by tilt and fill; those with different labels in colour."""
    tilts, fills = np.degrees(pours["tilt_rad"]), 100 * pours["fill"]
    axis.plot(tilts, fills, ls="none", marker=".", ms=2.5, color="0.75", label="labels agree")
    for alone, colour, marker, label in _alone(pours, word):
        axis.plot(
            tilts[alone], fills[alone], ls="none", marker=marker, ms=4, color=colour, mfc="none", label=label
        )
    axis.set(title="Pours", xlabel="tilt (°)", ylabel="fill (% of the fullest)", ylim=(0, 130))
    axis.legend(frameon=False, loc="upper center", ncol=3, handletextpad=0.1, columnspacing=0.8)


def margins(axis: "Axes", rows: "pd.DataFrame", word: str) -> None:
    """Where labels differ: by the hydrostatic margin, and who says yes."""
    edges = np.linspace(-1.0, 1.0, 21).tolist()
    inside = rows["margin"].clip(-1.0, 1.0)
    axis.axvspan(-NEAR, NEAR, color="0.95", lw=0)
    axis.hist(inside, edges, color="0.8", label="all")
    parts = _alone(rows, word)
    axis.hist(
        [inside[alone] for alone, *_ in parts],
        edges,
        stacked=True,
        color=[colour for _, colour, *_ in parts],
        label=[label for *_, label in parts],
    )
    axis.axvline(0.0, color=GREY, lw=0.8, ls="--")
    axis.set(xlabel="hydrostatic margin (share)", ylabel="trials")
    axis.set_ylim(top=1.35 * axis.get_ylim()[1])
    axis.legend(frameon=False, loc="upper center", ncol=3)


def _alone(rows: "pd.DataFrame", word: str) -> "list[tuple[pd.Series, str, str, str]]":
    """Return who alone says yes in which rows, with colour, marker and words."""
    liquid, other = rows["label_liquid"].astype(bool), rows["label_other"].astype(bool)
    return [
        (other & ~liquid, ORANGE, "^", f"{word} alone: yes"),
        (liquid & ~other, BLUE, "v", "liquid alone: yes"),
    ]
