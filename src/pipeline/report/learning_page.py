"""The page of learning curves: areas and true positive rates against the number of training trials."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from pipeline.report.evaluation_pages import A4, LINES, MARKERS, MEASURES, SETS, SMALL, legend
from pipeline.report.style import COLOURS

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def learning_page(learning: "pd.DataFrame", experiments: list[str], numbers: Mapping[str, float]) -> "Figure":
    """Return the page of learning curves on novel objects and on the training object, and how the fits went.

    `numbers` has the ceilings, which titles tell, and counts of fits (`evaluation_numbers.fit_numbers`).
    """
    import matplotlib.pyplot as plt

    panels = [(measure, split) for split in ("novel", "same") for measure in ("auc", "tpr_at_fpr_01")]
    with plt.rc_context(SMALL):
        figure, axes = plt.subplots(len(panels) + 1, len(experiments), figsize=A4, squeeze=False)
        figure.subplots_adjust(left=0.10, right=0.98, top=0.93, bottom=0.09, hspace=0.5, wspace=0.25)
        for column, experiment in enumerate(experiments):
            rows = learning[learning["experiment"] == experiment]
            for axis, (measure, split) in zip(axes[:, column], panels, strict=False):
                _learning(axis, rows[rows["split"] == split], measure)
                tested = "novel objects" if split == "novel" else "training object"
                ceiling = numbers.get(f"evaluation.{experiment}.hydrostatic.{split}.{measure}")
                known = "" if ceiling is None else f" (hydrostatics {ceiling:.3f})"
                axis.set_title(f"{experiment.capitalize()}, {tested}{known}")
                # Rates at 1 % are so far below their ceiling that its line would flatten the curves.
                if measure == "auc" and ceiling is not None:
                    axis.axhline(ceiling, color=COLOURS["hydrostatic"], lw=1, ls=":")
            _separable(axes[-1, column], rows)
        legend(figure, SETS[:3], dotted=SETS[3:])
        figure.text(0.06, 0.015, _note(numbers, experiments), fontsize=6.5, va="bottom")
        figure.suptitle("Learning curves", y=0.975, fontsize=10)
    return figure


def _note(numbers: Mapping[str, float], experiments: list[str]) -> str:
    """Return what bands are, and how the fits of the scores' own training sets went."""
    lines = ["Bands: 95 % intervals of the bootstrap over objects. Dotted: the area of hydrostatics."]
    for experiment in experiments:
        head = f"evaluation.{experiment}"
        if f"{head}.fits" in numbers:
            lines.append(
                f"{experiment.capitalize()}, the scores' own {numbers[f'{head}.fits']:.0f} fits: "
                f"{numbers[f'{head}.converged_share']:.1%} converged, after {numbers[f'{head}.iterations_max']:.0f} iterations of "
                f"IRLS at most; {numbers[f'{head}.redrawn']:.0f} training sets of one outcome were drawn again."
            )
    return "\n".join(lines)


def _learning(axis: "Axes", rows: "pd.DataFrame", measure: str) -> None:
    from pipeline.statistics.resampling import interval

    for features in SETS[:3]:
        points = [
            (samples, *interval(of_samples.sort_values("replicate")[measure].to_numpy()))
            for samples, of_samples in rows[rows["features"] == features].groupby("samples")
        ]
        if points:
            samples, value, low, high = np.array(points).T
            axis.fill_between(samples, low, high, color=COLOURS[features], alpha=0.12, lw=0)
            axis.plot(
                samples,
                value,
                MARKERS[features] + "-",
                **LINES[features],
                color=COLOURS[features],
            )
    axis.set(xscale="log", xlabel="training trials", ylabel=MEASURES[measure])
    _sample_ticks(axis, rows)


def _separable(axis: "Axes", rows: "pd.DataFrame") -> None:
    for features in SETS[:3]:
        share = rows[rows["features"] == features].groupby("samples")["separable_share"].first()
        axis.plot(share.index, share, MARKERS[features] + "-", **LINES[features], color=COLOURS[features])
    axis.set(xscale="log", xlabel="training trials", ylabel="share of sets", ylim=(-0.02, 1.02))
    axis.set_title("Training sets that a plane separates")
    _sample_ticks(axis, rows)


def _sample_ticks(axis: "Axes", rows: "pd.DataFrame") -> None:
    sizes = sorted(set(rows["samples"]))
    axis.set_xticks(sizes, [str(size) for size in sizes])
    axis.minorticks_off()
