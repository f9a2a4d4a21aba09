"""The runs of a call, read back from a real store; and a broken store costs no more than a warning."""

import os
import shutil
import time
from pathlib import Path

import pytest
from track.calls import OBJECTS, end, leave, told, track

from pipeline.track.store import client


def _runs(folder, kind=None):
    store = client(f"sqlite:///{folder}/mlflow.db")
    experiment = store.get_experiment_by_name("tried")
    runs = store.search_runs([experiment.experiment_id])
    return store, [run for run in runs if kind in (None, run.data.tags["kind"])]


def _said(folder):
    """Return what all runs say, without the ids that the store gives."""

    def plain(run, parents):
        tags = {
            key: value
            for key, value in run.data.tags.items()
            if key not in ("mlflow.parentRunId", "mlflow.log-model.history")
        }
        parent = parents.get(run.data.tags.get("mlflow.parentRunId"))
        inputs = sorted((item.dataset.name, item.dataset.digest) for item in run.inputs.dataset_inputs)
        curves = [store.get_metric_history(run.info.run_id, key) for key in sorted(run.data.metrics)]
        points = [
            (point.key, point.step, point.value, point.timestamp) for curve in curves for point in curve
        ]
        times = run.info.start_time, run.info.end_time, run.info.status
        models = [store.get_logged_model(item.model_id).name for item in run.outputs.model_outputs]
        files = sorted(item.path for item in store.list_artifacts(run.info.run_id))
        return (run.info.run_name, parent, tags, run.data.params, points, inputs, times, models, files)

    store, runs = _runs(folder)
    names = {run.info.run_id: run.info.run_name for run in runs}
    return sorted((plain(run, names) for run in runs), key=lambda told: told[0])


@pytest.fixture
def again(tracked, tmp_path):
    """Return a copy of the folder, whose store still has its artifacts where they were."""
    return shutil.copytree(tracked, tmp_path / "again")


def test_a_call_has_parameters_numbers_figures_and_data(tracked):
    store, (parent,) = _runs(tracked, "call")
    assert parent.info.status == "FINISHED"
    assert parent.data.params["classify.draws"] == "2"
    assert parent.data.params["objects"] == "mug jug"
    assert len(parent.data.params["data.mug.sha256"]) == 64
    assert parent.data.metrics["simulate.pouring.leaked"] == 0
    assert (parent.data.metrics["seconds.fuse"], parent.data.metrics["cpu_seconds.fuse"]) == (6.5, 3.0)
    assert parent.data.tags["git.commit"] == "unknown"
    assert {item.dataset.name for item in parent.inputs.dataset_inputs} == {"mug", "jug"}
    assert {item.path for item in store.list_artifacts(parent.info.run_id)} == {
        "reports",
        "config.json",
        "call.log",
    }
    figures = {item.path for item in store.list_artifacts(parent.info.run_id, "reports")}
    assert figures == {"reports/roc.pdf", "reports/metrics.json", "reports/scans"}
    assert parent.info.artifact_uri.startswith((tracked / "mlartifacts").as_uri())


def test_stages_and_classifiers_are_nested(tracked):
    _, (parent,) = _runs(tracked, "call")
    _, stages = _runs(tracked, "stage")
    _, classifiers = _runs(tracked, "classifier")
    assert {run.data.tags["mlflow.parentRunId"] for run in stages + classifiers} == {parent.info.run_id}
    assert [(run.info.run_name, run.data.metrics["jobs"]) for run in stages] == [("stage fuse", 2.0)]
    assert {run.data.tags["training_object"] for run in classifiers} == set(OBJECTS)
    assert len(classifiers) == 4
    for run in classifiers:
        assert len(run.outputs.model_outputs) == 1
        assert {item.dataset.name for item in run.inputs.dataset_inputs} == {"pouring mug", "pouring jug"}


def test_the_data_of_a_run_can_be_read_from_its_source(tracked):
    import mlflow.data

    _, (run, *_) = _runs(tracked, "classifier")
    for item in run.inputs.dataset_inputs:
        path = Path(mlflow.data.get_source(item.dataset).load())
        assert path.read_bytes().startswith(b"PAR1")


def test_a_lost_store_is_told_again_with_the_same_runs(again):
    before = _said(again)
    (again / "mlflow.db").unlink()
    assert told(track(again, "again")) == (0, "1 calls recorded, 0 were there already\n", "")
    assert _said(again) == before


def test_a_call_that_is_there_is_not_told_twice(again):
    before = _said(again)
    assert told(track(again, "again")) == (0, "0 calls recorded, 1 were there already\n", "")
    assert _said(again) == before


