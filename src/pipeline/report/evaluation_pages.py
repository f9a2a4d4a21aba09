"""The first pages of the evaluation: scores with intervals, reliability, and who trains for whom."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.report.style import COLOURS, RC, WORDS

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

A4 = (8.27, 11.69)
LEGIBLE = 12  # objects of which a matrix' cells hold their numbers on A4
SMALL: Any = {
    **RC,
    "font.size": 7,
    "axes.labelsize": 7,
    "axes.titlesize": 8,
    "legend.fontsize": 6.5,
}
MEASURES = {
    "auc": "area under the curve",
    "partial_auc": "mean TPR up to 10 % FPR",
    "tpr_at_fpr_00": "TPR at 0 % FPR",
    "tpr_at_fpr_01": "TPR at 1 % FPR",
    "tpr_at_fpr_05": "TPR at 5 % FPR",
    "brier": "Brier score (less is better)",
}
SETS = ("label_mapping", "point_mapping", "standard", "hydrostatic")
MARKERS = dict(zip(SETS, "os^D", strict=True))
# Label mapping wide and first, so that it is seen below point mapping.
LINES: Any = {
    name: {"lw": lw, "ms": ms}
    for name, lw, ms in zip(SETS, (2.4, 0.9, 1.0, 1.0), (4, 2.5, 3, 3), strict=True)
}
NOTE = (
    "Bars: 95 % percentile intervals of a bootstrap over objects, jointly as trainers and as tests. Filled: novel objects; "
    "open: other trials of the training object.\nΔ, in the colour of its set: a warped one − standard features on novel objects, "
    "paired replicate by replicate. Hydrostatics: the ceiling, nothing is learnt."
)
MATRIX_NOTE = (
    "Means over training sets. Diagonal: other trials of the training object. Last row: hydrostatics. Each object is tested alone, "
    "without a threshold\nin common with other objects, so these areas exceed those of all novel objects' trials together.\n"
    "Right of a row: the mean over the other objects as tests; below a column: over the others as trainers; with its 95 % "
    "interval by the bootstrap over those."
)


def scores_page(
    numbers: Mapping[str, float], experiments: list[str], calibrations: Mapping[tuple, Any]
) -> "Figure":
    """Return the page of all scores and reliability curves; `calibrations` by (experiment, features)."""
    import matplotlib.pyplot as plt

    with plt.rc_context(SMALL):
        figure = plt.figure(figsize=A4)
        grid = figure.add_gridspec(
            5, len(experiments), left=0.25, right=0.89, top=0.93, bottom=0.09, hspace=0.35, wspace=0.42
        )
        for column, experiment in enumerate(experiments):
            _forest(figure.add_subplot(grid[:3, column]), numbers, experiment, labelled=column == 0)
            _reliability(figure.add_subplot(grid[3:, column]), calibrations, numbers, experiment)
        legend(figure)
        figure.suptitle(
            "How well pouring and filling are predicted, and how surely", x=0.5, y=0.975, fontsize=10
        )
        figure.text(0.06, 0.015, NOTE + _delong_note(numbers, experiments), fontsize=6.5, va="bottom")
    return figure


def _delong_note(numbers: Mapping[str, float], experiments: list[str]) -> str:
    """Return how much narrower DeLong's interval of one classifier's area is than that over tested objects."""
    ratios = []
    for experiment in experiments:
        head = f"evaluation.{experiment}.label_mapping.novel.auc_half_width"
        if f"{head}.ratio" in numbers:
            delong, objects = (numbers[f"{head}.{by}"] for by in ("delong", "over_objects"))
            ratios.append(f"{experiment} ±{delong:.4f} instead of ±{objects:.4f}")
    if not ratios:
        return ""
    return (
        "\nDeLong's interval of a classifier's area on novel objects (label mapping), trials taken as independent, is too narrow:\n"
        f"{', '.join(ratios)}."
    )


def legend(figure: "Figure", sets: tuple[str, ...] = SETS, dotted: tuple[str, ...] = ()) -> None:
    """Write one row below the title that tells colours and markers of feature sets; `dotted` ones are lines."""
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], marker=MARKERS[name], color=COLOURS[name], ms=4, lw=1, label=WORDS[name])
        for name in sets
    ] + [Line2D([], [], color=COLOURS[name], lw=1, ls=":", label=WORDS[name]) for name in dotted]
    figure.legend(
        handles=handles, frameon=False, loc="upper center", ncol=len(handles), bbox_to_anchor=(0.5, 0.967)
    )


def _forest(axis: "Axes", numbers: Mapping[str, float], experiment: str, *, labelled: bool) -> None:
    for row, measure in enumerate(MEASURES):
        for place, features in enumerate(SETS):
            for split in ("same", "novel"):
                name = f"evaluation.{experiment}.{features}.{split}.{measure}"
                if name in numbers:
                    y = row + 0.18 * (place - 1.5) + (0.0 if split == "novel" else -0.07)
                    bar(axis, numbers, name, y, COLOURS[features], MARKERS[features], filled=split == "novel")
        for features, va in (("label_mapping", "bottom"), ("point_mapping", "top")):
            text = _difference(numbers, experiment, features, measure)
            axis.text(1.04, row, text, fontsize=5.5, va=va, color=COLOURS[features])
    axis.set(xlim=(-0.02, 1.02), ylim=(len(MEASURES) - 0.5, -0.5), title=experiment.capitalize())
    axis.set_yticks(range(len(MEASURES)), list(MEASURES.values()) if labelled else [])
    axis.grid(axis="x", lw=0.3, color="#DDDDDD")
    for row in range(1, len(MEASURES)):
        axis.axhline(row - 0.5, lw=0.3, color="#BBBBBB")


def bar(
    axis: "Axes", numbers: Mapping[str, float], name: str, y: float, colour: str, marker: str, *, filled: bool
) -> None:
    """Draw the number `name` at height `y` with its interval; open markers are paler."""
    ends = [numbers.get(f"{name}.{end}", numbers[name]) for end in ("low", "high")]
    axis.plot(ends, [y, y], lw=0.9, color=colour, alpha=1.0 if filled else 0.55)
    axis.plot(numbers[name], y, marker, ms=3.2, mew=0.7, color=colour, mfc=colour if filled else "white")


def _difference(numbers: Mapping[str, float], experiment: str, features: str, measure: str) -> str:
    head = f"evaluation.{experiment}.{features}_minus_standard.novel.{measure}"
    if f"{head}.low" not in numbers:
        return ""
    low, high, p = (numbers[f"{head}.{end}"] for end in ("low", "high", "p"))
    return f"Δ {numbers[head]:+.3f}\n[{low:+.3f}, {high:+.3f}]\np = {p:.3f}\n".replace("-", "−")


def _reliability(
    axis: "Axes", calibrations: Mapping[tuple, Any], numbers: Mapping[str, float], experiment: str
) -> None:
    from pipeline.statistics.resampling import interval

    axis.plot([0, 1], [0, 1], lw=0.7, color="#7F7F7F", ls=":")
    for features in SETS[:3]:
        if (experiment, features) not in calibrations:
            continue
        curve = calibrations[experiment, features]
        low, high = np.array([interval(values)[1:] for values in curve["observed"].T]).T
        error = numbers[f"evaluation.{experiment}.{features}.novel.calibration_error"]
        x, y, colour = curve["predicted"][0], curve["observed"][0], COLOURS[features]
        axis.fill_between(x, low, high, color=colour, alpha=0.12, lw=0)
        label, style = f"{WORDS[features]} (mean gap {error:.3f})", MARKERS[features] + "-"
        axis.plot(x, y, style, **LINES[features], color=colour, label=label)
    axis.set(
        xlim=(0, 1),
        ylim=(0, 1),
        aspect="equal",
        title=f"{experiment.capitalize()}: reliability, novel objects",
    )
    axis.set(xlabel="predicted probability", ylabel="share of trials with that outcome")
    if axis.get_legend_handles_labels()[0]:
        axis.legend(frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.17))


def matrices_page(pairs: "pd.DataFrame", experiments: list[str], numbers: Mapping[str, float]) -> "Figure":
    """Return the page of areas, training object by test object, of each feature set; hydrostatics as a last row.

    `numbers` has each object's mean over the others, as trainer and as test (`evaluation_numbers.object_numbers`).
    """
    import matplotlib.pyplot as plt

    names = list(dict.fromkeys(pairs["training_object"]))
    with plt.rc_context(SMALL):
        # Cells and letters keep their size: with many objects it is the paper that grows.
        grown = max(1.0, len(names) / LEGIBLE)
        size = A4[0] * grown, A4[1] * grown
        figure, axes = plt.subplots(3, len(experiments), figsize=size, squeeze=False)
        left, right, top, bottom = (edge / grown for edge in (0.12, 0.09, 0.07, 0.13))
        figure.subplots_adjust(left=left, right=1 - right, top=1 - top, bottom=bottom)
        figure.subplots_adjust(hspace=0.58 / grown, wspace=0.6 / grown)
        for column, experiment in enumerate(experiments):
            of_experiment = pairs[pairs["experiment"] == experiment]
            for row, features in enumerate(SETS[:3]):
                axis = axes[row, column]
                _matrix(axis, of_experiment, features, names)
                _means(axis, f"evaluation.{experiment}.{features}", names, numbers)
                axis.set_title(f"{experiment.capitalize()}, {WORDS[features]}")
        title = "Area under the curve, training object by test object"
        figure.suptitle(title, y=1 - 0.025 / grown, fontsize=10)
        figure.text(0.06 / grown, 0.012 / grown, MATRIX_NOTE, fontsize=6.5)
    return figure


def _matrix(axis: "Axes", pairs: "pd.DataFrame", features: str, names: list[str]) -> None:
    learnt, ceiling = (
        pairs[pairs["features"] == which].pivot_table(
            index="training_object", columns="test_object", values="auc", aggfunc="mean", dropna=False
        )
        for which in (features, "hydrostatic")
    )
    values = np.vstack([learnt.reindex(index=names, columns=names), ceiling.mean().reindex(names)])
    axis.imshow(values, vmin=0.7, vmax=1.0, cmap="cividis", aspect="auto")
    for (row, column), value in np.ndenumerate(values):
        if np.isfinite(value):
            text = f"{value:.2f}".lstrip("0")
            axis.text(
                column,
                row,
                text,
                ha="center",
                va="center",
                fontsize=5,
                color="white" if value < 0.88 else "black",
            )
    words = [name.replace("_", " ") for name in names]
    axis.set_yticks(range(len(names) + 1), [*words, "hydrostatics"], fontsize=5.5)
    axis.axhline(len(names) - 0.5, color="white", lw=1.5)
    axis.set(xlabel="tested on", ylabel="trained on")


def _means(axis: "Axes", head: str, names: list[str], numbers: Mapping[str, float]) -> None:
    """Write each object's mean over the others beside its row and below its column."""
    for place, name in enumerate(names):
        axis.text(
            len(names) - 0.35, place, _told(numbers, f"{head}.trained_on.{name}.auc"), fontsize=5, va="center"
        )
    told = [_told(numbers, f"{head}.tested_on.{name}.auc") for name in names]
    words = [name.replace("_", " ") for name in names]
    axis.set_xticks(
        range(len(names)),
        [f"{word}\n{text}" for word, text in zip(words, told, strict=True)],
        rotation=90,
        fontsize=5.5,
    )


def _told(numbers: Mapping[str, float], name: str) -> str:
    if f"{name}.low" not in numbers:
        return ""
    value, low, high = (
        f"{numbers[key]:.2f}".removeprefix("0") for key in (name, f"{name}.low", f"{name}.high")
    )
    return f"{value} [{low}, {high}]"
