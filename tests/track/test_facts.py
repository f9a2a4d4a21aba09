"""What is recorded is read off files correctly."""

import os
import time

import numpy as np
import pytest
from track.calls import leave

from pipeline.command import progress, steps
from pipeline.track import facts
from pipeline.track.failures import failures
from pipeline.track.stages import jobs, stage_runs
from pipeline.track.trained import trained_runs


def test_flatten_dots_keys_and_joins_lists():
    assert facts.flatten({"a": {"b": {"c": 1}, "d": ["x", "y"]}, "e": 2.5}) == {
        "a.b.c": 1,
        "a.d": "x y",
        "e": 2.5,
    }


def test_digest_sees_contents_and_names_but_not_times_or_hidden_files(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a/one").write_text("1")
    before = facts.digest(tmp_path)
    os.utime(tmp_path / "a/one", (1, 1))
    (tmp_path / ".hidden").write_text("x")
    assert facts.digest(tmp_path) == before
    (tmp_path / "a/one").write_text("2")
    changed = facts.digest(tmp_path)
    (tmp_path / "a/one").rename(tmp_path / "a/two")
    assert len({before, changed, facts.digest(tmp_path)}) == 3


def test_stages_sum_the_jobs_of_this_call_alone(tmp_path):
    for name, written_s, cpu in (("fuse/mug", 200, "1.25"), ("fuse/jug", 205, "NA"), ("scan/mug", 50, "9")):
        path = tmp_path / f"{name}.tsv"
        path.parent.mkdir(exist_ok=True)
        path.write_text(f"s\th:m:s\tmax_rss\tcpu_time\n1.5\t0:00:01\t10\t{cpu}\n")
        os.utime(path, (written_s, written_s))
    (run,) = stage_runs(jobs(tmp_path, since_s=100.0), [], {"fuse.points": 5, "scan.views": 3}, now_s=300.0)
    numbers = {key: value for key, value, _ in run.metrics}
    assert (run.name, run.status, run.params) == ("stage fuse", "FINISHED", {"fuse.points": 5})
    assert (run.begun_s, run.ended_s) == (198.5, 205.0)
    assert {key: numbers[key] for key in ("seconds", "cpu_seconds", "jobs", "job_s/mug", "elapsed_s")} == {
        "seconds": 3.0,
        "cpu_seconds": 1.25,
        "jobs": 2.0,
        "job_s/mug": 1.5,
        "elapsed_s": 6.5,
    }


SNAKEMAKE = """\
[Tue Nov 24 15:34:54 2026]
Error in rule fuse:
    message: None
    jobid: 1
    output: data/processed/fuse/mug/mesh.ply
    log: {log} (check log file(s) for error details)
    shell:
        python -m pipeline.fuse
        (command exited with non-zero exit code)
Exiting because a job execution failed. Look above for error messages
"""


def _count() -> None:
    for _ in progress(range(3), 3, "trials", every_s=0.0):
        time.sleep(0.001)


def _step() -> None:
    with steps("trials", 2, every_s=0.01) as tell:
        tell("one")
        time.sleep(0.05)


def test_failures_name_rule_stage_log_and_reason(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "logs/fuse").mkdir(parents=True)
    (tmp_path / "logs/fuse/mug.log").write_text("12 views\nerror: data/raw/mug: expected x, found y\n")
    (tmp_path / "one.log").write_text(SNAKEMAKE.format(log="logs/fuse/mug.log") * 2)
    (failure,) = failures(["one.log", "none.log"])
    assert (failure.rule, failure.stage, failure.logs) == ("fuse", "fuse", ("logs/fuse/mug.log",))
    assert failure.reason == "error: data/raw/mug: expected x, found y"
    (run,) = stage_runs([], [failure], {}, now_s=300.0)
    assert (run.name, run.status, run.tags["failed.log"]) == ("stage fuse", "FAILED", "logs/fuse/mug.log")


@pytest.mark.parametrize("tell", [_count, _step])
def test_a_job_that_was_killed_has_not_failed_of_its_progress(tmp_path, monkeypatch, capfd, tell):
    monkeypatch.chdir(tmp_path)
    tell()
    said = capfd.readouterr().err
    assert said.startswith("trials")
    (tmp_path / "job.log").write_text(said)
    (tmp_path / "one.log").write_text(SNAKEMAKE.format(log="job.log"))
    (failure,) = failures(["one.log"])
    assert failure.reason == f"ended without an error, as when it is killed, after: {said.splitlines()[-1]}"


def test_a_classifier_run_has_means_curves_and_the_ceiling(tmp_path):
    processed = leave(tmp_path) / "processed"
    runs = {
        run.name: run for run in trained_runs(processed, "pouring", {"classify.draws": 2, "fuse.points": 5})
    }
    assert set(runs) == {
        f"pouring {what} {name}" for what in ("label_mapping", "standard") for name in ("mug", "jug")
    }
    run = runs["pouring standard mug"]
    numbers = {key: value for key, value, step in run.metrics if "_by_" not in key}
    assert numbers["novel.auc"] == pytest.approx(0.85)
    assert numbers["ceiling.same.auc"] == pytest.approx(0.8)
    assert (numbers["training.separable"], numbers["training.draws"]) == (0.5, 2.0)
    assert [item for item in run.metrics if item[0] == "novel.auc_by_draw"] == [
        ("novel.auc_by_draw", pytest.approx(0.8), 0),
        ("novel.auc_by_draw", pytest.approx(0.9), 1),
    ]
    curve = [(step, value) for key, value, step in run.metrics if key == "same.tpr_by_fpr_percent"]
    assert curve == [(0, 0.0), (50, pytest.approx((np.sqrt(0.5) + 0.5**0.25) / 2)), (100, 1.0)]
    assert {item.context: item.name for item in run.data} == {
        "training": "pouring mug",
        "testing": "pouring jug",
    }
    assert run.params["classify.draws"] == 2
    assert "fuse.points" not in run.params
