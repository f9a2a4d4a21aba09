"""One run a (motor primitive × pair): how the robot's executions went, draw by draw, what they failed of, their film."""

from pathlib import Path

import pandas as pd

from pipeline.artefacts import read_table
from pipeline.track.facts import sha256
from pipeline.track.runs import Data, File, Run

COUNTS = ("n_poured", "n_in_target", "n_spilled", "n_refused")
PAIR = ["held_object", "target_object"]


def executed_runs(processed: str | Path, config: dict) -> list[Run]:
    """Return the runs of `execute/executions.parquet`; `config` is flat. Times are those of its file."""
    folder = Path(processed) / "execute"
    path = folder / "executions.parquet"
    executions, ended_s = read_table(path, "executions"), path.stat().st_mtime
    content = " ".join(sha256(file)[:24] for file in (path, folder / "safety.parquet") if file.is_file())
    params = {key: value for key, value in config.items() if key.startswith(("execute.", "primitives."))}
    runs = []
    for (held, target, features), rows in executions.groupby([*PAIR, "features"], sort=False):
        head = {"held_object": str(held), "target_object": str(target), "features": str(features)}
        run = Run(f"execution {features} {held} into {target}", ended_s, ended_s)
        run.tags, run.params = {"kind": "execution", **head}, head | params
        run.metrics = [*_numbers(rows), *_safety(folder / "safety.parquet", head), *_by_draw(rows)]
        run.data = _data(folder / str(held) / str(target))
        film = folder / str(held) / str(target) / str(features) / "film.gif"
        run.files = [File(str(film), sha256(film), "film")] if film.is_file() else []
        run.fingerprint = " ".join([content, *(file.sha256[:24] for file in run.files), run.name])
        runs.append(run)
    return runs


def _numbers(rows: pd.DataFrame) -> list[tuple[str, float, int]]:
    """Return the rate of success, refused samples redrawn and as failures; shares of balls; a count a cause of failure."""
    balls, samples = rows["n_balls"].sum(), (rows["n_refused"] + (rows["cause"] != "arm")).sum()
    found = {
        "success": rows["success"].mean(),
        "first_sample": (rows["success"] & (rows["n_refused"] == 0)).mean(),
        "executions": len(rows),
        "refused_share": rows["n_refused"].sum() / samples,
    }
    if balls:
        found |= {name: rows[f"n_{name}"].sum() / balls for name in ("poured", "in_target", "spilled")}
    failed = rows.loc[~rows["success"], "cause"].value_counts()
    found |= {f"failed.{cause}": count for cause, count in failed.items()}
    return [(key, float(value), 0) for key, value in found.items()]


def _safety(path: Path, head: dict[str, str]) -> list[tuple[str, float, int]]:
    """Return how often drawn trajectories tilt too far outside the opening."""
    if not path.is_file():
        return []
    table = read_table(path, "safety")
    row = table[(table[list(head)] == pd.Series(head)).all(axis=1)]
    return [
        (f"tilted_outside.{name}", float(row[name].iloc[0]), 0) for name in ("way_in", "ever") if len(row)
    ]


def _by_draw(rows: pd.DataFrame) -> list[tuple[str, float, int]]:
    """Return what happened in each execution; the step is the draw."""
    return [
        (f"{name}_by_draw", float(getattr(row, name)), int(row.draw))
        for row in rows.sort_values("draw").itertuples()
        for name in ("success", *COUNTS)
    ]


def _data(folder: Path) -> list[Data]:
    paths = {name: folder / f"{name}.parquet" for name in ("trajectories", "outcomes")}
    return [
        Data(f"{name} {folder.parent.name} {folder.name}", str(path), sha256(path), "execution")
        for name, path in paths.items()
        if path.is_file()
    ]
