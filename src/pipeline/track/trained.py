"""One run an (experiment × feature set × training object): scores, curves, the trials behind them, the fitted classifiers."""

from functools import cache
from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq

from pipeline.artefacts import read_table
from pipeline.track.facts import sha256
from pipeline.track.runs import Classifiers, Data, File, Run

SCORES = ("auc", "tpr_at_fpr_00", "tpr_at_fpr_01", "tpr_at_fpr_05", "brier")
TRAINING = ("n_iterations", "n_redrawn", "separable", "converged")
CEILING = "hydrostatic"


def trained_runs(processed: str | Path, experiment: str, config: dict) -> list[Run]:
    """Return the runs of `classify/<experiment>`; `config` is flat. Times are those of its files."""
    folder = Path(processed) / "classify" / experiment
    scores, curves = (
        read_table(folder / "scores.parquet", "scores"),
        read_table(folder / "curves.parquet", "curves"),
    )
    own = ("classify.", "warp.", f"simulate.{experiment}.")
    params = {key: value for key, value in config.items() if key.startswith(own)}
    models = folder / "models.json"
    file = File(str(models), sha256(models), "classifiers") if models.is_file() else None
    ended_s = (folder / "scores.parquet").stat().st_mtime
    content = sha256(folder / "scores.parquet") + (file.sha256 if file else "")
    runs = []
    for (features, name), rows in scores[scores["features"] != CEILING].groupby(
        ["features", "training_object"], observed=True
    ):
        run = Run(f"{experiment} {features} {name}", ended_s, ended_s)
        head = {"experiment": experiment, "features": str(features), "training_object": str(name)}
        run.tags, run.params = {"kind": "classifier", **head}, head | params
        ceiling = scores[(scores["features"] == CEILING) & (scores["training_object"] == name)]
        own_curves = curves[(curves["features"] == features) & (curves["training_object"] == name)]
        run.metrics = [*_numbers(rows), *_ceiling(ceiling), *_by_draw(rows), *_roc(own_curves)]
        run.data = _data(processed, experiment, str(name), list(dict.fromkeys(scores["training_object"])))
        run.classifiers = Classifiers(file, str(features), str(name)) if file else None
        run.fingerprint = f"{content[:32]}{content[64:96]} {run.name}"
        runs.append(run)
    return runs


def _numbers(rows: pd.DataFrame) -> list[tuple[str, float, int]]:
    """Return `<split>.<score>`: means over draws; and of the training sets, each counted once, `training.<what>`."""
    found = _means(rows, "")
    first = rows.drop_duplicates("draw")
    found += [(f"training.{name}", float(first[name].astype(float).mean()), 0) for name in TRAINING]
    return [*found, ("training.draws", float(len(first)), 0)]


def _ceiling(rows: pd.DataFrame) -> list[tuple[str, float, int]]:
    return _means(rows, "ceiling.")


def _means(rows: pd.DataFrame, prefix: str) -> list[tuple[str, float, int]]:
    means = rows.groupby("split", observed=True)[list(SCORES)].mean()
    return [
        (f"{prefix}{split}.{name}", float(value), 0)
        for split, row in means.iterrows()
        for name, value in row.items()
        if value == value
    ]


def _by_draw(rows: pd.DataFrame) -> list[tuple[str, float, int]]:
    """Return AUC and Brier score of each draw; the step is the draw."""
    return [
        (f"{row.split}.{name}_by_draw", float(getattr(row, name)), int(row.draw))
        for row in rows.sort_values(["split", "draw"]).itertuples()
        for name in ("auc", "brier")
        if getattr(row, name) == getattr(row, name)
    ]


def _roc(curves: pd.DataFrame) -> list[tuple[str, float, int]]:
    """Return the ROC curve, mean over draws: the step is the false positive rate in percent."""
    means = curves.groupby(["split", "fpr"], observed=True)["tpr"].mean()
    return [
        (f"{split}.tpr_by_fpr_percent", float(tpr), round(100 * fpr)) for (split, fpr), tpr in means.items()
    ]


def learning_curves(path: Path) -> list[tuple[str, float, int]]:
    """Return scores by number of training trials, means over training objects and draws: the step is the number."""
    table = read_table(path, "learning")
    return [
        (
            f"classify.{row.experiment}.{row.features}.{row.split}.{name}_by_samples",
            float(getattr(row, name)),
            int(row.samples),
        )
        for row in table[table["replicate"] == 0].sort_values("samples").itertuples()
        for name in ("auc", "tpr_at_fpr_01", "brier")
        if getattr(row, name) == getattr(row, name)
    ]


def _data(processed: str | Path, experiment: str, training_object: str, objects: list[str]) -> list[Data]:
    paths = {name: Path(processed) / "simulate" / experiment / name / "trials.parquet" for name in objects}
    return [
        _table(path, f"{experiment} {name}", "training" if name == training_object else "testing")
        for name, path in paths.items()
        if path.is_file()
    ]


@cache
def _table(path: Path, name: str, context: str) -> Data:
    file = pq.ParquetFile(path)
    columns = {column.name: str(column.type) for column in file.schema_arrow}
    return Data(name, str(path), sha256(path), context, columns, file.metadata.num_rows)
