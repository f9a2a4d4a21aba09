"""Draw the evaluation of the classifiers: scores, matrices, learning curves, claims; and write every number as JSON."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline import command
from pipeline.artefacts import read_table, write_json

if TYPE_CHECKING:
    import pandas as pd


def main() -> None:
    """Read what `classify` made of both experiments and the trials; write the pages and the numbers."""
    options = _options()
    import pandas as pd

    from pipeline.report import evaluation_numbers as by
    from pipeline.report import evaluation_pages as pages
    from pipeline.report.claims_page import claims_page
    from pipeline.report.learning_page import learning_page
    from pipeline.report.metrics import score_metrics
    from pipeline.report.style import save

    replicates, pairs, learning = (
        pd.concat([read_table(path, table) for path in paths])
        for paths, table in (
            (options.replicates, "replicates"),
            (options.pairs, "pairs"),
            (options.learning, "learning"),
        )
    )
    values: dict[str, Any] = by.by_name(replicates)
    numbers = by.score_numbers(values)
    calibrations: dict[tuple, Any] = {}
    for path, scores_path in zip(options.predictions, options.scores, strict=True):
        scores = read_table(scores_path, "scores")
        experiment = str(scores["experiment"].iloc[0])
        found = _of_predictions(options, experiment, path, list(pd.unique(scores["training_object"])))
        numbers |= by.fit_numbers(experiment, scores) | found["numbers"]
        calibrations |= found["calibrations"]
        values |= found["values"]
        same = f"classify.{experiment}.same_auc_difference_max"
        values[same] = score_metrics(experiment, scores)[same]
    numbers |= learning_numbers(learning)
    claims = by.claim_rows(values)
    numbers |= by.object_numbers(pairs, _weights(options, pairs["training_object"].nunique()))
    experiments = list(dict.fromkeys(replicates["experiment"]))
    figures = [
        pages.scores_page(numbers, experiments, calibrations),
        pages.matrices_page(pairs, experiments, numbers),
        learning_page(learning, experiments, numbers),
        claims_page(claims),
    ]
    save(figures, options.page)
    write_json(options.numbers, numbers | {"claims": claims.to_dict("records")})


def _options() -> argparse.Namespace:
    parser = command.parser(__doc__)
    for option in ("--replicates", "--pairs", "--learning", "--scores", "--predictions"):
        parser.add_argument(option, type=Path, nargs="+", required=True, help="one table an experiment")
    parser.add_argument("--fillings", type=Path, nargs="+", required=True, help="trials, one table an object")
    parser.add_argument("--resamples", type=int, default=500, help="bootstrap replicates, as in classify")
    parser.add_argument("--seed", type=int, default=0, help="of the classifiers, as in classify")
    parser.add_argument("--page", type=Path, required=True)
    parser.add_argument("--numbers", type=Path, required=True)
    return parser.parse_args()


def _of_predictions(
    options: argparse.Namespace, experiment: str, path: Path, names: list[str]
) -> dict[str, Any]:
    """Return what needs each novel prediction of an experiment: numbers, reliability curves and areas of the halves."""
    import pandas as pd

    from pipeline.report import evaluation_numbers as by

    weights = _weights(options, len(names))
    predictions = read_table(path, "predictions")
    novel = predictions[predictions["split"] == "novel"]
    found: dict[str, Any] = {
        "numbers": by.delong_numbers(experiment, novel, names, weights),
        "calibrations": {},
        "values": {},
    }
    sets = list(novel.groupby("features", observed=True))
    for features, rows in command.progress(sets, len(sets), f"calibration, {experiment}: feature sets"):
        curve = found["calibrations"][experiment, features] = by.calibration(rows, names, weights)
        name = f"evaluation.{experiment}.{features}.novel.calibration_error"
        found["numbers"] |= by.with_interval(name, curve["error"])
    if experiment == "filling":
        trials = pd.concat(
            [read_table(trials, "trials", ["object", "trial", "half"]) for trials in options.fillings]
        )
        half_of = trials.set_index(["object", "trial"])["half"]
        of_mapping = novel[novel["features"] == "label_mapping"]
        found["values"] = by.halves(of_mapping, half_of, names, weights)
        for name, values in found["values"].items():
            found["numbers"] |= by.with_interval(name.replace("classify.", "evaluation."), values)
    return found


def _weights(options: argparse.Namespace, n_objects: int) -> np.ndarray:
    """Return the replicates that `classify` drew."""
    from pipeline.statistics.resampling import object_weights

    return object_weights(n_objects, options.resamples, options.seed)


def learning_numbers(learning: "pd.DataFrame") -> dict[str, float]:
    """Return area and true positive rate at 1 % by number of samples, with intervals, and the share of separable sets."""
    from pipeline.report.evaluation_numbers import with_interval

    numbers: dict[str, float] = {}
    for key, rows in learning.groupby(["experiment", "features", "split", "samples"], observed=True):
        experiment, features, split, samples = key
        head = f"evaluation.{experiment}.{features}.{split}.samples_{samples}"
        ordered = rows.sort_values("replicate")
        for measure in ("auc", "tpr_at_fpr_01"):
            values = ordered[measure].to_numpy()
            numbers |= with_interval(f"{head}.{measure}", values)
        if split == "same":
            numbers[f"{head}.separable_share"] = float(rows["separable_share"].iloc[0])
            numbers[f"{head}.redrawn"] = int(rows["n_redrawn"].iloc[0])
    return numbers


if __name__ == "__main__":
    command.run(main)
