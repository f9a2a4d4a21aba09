"""Draw what changes when one key of the configuration does: areas with intervals, and differences to the default, paired."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipeline import command
from pipeline.artefacts import read_table, write_json

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MEASURES = ("auc", "tpr_at_fpr_01", "brier")
# What is drawn of each variant: feature set, split, and how far off the row's middle.
DRAWN = (("label_mapping", "same", -0.2), ("label_mapping", "novel", 0.0), ("standard", "novel", 0.2))
NEW_TRIALS = "simulate."
Tables = dict[tuple[str, str], "pd.DataFrame"]
Keys = dict[str, str]


def main() -> None:
    """Read the resampled scores of all variants; write the page and the numbers."""
    parser = command.parser(__doc__)
    parser.add_argument(
        "--replicates", type=Path, nargs="+", required=True, help="<variant>/<experiment>/<file>"
    )
    parser.add_argument("--scores", type=Path, nargs="+", required=True, help="<variant>/<experiment>/<file>")
    parser.add_argument("--variants", nargs="+", required=True, help="NAME=KEY:VALUE, the default first")
    parser.add_argument("--trials", type=int, required=True, help="trials an object where the key moves them")
    parser.add_argument("--draws", type=int, required=True, help="training sets an object")
    parser.add_argument("--page", type=Path, required=True)
    parser.add_argument("--numbers", type=Path, required=True)
    options = parser.parse_args()

    from pipeline.report.style import save

    keys = dict(text.split("=", 1) for text in options.variants)
    tables = {path.parts[-3:-1]: read_table(path, "replicates") for path in options.replicates}
    numbers = ablation_numbers(tables)
    for path in options.scores:
        numbers |= fits(read_table(path, "scores"), *path.parts[-3:-1])
    save(draw(numbers, keys, list(tables), options.trials, options.draws), options.page)
    write_json(options.numbers, numbers)


def ablation_numbers(tables: Tables) -> dict[str, float]:
    """Return `ablations.<variant>.<experiment>.<features>.<split>.<measure>` with intervals, and `.minus_default` of each.

    Replicates draw the same objects in all tables, so that differences are paired.
    """
    from pipeline.report.evaluation_numbers import by_name, with_interval
    from pipeline.statistics.resampling import two_sided_p

    numbers: dict[str, float] = {}
    values = {key: by_name(table) for key, table in tables.items()}
    for (variant, experiment), of_variant in values.items():
        for name, found in of_variant.items():
            if name.rsplit(".", 1)[1] not in MEASURES:
                continue
            head = name.replace("classify.", f"ablations.{variant}.")
            numbers |= with_interval(head, found)
            default = values["default", experiment].get(name)
            if variant != "default" and default is not None:
                difference = found - default
                numbers |= with_interval(f"{head}.minus_default", difference)
                if f"{head}.minus_default" in numbers:
                    numbers[f"{head}.minus_default.p"] = two_sided_p(difference)
    return numbers


def fits(scores: "pd.DataFrame", variant: str, experiment: str) -> dict[str, float]:
    """Return the share of separable training sets and of converged fits, and how many one-class sets were redrawn."""
    trained = scores[scores["features"] != "hydrostatic"].drop_duplicates(
        ["features", "training_object", "draw"]
    )
    head = f"ablations.{variant}.{experiment}"
    return {
        f"{head}.separable_share": float(trained["separable"].mean()),
        f"{head}.converged_share": float(trained["converged"].mean()),
        f"{head}.redrawn": int(trained.drop_duplicates(["training_object", "draw"])["n_redrawn"].sum()),
    }


def draw(
    numbers: dict[str, float], keys: Keys, present: list[tuple[str, str]], trials: int, draws: int
) -> "Figure":
    """Return the page: a panel an experiment, a row a variant; `keys` tells variant → KEY:VALUE."""
    import matplotlib.pyplot as plt

    from pipeline.report.evaluation_pages import A4, SMALL, legend

    experiments = list(dict.fromkeys(experiment for _, experiment in present))
    with plt.rc_context(SMALL):
        figure, axes = plt.subplots(1, len(experiments), figsize=A4, squeeze=False)
        figure.subplots_adjust(left=0.26, right=0.86, top=0.91, bottom=0.12, wspace=0.62)
        for column, (axis, experiment) in enumerate(zip(axes[0], experiments, strict=True)):
            _panel(axis, numbers, keys, experiment, labelled=column == 0)
        legend(figure, ("label_mapping", "standard"))
        figure.suptitle("One key changed at a time", y=0.975, fontsize=10)
        figure.text(0.06, 0.02, _note(trials, draws), fontsize=6.5, va="bottom")
    return figure


def _panel(axis: "Axes", numbers: dict[str, float], keys: Keys, experiment: str, *, labelled: bool) -> None:
    from pipeline.report.evaluation_pages import MARKERS, bar
    from pipeline.report.style import COLOURS

    default = f"ablations.default.{experiment}.label_mapping.novel.auc"
    axis.axvline(numbers.get(default, np.nan), color=COLOURS["label_mapping"], lw=0.6, ls=":")
    for row, variant in enumerate(keys):
        for features, split, offset in DRAWN:
            name = f"ablations.{variant}.{experiment}.{features}.{split}.auc"
            if name in numbers:
                style = (COLOURS[features], MARKERS[features])
                bar(axis, numbers, name, row + offset, *style, filled=split == "novel")
        name = f"ablations.{variant}.{experiment}.label_mapping.novel.auc"
        axis.text(
            1.03, row, _told(numbers, name), transform=axis.get_yaxis_transform(), fontsize=5.5, va="center"
        )
        axis.axhline(row + 0.5, lw=0.3, color="#DDDDDD")
    axis.set(ylim=(len(keys) - 0.5, -0.5), xlabel="area under the curve", title=experiment.capitalize())
    words = [text.replace(":", " = ") if text != ":None" else "default" for text in keys.values()]
    axis.set_yticks(range(len(keys)), words if labelled else [])


def _told(numbers: dict[str, float], name: str) -> str:
    if name not in numbers:
        return "does not apply"
    head = f"{name}.minus_default"
    if f"{head}.low" not in numbers:
        return f"{numbers[name]:.4f}"
    low, high, p = (numbers[f"{head}.{end}"] for end in ("low", "high", "p"))
    return f"{numbers[head]:+.4f}\n[{low:+.4f}, {high:+.4f}]\np = {p:.3f}".replace("-", "−")


def _note(trials: int, draws: int) -> str:
    return (
        "Filled: novel objects; open: other trials of the training object. Bars: 95 % intervals of a bootstrap over objects, "
        "jointly as trainers and as tests.\nRight: area of label mapping on novel objects less the default's (dotted), on the same "
        f"replicates, its interval and p value. {draws} training sets an object.\nTrials are the default's own, except for keys of "
        f"simulate: {trials} new ones an object.\nOther sources than the annotated object take the labels that "
        "were mapped onto them from it."
    )


if __name__ == "__main__":
    command.run(main)
