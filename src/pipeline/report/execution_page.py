"""The pages of reports/execution.pdf: pictures before, during and after (the paper's Fig. 5), and what succeeded."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pipeline.report.execution_numbers import PAIR, by_pair, wilson
from pipeline.report.style import COLOURS, RC, WORDS

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOMENTS = ("before", "during", "after")
_INTO_FLOW_S = 0.25
_MARKERS = {"label_mapping": "o", "point_mapping": "s", "standard": "^", "conditioned": "D"}


@dataclass(frozen=True)
class Film:
    """One execution in pictures (F, H, W, 3) every `every_s`; `caption`: what is poured into what, and how it ended."""

    title: str
    caption: str
    images: np.ndarray
    every_s: float
    first_drop_s: float

    def moments(self) -> list[np.ndarray]:
        """Return the pictures before, during and after the pour."""
        flows_s, last = self.first_drop_s + _INTO_FLOW_S, len(self.images) - 1
        # Where nothing came out, the middle.
        during = min(int(flows_s / self.every_s) + 1, last) if np.isfinite(flows_s) else last // 2
        return [self.images[0], self.images[during], self.images[-1]]


def pictures(films: list[Film]) -> "Figure":
    """Return the page of pictures: a row a pair, the demonstrated one first."""
    import matplotlib.pyplot as plt

    with plt.rc_context(RC):
        figure, axes = plt.subplots(
            len(films), 3, figsize=(7.2, 0.25 + 1.95 * len(films)), squeeze=False, layout="constrained"
        )
        for row, film in zip(axes, films, strict=True):
            for axis, picture, moment in zip(row, film.moments(), MOMENTS, strict=True):
                axis.imshow(picture, interpolation="none")
                axis.set(xticks=[], yticks=[])
                axis.spines[:].set_visible(False)
                if row is axes[0]:
                    axis.set_title(moment)
            row[0].set_ylabel(film.title)
            row[1].set_xlabel(film.caption)
    return figure


def rates(executions: "pd.DataFrame", safety: "pd.DataFrame") -> "Figure":
    """Return the page of numbers: successes a pair and feature set, balls beside the target, and tilts outside the opening."""
    import matplotlib.pyplot as plt

    table = by_pair(executions).merge(safety, how="left", on=[*PAIR, "features"])
    # In the configuration's order.
    pairs = list(dict.fromkeys(zip(safety["held_object"], safety["target_object"], strict=True)))
    with plt.rc_context(RC):
        figure, axes = plt.subplots(
            1, 3, figsize=(7.2, 1.2 + 0.42 * len(pairs)), sharey=True, layout="constrained"
        )
        for number, (features, marker) in enumerate(_MARKERS.items()):
            rows = table[table["features"] == features]
            if rows.empty:
                continue
            at = [
                pairs.index(pair) + 0.2 * (number - 1.5)
                for pair in zip(*(rows[name] for name in PAIR), strict=True)
            ]
            style = {"color": COLOURS[features], "marker": marker, "ms": 3.5, "ls": "none"}
            _successes(axes[0], rows, at, style, WORDS[features])
            axes[1].plot(100.0 * rows["spilled_share"], at, **style)
            axes[2].plot(100.0 * rows["way_in"], at, **style)
            axes[2].plot(100.0 * rows["ever"], at, **style, mfc="none")
        axes[0].set_yticks(
            range(len(pairs)), [f"{held} into {target}".replace("_", " ") for held, target in pairs]
        )
        axes[0].invert_yaxis()
        axes[0].set_xlabel("executions that succeeded, %\n(bars: 95 %; open: refused\nsamples are failures)")
        axes[1].set_xlabel("balls beside the target,\n% of those in the cup")
        axes[2].set_xlabel("tilted above the reference,\nlip outside, % of executions\n(open: way back, too)")
        for axis in axes:
            axis.set_xlim(-4, 104)
            axis.grid(axis="y", lw=0.3, color="0.85")
        figure.legend(loc="outside upper center", ncols=4, frameon=False)
    return figure


def safety_table(safety: "pd.DataFrame") -> "Figure":
    """Return the page with P(tilt > 1 while the lip is outside the opening) a pair: of drawn trajectories, and of executions."""
    import matplotlib.pyplot as plt

    sets = [name for name in _MARKERS if name in set(safety["features"])]
    pairs = list(dict.fromkeys(zip(safety["held_object"], safety["target_object"], strict=True)))
    rows = safety.set_index([*PAIR, "features"])
    with plt.rc_context(RC):
        figure, axes = plt.subplots(2, 1, figsize=(7.2, 1.5 + 0.36 * len(pairs)), layout="constrained")
    titles = ("until the lip has come above the opening", "at any time, the way back with an empty cup too")
    figure.suptitle(
        "Tilted above the reference with the lip outside the opening, % of drawn / executed pours", fontsize=8
    )
    for axis, name, title in zip(axes, ("way_in", "ever"), titles, strict=True):
        cells = [[_cell(rows.loc[(*pair, features)], name) for features in sets] for pair in pairs]
        axis.axis("off")
        axis.set_title(title, fontsize=8, loc="left")
        table = axis.table(
            cells,
            rowLabels=[" into ".join(pair).replace("_", " ") for pair in pairs],
            colLabels=[WORDS[features] for features in sets],
            **{"loc": "center", "cellLoc": "center", "edges": "horizontal"},
        )
        table.auto_set_font_size(False)
        table.set_fontsize(7)
    return figure


def _cell(row: "pd.Series", name: str) -> str:
    executed = f"{100.0 * row[name]:.0f}" if row[name] == row[name] else "–"
    return f"{100.0 * row['drawn_' + name]:.1f} / {executed}"


def _successes(axis: "Axes", rows: "pd.DataFrame", at: list[float], style: dict, word: str) -> None:
    rate = 100.0 * (rows["successes"] / rows["n"]).to_numpy()
    low, high = 100.0 * np.array([wilson(row.successes, row.n) for row in rows.itertuples()]).T
    axis.hlines(at, low, high, color=style["color"], lw=0.8)
    axis.plot(100.0 * rows["first_successes"] / rows["n"], at, **style, mfc="none")
    axis.plot(rate, at, **style, label=word)
