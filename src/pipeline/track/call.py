"""The run of a whole call with those of its stages and classifiers nested in it, read off what the call left behind."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from pipeline.track import facts
from pipeline.track.executed import executed_runs
from pipeline.track.failures import Failure, failures, stopped, text
from pipeline.track.runs import Data, File, Run
from pipeline.track.stages import failure_tags, jobs, spent, stage_runs
from pipeline.track.trained import learning_curves, trained_runs


@dataclass(frozen=True)
class Call:
    """What the workflow says of a call: how it ended and when, its folders, objects and merged configuration."""

    status: str
    since_s: float
    until_s: float
    logs: tuple[str, ...]
    config: dict[str, Any]
    raw: str
    processed: str
    reports: str
    benchmarks: str
    objects: tuple[str, ...]


def call_run(call: Call) -> Run:
    """Return the run of a call: parameters, numbers, figures, raw data; stages and classifiers nested."""
    flat, measured = facts.flatten(call.config), jobs(call.benchmarks, call.since_s)
    failed = failures(call.logs) if call.status == "failed" else []
    begun = datetime.fromtimestamp(call.since_s).strftime("%Y-%m-%d %H:%M:%S")
    run = Run(f"call {begun}", call.since_s, call.until_s)
    run.status = "FINISHED" if call.status == "success" else "FAILED"
    origin = facts.commit() | facts.who()
    run.tags = {"kind": "call", "status": call.status, **origin, **failure_tags(failed)}
    run.tags["mlflow.note.content"] = _note(call, failed)
    raw = [_raw(call.raw, name) for name in call.objects]
    run.params = flat | {"objects": " ".join(call.objects)}
    run.params |= {f"data.{item.name}.sha256": item.sha256 for item in raw}
    run.data = raw
    numbers = facts.headline(call.reports, call.since_s)
    totals = {key: value for key, value in spent(measured).items() if key != "seconds"}
    numbers |= totals | {"seconds.call": call.until_s - call.since_s}
    run.files = [_file(path, call.reports) for path in facts.reported(call.reports, call.since_s)]
    run.texts = _texts(call, failed)
    run.nested = stage_runs(measured, failed, flat, call.until_s)
    for stage in run.nested:
        found = {key: value for key, value, _ in stage.metrics}
        numbers |= {f"{what}.{stage.tags['stage']}": found[what] for what in ("seconds", "cpu_seconds")}
    run.metrics = [(key, value, 0) for key, value in numbers.items()]
    for path in sorted(Path(call.processed).glob("classify/*/learning.parquet")):
        run.metrics += learning_curves(path) if facts.made(path, call.since_s) else []
    run.nested += _classifiers(call, flat) + _executions(call, flat)
    for nested in run.nested:
        nested.tags |= origin
    return run


def _raw(folder: str, name: str) -> Data:
    return Data(name, f"{folder}/{name}", facts.digest(Path(folder) / name), "raw")


def _file(path: Path, reports: str) -> File:
    return File(
        str(path), facts.sha256(path), (Path("reports") / path.relative_to(reports).parent).as_posix()
    )


def _texts(call: Call, failed: Iterable[Failure]) -> dict[str, str]:
    """Return the configuration, Snakemake's logs, and those of the jobs that failed."""
    logs = {Path(path).name: text(path) for path in call.logs if Path(path).is_file()}
    own = {
        f"failed/{path}": text(path) for failure in failed for path in failure.logs if Path(path).is_file()
    }
    return {"config.json": json.dumps(call.config, indent=2, sort_keys=True), **logs, **own}


def _classifiers(call: Call, flat: dict[str, Any]) -> list[Run]:
    """Return the runs of all experiments whose classifiers are up to date: with the report, or made by this call."""
    found = sorted(Path(call.processed).glob("classify/*/scores.parquet"))
    reported = facts.made(Path(call.reports) / "roc.pdf", call.since_s)
    fresh = [path.parent.name for path in found if reported or facts.made(path, call.since_s)]
    return [run for name in fresh for run in trained_runs(call.processed, name, flat)]


def _executions(call: Call, flat: dict[str, Any]) -> list[Run]:
    """Return the runs of the robot's executions, if this call made them, their report or a film of them."""
    folder = Path(call.processed) / "execute"
    path, report = folder / "executions.parquet", Path(call.reports) / "execution.pdf"
    fresh = any(facts.made(file, call.since_s) for file in (path, report, *folder.glob("*/*/*/film.gif")))
    return executed_runs(call.processed, flat) if fresh and path.is_file() else []


def _note(call: Call, failed: list[Failure]) -> str:
    """Return the description that MLflow shows on top of a run."""
    objects = f"Objects: {', '.join(call.objects)}."
    if call.status == "success":
        return objects
    lines = [f"- `{failure.rule}`: {failure.reason} ({', '.join(failure.logs)})" for failure in failed]
    head = "Stopped by its user. Ended without their outputs:" if stopped(call.logs) else "Failed:"
    return "\n".join([head, *(lines or ["- no job"]), "", objects])
