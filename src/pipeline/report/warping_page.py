"""The pages of the comparison of warping methods: every measure at a glance, then every target by itself."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Scores by method, target and measure.
Scores = Mapping[str, Mapping[str, Mapping[str, float]]]

GOOD, BAD, GREY = "#0072B2", "#D55E00", "0.55"


@dataclass(frozen=True)
class Measure:
    """How a measure is shown: words, factor to the unit shown, where the axis ends, decimals.

    What is asked of it: a bar in the unit shown, for the `mean` or the `worst` of the targets; the higher the better or not.
    """

    words: str
    factor: float
    end: float
    decimals: int
    bar: float | None = None
    of: str = "worst"
    higher: bool = False

    def met(self, summary: Mapping[str, float]) -> bool:
        """Return whether the bar is reached; nothing asked is, no parameter on some target is not."""
        if self.bar is None:
            return True
        value = summary[self.of] * self.factor
        return bool(value >= self.bar if self.higher else value <= self.bar)


MEASURES = {
    "residual_mm": Measure("distance of pairs, mm", 1.0, 6.0, 1, bar=2.0, of="mean"),
    "share_without_candidate": Measure("points without a candidate, %", 100.0, 5.0, 1, bar=1.0),
    "wall_side_flips": Measure("walls crossed, %", 100.0, 60.0, 0, bar=0.0),
    "wall_side_flips_without_check": Measure("… if normals were not checked, %", 100.0, 60.0, 0),
    "fit_s": Measure("processor time of a fit, s", 1.0, 6.0, 1),
    "rim_iou": Measure("rim: IoU", 1.0, 1.0, 2, bar=0.75, of="mean", higher=True),
    "handle_iou": Measure("handle: IoU", 1.0, 1.0, 2, bar=0.8, of="mean", higher=True),
    "balanced_accuracy": Measure("balanced accuracy", 1.0, 1.0, 2, bar=0.97, of="mean", higher=True),
    "radius": Measure("radius: error, %", 100.0, 4.0, 1, bar=1.0),
    "opening_mm": Measure("opening's centre: error, mm", 1.0, 6.0, 1, bar=1.0),
    "height": Measure("height: error, %", 100.0, 2.0, 1, bar=1.0),
    "hull_volume": Measure("hull volume: error, %", 100.0, 6.0, 1, bar=2.0),
    "capacity": Measure("capacity: error, %", 100.0, 4.0, 1, bar=2.0),
    "tilt_reference_deg": Measure("tilt reference: error, °", 1.0, 3.0, 1, bar=1.5),
}
COLUMNS = 5


def over_targets(by_target: Mapping[str, Mapping[str, float]], key: str) -> dict[str, float]:
    """Return mean and worst of a measure over the targets that have it; both nan, where one of them lacks a parameter."""
    values = np.array([own[key] for own in by_target.values()])
    if key == "handle_iou":  # most targets have no handle
        values = values[np.isfinite(values)]
    if not len(values):
        return {"mean": float("nan"), "worst": float("nan")}
    return {
        "mean": float(values.mean()),
        "worst": float(values.min() if MEASURES[key].higher else values.max()),
    }


def bars_met(by_target: Mapping[str, Mapping[str, float]]) -> int:
    """Return how many of the measures with a bar reach it."""
    return sum(
        measure.met(over_targets(by_target, key))
        for key, measure in MEASURES.items()
        if measure.bar is not None
    )


def overview(found: Scores, source: str) -> "Figure":
    """Return the page with a panel a measure: a row a method, a dot a target, a mark for what the bar is asked of."""
    import matplotlib.pyplot as plt

    from pipeline.report.style import RC

    asked = sum(measure.bar is not None for measure in MEASURES.values())
    names = [
        f"{method.replace('_', ' ')} ({bars_met(by_target)} of {asked})"
        for method, by_target in found.items()
    ]
    rows = -(-len(MEASURES) // COLUMNS)
    with plt.rc_context(RC):
        figure, axes = plt.subplots(
            rows, COLUMNS, figsize=(2.3 * COLUMNS + 1.4, 1.9 * rows + 0.8), sharey=True, layout="constrained"
        )
        for axis, key in zip(axes.flat, MEASURES, strict=False):
            _panel(axis, found, key)
        axes[0, 0].set_yticks(range(len(names)), names)
        axes[0, 0].invert_yaxis()
        for axis in axes.flat[len(MEASURES) :]:
            axis.set_axis_off()
        _legend(axes.flat[len(MEASURES)])
        figure.suptitle(
            f"Methods of warping the {source.replace('_', ' ')} onto {len(next(iter(found.values())))} targets, label mapping; "
            "in brackets how many bars a method reaches. Beyond an axis' end: at the edge.",
            fontsize=9,
        )
    return figure


def _panel(axis: "Axes", found: Scores, key: str) -> None:
    measure = MEASURES[key]
    beyond = measure.end * 1.06
    for row, by_target in enumerate(found.values()):
        values = measure.factor * np.array([own[key] for own in by_target.values()])
        values = values[np.isfinite(values)]
        spread = row + np.linspace(-0.22, 0.22, len(values))
        axis.plot(np.minimum(values, beyond), spread, "o", ms=2.5, color=GREY, alpha=0.7, mew=0)
        summary = over_targets(by_target, key)
        marked = measure.factor * summary[measure.of]
        colour = "black" if measure.bar is None else GOOD if measure.met(summary) else BAD
        if np.isfinite(marked):
            axis.plot(min(marked, beyond), row, "D" if colour == BAD else "s", ms=5, color=colour, mew=0)
        else:
            axis.text(beyond, row - 0.3, "none on some", ha="right", va="bottom", fontsize=6, color=BAD)
    if measure.bar is not None:
        axis.axvline(measure.bar, color="black", ls="--", lw=0.8)
    axis.set_xlim(0.0 if not measure.higher else min(0.4, axis.get_xlim()[0]), 1.12 * measure.end)
    axis.set_title(f"{measure.words} ({measure.of})", fontsize=8)


def _legend(axis: "Axes") -> None:
    import matplotlib.pyplot as plt

    looks: dict[str, dict[str, Any]] = {
        "a target": {"marker": "o", "color": GREY, "ms": 2.5},
        "mean or worst (as the title says), bar reached": {"marker": "s", "color": GOOD, "ms": 5},
        "… not reached": {"marker": "D", "color": BAD, "ms": 5},
        "… nothing asked": {"marker": "s", "color": "black", "ms": 5},
        "the bar": {"ls": "--", "color": "black", "lw": 0.8},
    }
    marks = [plt.Line2D([], [], **{"ls": "", "mew": 0, **look}, label=word) for word, look in looks.items()]
    axis.legend(handles=marks, loc="center", frameon=False, fontsize=6.5)


def matrices(found: Scores) -> "Figure":
    """Return the page with a matrix a measure: a row a method, a column a target."""
    import matplotlib.pyplot as plt

    from pipeline.report.matrices import draw_matrix
    from pipeline.report.style import RC

    methods, targets = list(found), list(next(iter(found.values())))
    rows = -(-len(MEASURES) // COLUMNS)
    with plt.rc_context(RC):
        figure, axes = plt.subplots(
            rows,
            COLUMNS,
            figsize=(2.5 * COLUMNS + 1.0, 1.8 * rows + 0.9),
            sharex=True,
            sharey=True,
            layout="constrained",
        )
        for axis, (key, measure) in zip(axes.flat, MEASURES.items(), strict=False):
            shown = measure.factor * np.array([[found[m][t][key] for t in targets] for m in methods])
            look: Any = {"end": measure.end, "decimals": measure.decimals, "higher_is_better": measure.higher}
            draw_matrix(axis, shown, methods, targets, **look)
            axis.set_title(measure.words, fontsize=8)
        for axis in axes.flat[len(MEASURES) :]:
            axis.set_axis_off()
        for axis in axes.flat[len(MEASURES) - COLUMNS : len(MEASURES)]:
            axis.tick_params(labelbottom=True)
            # Above an empty panel names hang into it: no gap between the rows.
            of_last_row = axis in axes[-1]
            for label in axis.get_xticklabels():
                label.set_in_layout(of_last_row)
        figure.suptitle(
            "Every target by itself; the darker, the worse; –: there is no such number", fontsize=9
        )
    return figure