def test_a_call_whose_writer_was_stopped_is_told_anew(again):
    before = _said(again)
    store, (parent,) = _runs(again, "call")
    store.update_run(parent.info.run_id, status="RUNNING")
    _, (stage,) = _runs(again, "stage")
    store.delete_run(stage.info.run_id)
    assert track(again, "again").communicate()[0] == "1 calls recorded, 0 were there already\n"
    assert _said(again) == before


def test_the_same_classifiers_are_no_runs_again(tmp_path):
    folder = leave(tmp_path)
    for _ in range(2):
        assert end(folder, "success", time.time() - 60) == (0, "", "")
    assert len(_runs(folder, "call")[1]) == 2
    assert len(_runs(folder, "classifier")[1]) == 4


def test_a_figure_that_has_changed_is_named_and_not_attached(again):
    (again / "mlflow.db").unlink()
    (again / "reports/roc.pdf").write_bytes(b"%PDF of another call")
    track(again, "again").communicate()
    store, (parent,) = _runs(again, "call")
    assert parent.data.tags["changed_since"] == "reports/roc.pdf"
    assert "reports/roc.pdf" not in {
        item.path for item in store.list_artifacts(parent.info.run_id, "reports")
    }


FAILED = """\
Error in rule fuse:
    jobid: 1
    log: logs/fuse/mug.log (check log file(s) for error details)
Exiting because a job execution failed. Look above for error messages
"""


def test_a_failed_call_has_the_rule_its_log_and_no_result_of_an_earlier_one(tmp_path):
    folder = leave(tmp_path)
    (folder / "logs/fuse").mkdir(parents=True)
    (folder / "logs/fuse/mug.log").write_text("error: data/raw/mug: expected x, found y\n")
    (folder / "call.log").write_text(FAILED)
    assert end(folder, "failed", time.time() + 60) == (0, "", "")
    store, (parent,) = _runs(folder, "call")
    assert parent.info.status == "FAILED"
    assert parent.data.tags["failed.rule"] == "fuse"
    assert "found y" in parent.data.tags["mlflow.note.content"]
    assert "simulate.pouring.leaked" not in parent.data.metrics
    assert "classify.pouring.standard.novel.auc_by_samples" not in parent.data.metrics
    assert [run.info.status for run in _runs(folder, "stage")[1]] == ["FAILED"]
    assert _runs(folder, "classifier")[1] == []
    logs = store.list_artifacts(parent.info.run_id, "failed/logs/fuse")
    assert [item.path for item in logs] == ["failed/logs/fuse/mug.log"]


def test_learning_curves_are_curves_of_the_call(tracked):
    store, (parent,) = _runs(tracked, "call")
    curve = store.get_metric_history(parent.info.run_id, "classify.pouring.standard.novel.auc_by_samples")
    assert [(point.step, point.value) for point in curve] == [(10, 0.7), (50, 0.8), (500, 0.9)]


def test_a_call_that_its_user_stopped_says_so(tmp_path):
    folder = leave(tmp_path)
    (folder / "call.log").write_text(
        f"Terminating processes on user request, this might take some time.\n{FAILED}"
    )
    assert end(folder, "failed", time.time() + 60) == (0, "", "")
    note = _runs(folder, "call")[1][0].data.tags["mlflow.note.content"]
    assert note.startswith(
        "Stopped by its user. Ended without their outputs:\n- `fuse`: ended without a word"
    )


@pytest.mark.parametrize("uri", ["nonsense://nowhere", "http://127.0.0.1:9"])
def test_a_store_that_cannot_be_reached_costs_one_warning_and_is_told_later(tmp_path, uri):
    folder = leave(tmp_path)
    code, out, err = end(folder, "success", time.time() - 60, MLFLOW_TRACKING_URI=uri)
    assert (code, out) == (0, "")
    assert err.startswith("warning: track: expected to record this call in MLflow")
    assert len(err.splitlines()) == 1
    if uri.startswith("nonsense"):
        job = track(folder, "again", MLFLOW_TRACKING_URI=uri)
        assert job.communicate()[1].startswith(f"error: {uri}: expected a store of MLflow, found")
        assert job.returncode == 1
        assert track(folder, "again").communicate()[0] == "1 calls recorded, 0 were there already\n"


def test_nothing_to_tell_again_is_said(tmp_path):
    job = track(tmp_path, "again")
    assert job.communicate()[1].startswith(
        "error: logs/track/calls: expected the records of earlier calls, found none"
    )
    assert job.returncode == 1


def test_stores_prepared_at_the_same_time_are_whole(tmp_path):
    jobs = [track(tmp_path, "start") for _ in range(3)]
    assert [job.communicate()[1] for job in jobs] == ["", "", ""]
    assert os.listdir(tmp_path) == ["mlflow.db"]
    assert client(f"sqlite:///{tmp_path}/mlflow.db").create_experiment("another")
