"""What there is to record about a call of the workflow: read from its files, knows nothing of MLflow."""

import csv
import hashlib
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pipeline.artefacts import read_json, read_table

SCORES = ("auc", "tpr_at_fpr_00", "tpr_at_fpr_01", "tpr_at_fpr_05", "brier")


def flatten(tree: dict, prefix: str = "") -> dict[str, Any]:
    """Return nested `tree` as one level with dotted keys; lists become words with spaces between."""
    flat: dict[str, Any] = {}
    for key, value in tree.items():
        name = f"{prefix}{key}"
        if isinstance(value, dict):
            flat |= flatten(value, f"{name}.")
        else:
            flat[name] = " ".join(map(str, value)) if isinstance(value, list) else value
    return flat


def digest(folder: str | Path) -> str:
    """Return the SHA-256 over names and contents of all files below `folder`; hidden ones are left out."""
    total = hashlib.sha256()
    for path in sorted(_files(Path(folder))):
        content = hashlib.sha256(path.read_bytes()).hexdigest()
        total.update(f"{path.relative_to(folder).as_posix()} {content}\n".encode())
    return total.hexdigest()


def _files(folder: Path) -> Iterator[Path]:
    for parent, folders, names in os.walk(folder, followlinks=True):
        folders[:] = [name for name in folders if not name.startswith(".")]
        yield from (Path(parent, name) for name in names if not name.startswith("."))


def commit() -> dict[str, str]:
    """Return commit and whether files differ from it (`git.commit`, `git.dirty`), or `unknown` outside a repository."""
    try:
        head = _git("rev-parse", "HEAD")
        return {"git.commit": head, "git.dirty": str(bool(_git("status", "--porcelain"))).lower()}
    except (OSError, subprocess.CalledProcessError):
        return {"git.commit": "unknown", "git.dirty": "unknown"}


def _git(*arguments: str) -> str:
    return subprocess.run(["git", *arguments], capture_output=True, text=True, check=True).stdout.strip()


def made(path: str | Path, since_s: float) -> bool:
    """Return whether the file is there and was written at or after `since_s` (seconds since 1970)."""
    return Path(path).is_file() and Path(path).stat().st_mtime >= since_s


def seconds(benchmarks: str | Path, since_s: float) -> dict[str, float]:
    """Return wall time a stage in seconds, summed over the jobs that ran since `since_s`."""
    totals: dict[str, float] = {}
    for path in sorted(Path(benchmarks).glob("*/**/*.tsv")):
        if made(path, since_s):
            stage = path.relative_to(benchmarks).parts[0]
            with path.open() as file:
                spent_s = sum(float(row["s"]) for row in csv.DictReader(file, delimiter="\t"))
            totals[stage] = totals.get(stage, 0.0) + spent_s
    return totals


def experiments(processed: str | Path, reports: str | Path, since_s: float) -> dict[str, Path]:
    """Return the scores that this call made or, as it made the report from them, found up to date: experiment → file."""
    reported = made(Path(reports) / "roc.pdf", since_s)
    scores = sorted((Path(processed) / "classify").glob("*/scores.parquet"))
    return {path.parent.name: path for path in scores if reported or made(path, since_s)}


def score_means(scores: str | Path) -> dict[str, dict[str, float]]:
    """Return features → {`same.auc`, `novel.auc`, …}: means over draws, then over training objects; no undefined ones."""
    table = read_table(scores, "scores")
    by_object = table.groupby(["features", "split", "training_object"], observed=True)[list(SCORES)].mean()
    means = by_object.groupby(["features", "split"]).mean()
    found: dict[str, dict[str, float]] = {}
    for (features, split), row in means.iterrows():
        found.setdefault(str(features), {}).update(
            {f"{split}.{name}": float(value) for name, value in row.items() if value == value}
        )
    return found


def headline(reports: str | Path, since_s: float) -> dict[str, float]:
    """Return the numbers of `metrics.json`, when this call made it."""
    path = Path(reports) / "metrics.json"
    numbers = read_json(path) if made(path, since_s) else {}
    return {key: float(value) for key, value in numbers.items() if isinstance(value, int | float)}
