"""Draw the ROC curves of pouring and filling, as the paper's Fig. 3: dashed on the training object, solid on novel ones."""

from pathlib import Path
from typing import TYPE_CHECKING

from pipeline import command
from pipeline.artefacts import read_table

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STYLES = {"same": "--", "novel": "-"}
# Wide lines first: where two curves coincide, both are seen.
WIDTHS = {"label_mapping": 2.4, "standard": 1.2, "point_mapping": 0.9, "hydrostatic": 1.0}


def main() -> None:
    """Read the curves and scores of all experiments; write the figure."""
    parser = command.parser(__doc__)
    parser.add_argument("--curves", type=Path, nargs="+", required=True, help="one table an experiment")
    parser.add_argument("--scores", type=Path, nargs="+", required=True, help="one table an experiment")
    parser.add_argument("--output", type=Path, required=True)
    options = parser.parse_args()

    import pandas as pd

    from pipeline.report.style import save

    curves = pd.concat([read_table(path, "curves") for path in options.curves])
    scores = pd.concat([read_table(path, "scores") for path in options.scores])
    save(draw(curves, scores), options.output)


def mean_curves(curves: "pd.DataFrame") -> "pd.DataFrame":
    """Return the mean of the TPR, and its lower and upper quartile over draws and training objects, at each fixed FPR.

    The mean is over an object's draws first. Scores of different classifiers are never pooled.
    """
    keys = ["experiment", "features", "split", "fpr"]
    by_object = curves.groupby([*keys, "training_object"], observed=True)["tpr"].mean()
    of_all = curves.groupby(keys, observed=True)["tpr"]
    means = by_object.groupby(keys, observed=True).mean().to_frame("mean")
    return means.assign(low=of_all.quantile(0.25), high=of_all.quantile(0.75)).reset_index()


def draw(curves: "pd.DataFrame", scores: "pd.DataFrame") -> "Figure":
    """Return the figure: a panel an experiment, bands from quartile to quartile over draws and training objects."""
    import matplotlib.pyplot as plt

    from pipeline.report.style import RC

    means = mean_curves(curves)
    experiments = list(dict.fromkeys(curves["experiment"]))
    with plt.rc_context(RC):
        figure, axes = plt.subplots(1, len(experiments), figsize=(3.5 * len(experiments), 3.5), squeeze=False)
        for axis, experiment in zip(axes[0], experiments, strict=True):
            _panel(axis, means[means["experiment"] == experiment], scores[scores["experiment"] == experiment])
            axis.set_title(experiment.capitalize())
        figure.tight_layout()
    return figure


def _panel(axis: "Axes", means: "pd.DataFrame", scores: "pd.DataFrame") -> None:
    from pipeline.report.style import COLOURS, WORDS

    for features, width in WIDTHS.items():
        for split, line in STYLES.items():
            curve = means[(means["features"] == features) & (means["split"] == split)].sort_values("fpr")
            # The ceiling learns nothing: its curves on one object and on the others are the same trials, once over.
            if curve.empty or (features == "hydrostatic" and split == "same"):
                continue
            auc = scores.loc[(scores["features"] == features) & (scores["split"] == split), "auc"].mean()
            label = (
                f"{WORDS[features]}, {split} ({auc:.3f})"
                if features != "hydrostatic"
                else f"{WORDS[features]} ({auc:.3f})"
            )
            style = ":" if features == "hydrostatic" else line
            axis.step(
                curve["fpr"],
                curve["mean"],
                style,
                where="post",
                color=COLOURS[features],
                lw=width,
                label=label,
            )
            if split == "novel" and features != "hydrostatic":
                axis.fill_between(
                    curve["fpr"],
                    curve["low"],
                    curve["high"],
                    step="post",
                    color=COLOURS[features],
                    alpha=0.12,
                    lw=0,
                )
    axis.set(
        xlabel="false positive rate",
        ylabel="true positive rate",
        xlim=(-0.01, 1.01),
        ylim=(-0.01, 1.01),
        aspect="equal",
    )
    axis.legend(loc="lower right", frameon=False, title="(mean area under the curve)", title_fontsize=7)


if __name__ == "__main__":
    command.run(main)
