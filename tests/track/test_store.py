"""The runs of a call, read back from a real store; and a broken store costs no more than a warning."""

import json
import os
import subprocess
import sys
import time

import pandas as pd
import pytest

from pipeline.artefacts import write_table
from pipeline.track.store import client

CONFIG = {"classify": {"draws": 3}, "simulate": {"pouring": {"trials": 80}}, "track": {"experiment": "tried"}}


def _track(folder, *arguments, **environment):
    kept = {key: value for key, value in os.environ.items() if key != "MLFLOW_TRACKING_URI"}
    return subprocess.Popen(
        [sys.executable, "-m", "pipeline.track", *arguments],
        **{"cwd": folder, "env": kept | environment, "text": True},
        **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE},
    )


def _end(folder, status, since_s, **environment):
    folders = [word for name in ("raw", "processed", "reports", "benchmarks") for word in (f"--{name}", name)]
    job = _track(
        folder,
        *("end", "--status", status, "--since", str(since_s), "--log", "call.log", "--config", "config.json"),
        *(*folders, "--objects", "mug", "jug"),
        **environment,
    )
    out, err = job.communicate()
    return job.returncode, out, err


def _runs(folder):
    store = client(f"sqlite:///{folder}/mlflow.db")
    experiment = store.get_experiment_by_name("tried")
    return store, store.search_runs([experiment.experiment_id])


@pytest.fixture
def call(tmp_path):
    """Return a folder as a call of the workflow leaves it."""
    for name in ("mug", "jug"):
        (tmp_path / "raw" / name).mkdir(parents=True)
        (tmp_path / "raw" / name / "scan.ply").write_text(name)
    curve = {"experiment": "pouring", "split": "novel", "training_object": "mug", "draw": 0}
    numbers = {"auc": 0.9, "tpr_at_fpr_00": 0.1, "tpr_at_fpr_01": 0.2, "tpr_at_fpr_05": 0.3, "brier": 0.05}
    counts = {
        "n_test": 5,
        "n_positive": 2,
        "n_iterations": 3,
        "n_redrawn": 0,
        "separable": False,
        "converged": True,
    }
    rows = [
        {**curve, **numbers, **counts, "features": features} for features in ("standard", "label_mapping")
    ]
    write_table(tmp_path / "processed/classify/pouring/scores.parquet", pd.DataFrame(rows), "scores")
    (tmp_path / "reports").mkdir()
    (tmp_path / "reports/roc.pdf").write_bytes(b"%PDF")
    (tmp_path / "reports/metrics.json").write_text('{"simulate.pouring.leaked": 0}')
    (tmp_path / "benchmarks/fuse").mkdir(parents=True)
    (tmp_path / "benchmarks/fuse/mug.tsv").write_text("s\th:m:s\n2.5\t0:00:02\n")
    (tmp_path / "config.json").write_text(json.dumps(CONFIG))
    (tmp_path / "call.log").write_text("a log")
    return tmp_path


def test_a_call_leaves_a_parent_run_and_one_run_a_feature_set(call):
    code, out, err = _end(call, "success", time.time() - 60)
    assert (code, out, err) == (0, "", "")
    store, runs = _runs(call)
    (parent,) = [run for run in runs if "mlflow.parentRunId" not in run.data.tags]
    nested = {run.info.run_name: run for run in runs if run is not parent}
    assert parent.info.status == "FINISHED"
    assert parent.data.params["classify.draws"] == "3"
    assert parent.data.params["objects"] == "mug jug"
    assert len(parent.data.params["data.mug.sha256"]) == 64
    assert parent.data.metrics["simulate.pouring.leaked"] == 0
    assert parent.data.metrics["seconds.fuse"] == 2.5
    assert parent.data.tags["git.commit"] == "unknown"
    assert {item.dataset.name for item in parent.inputs.dataset_inputs} == {"mug", "jug"}
    artifacts = {artifact.path for artifact in store.list_artifacts(parent.info.run_id)}
    assert artifacts == {"roc.pdf", "metrics.json", "config.json", "call.log"}
    assert parent.info.artifact_uri.startswith((call / "mlartifacts").as_uri())
    assert set(nested) == {"pouring standard", "pouring label_mapping"}
    assert nested["pouring standard"].data.metrics["novel.auc"] == pytest.approx(0.9)
    assert nested["pouring standard"].data.params["simulate.pouring.trials"] == "80"
    assert nested["pouring standard"].data.tags["mlflow.parentRunId"] == parent.info.run_id


def test_a_failed_call_is_recorded_without_the_results_of_an_earlier_one(call):
    code, _, err = _end(call, "failed", time.time() + 60)
    assert (code, err) == (0, "")
    store, (parent,) = _runs(call)
    assert parent.info.status == "FAILED"
    assert not any(key.startswith("simulate.pouring.leaked") for key in parent.data.metrics)
    assert {artifact.path for artifact in store.list_artifacts(parent.info.run_id)} == {
        "config.json",
        "call.log",
    }


@pytest.mark.parametrize("uri", ["nonsense://nowhere", "http://127.0.0.1:9"])
def test_a_store_that_cannot_be_reached_costs_one_warning(call, uri):
    begun_s = time.monotonic()
    code, out, err = _end(call, "success", time.time() - 60, MLFLOW_TRACKING_URI=uri)
    assert (code, out) == (0, "")
    assert err.startswith("warning: track: expected to record this call in MLflow")
    assert len(err.splitlines()) == 1
    assert time.monotonic() - begun_s < 60


def test_stores_prepared_at_the_same_time_are_whole(tmp_path):
    jobs = [_track(tmp_path, "start") for _ in range(3)]
    assert [job.communicate()[1] for job in jobs] == ["", "", ""]
    assert os.listdir(tmp_path) == ["mlflow.db"]
    assert client(f"sqlite:///{tmp_path}/mlflow.db").create_experiment("another")
