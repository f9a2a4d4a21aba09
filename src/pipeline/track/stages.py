"""One run a stage: how many jobs it had in a call, what they took, what was asked of it."""

import csv
import math
from dataclasses import dataclass
from pathlib import Path

from pipeline.track.facts import made
from pipeline.track.failures import Failure
from pipeline.track.runs import Run


@dataclass(frozen=True)
class Job:
    """What Snakemake measured of one job: wall and processor seconds, memory; `ended_s` since 1970."""

    stage: str
    name: str
    wall_s: float
    cpu_s: float
    memory_mb: float
    ended_s: float


def jobs(benchmarks: str | Path, since_s: float) -> list[Job]:
    """Return the jobs that ended since `since_s` (seconds since 1970) and are measured, by their files benchmarks/<stage>/….tsv."""
    return [
        _job(path, Path(benchmarks))
        for path in sorted(Path(benchmarks).glob("*/**/*.tsv"))
        if made(path, since_s)
    ]


def _job(path: Path, benchmarks: Path) -> Job:
    with path.open() as file:
        rows = list(csv.DictReader(file, delimiter="\t"))
    stage, *inner = path.relative_to(benchmarks).with_suffix("").parts
    wall_s, cpu_s, memory_mb = (
        [_number(row.get(column)) for row in rows] for column in ("s", "cpu_time", "max_rss")
    )
    return Job(
        stage, "/".join(inner), sum(wall_s), sum(cpu_s), max(memory_mb, default=0.0), path.stat().st_mtime
    )


def _number(text: str | None) -> float:
    """Return a number of a benchmark; a job that was too short to be measured has none, which counts as nothing."""
    try:
        value = float(text or 0.0)
    except ValueError:
        return 0.0
    return value if math.isfinite(value) else 0.0


def stage_runs(measured: list[Job], failed: list[Failure], config: dict, now_s: float) -> list[Run]:
    """Return a run for each stage that had a measured job or a failed one; `config` is flat, and cut to the stage's keys."""
    names = dict.fromkeys([job.stage for job in measured] + [failure.stage for failure in failed])
    return [
        _stage_run(
            name,
            [job for job in measured if job.stage == name],
            [failure for failure in failed if failure.stage == name],
            {key: value for key, value in config.items() if key.startswith(f"{name}.")},
            now_s,
        )
        for name in names
    ]


def _stage_run(name: str, own: list[Job], failed: list[Failure], params: dict, now_s: float) -> Run:
    begun_s = min((job.ended_s - job.wall_s for job in own), default=now_s)
    run = Run(f"stage {name}", begun_s, max((job.ended_s for job in own), default=now_s))
    run.status = "FAILED" if failed else "FINISHED"
    run.tags = {"kind": "stage", "stage": name} | failure_tags(failed)
    run.params = params
    run.metrics = [
        *((key, value, 0) for key, value in spent(own).items()),
        ("elapsed_s", run.ended_s - begun_s, 0),
        *((f"job_s/{job.name}", job.wall_s, 0) for job in own),
    ]
    return run


def spent(own: list[Job]) -> dict[str, float]:
    """Return what jobs took together: wall and processor seconds summed, the largest memory, how many there were."""
    return {
        "seconds": sum(job.wall_s for job in own),
        "cpu_seconds": sum(job.cpu_s for job in own),
        "memory_max_mb": max((job.memory_mb for job in own), default=0.0),
        "jobs": float(len(own)),
    }


def failure_tags(failed: list[Failure]) -> dict[str, str]:
    """Return which rules failed, where their logs are and what the first says; nothing when none did."""
    if not failed:
        return {}
    return {
        "failed.rule": " ".join(dict.fromkeys(failure.rule for failure in failed)),
        "failed.log": " ".join(log for failure in failed for log in failure.logs),
        "failed.reason": failed[0].reason[:2000],
    }
