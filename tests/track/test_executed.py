"""The runs of the robot's executions, read back from a real store."""

import os
import time

import pandas as pd
import pytest
from track.calls import end, leave

from pipeline.artefacts import TABLES, write_table
from pipeline.track.store import client

SETS = ("label_mapping", "conditioned")


def _executions(features):
    """Three draws: one went well, one spilled and had a refused sample before, one could not be followed."""
    names = {"held_object": "mug", "target_object": "jug", "features": features}
    rows = [
        {"draw": 0, "n_balls": 105, "n_poured": 105, "n_in_target": 105, "success": True, "cause": ""},
        {
            "draw": 1,
            "n_balls": 105,
            "n_poured": 84,
            "n_in_target": 63,
            "n_spilled": 21,
            "cause": "aim",
            "n_refused": 1,
        },
        {"draw": 2, "n_balls": 0, "cause": "arm", "n_refused": 10, "refused": "too fast"},
    ]
    frame = pd.DataFrame([{**names, "source": "mug", "refused": "", "success": False, **row} for row in rows])
    for column in TABLES["executions"]:
        if column.name not in frame:
            frame[column.name] = False if column.name == "fits" else 0
    counts = [name for name in frame if name.startswith("n_")]
    return frame.fillna(dict.fromkeys(counts, 0)).astype(dict.fromkeys(counts, int))


@pytest.fixture(scope="module")
def executed(tmp_path_factory):
    """Return a folder in which a call executed two primitives and filmed one, recorded."""
    folder = leave(tmp_path_factory.mktemp("executed"))
    made = folder / "processed/execute"
    write_table(made / "executions.parquet", pd.concat(map(_executions, SETS)), "executions")
    head = {"held_object": "mug", "target_object": "jug", "features": "conditioned", "samples": 100}
    write_table(made / "safety.parquet", pd.DataFrame([{**head, "way_in": 0.02, "ever": 0.5}]), "safety")
    film = made / "mug/jug/label_mapping/film.gif"
    film.parent.mkdir(parents=True)
    film.write_bytes(b"GIF89a")
    assert end(folder, "success", time.time() - 60) == (0, "", "")
    return folder


def _found(folder):
    store = client(f"sqlite:///{folder}/mlflow.db")
    experiment = store.get_experiment_by_name("tried")
    return store, store.search_runs([experiment.experiment_id], "tags.kind = 'execution'")


def test_each_primitive_and_pair_is_a_run_of_the_call(executed):
    store, runs = _found(executed)
    by_set = {run.data.tags["features"]: run for run in runs}
    assert set(by_set) == set(SETS)
    parents = {run.data.tags["mlflow.parentRunId"] for run in runs}
    assert [store.get_run(parent).data.tags["kind"] for parent in parents] == ["call"]
    told = by_set["conditioned"].data
    assert told.params["held_object"] == "mug"
    assert told.metrics["success"] == pytest.approx(1 / 3)
    assert told.metrics["first_sample"] == pytest.approx(1 / 3)
    assert told.metrics["refused_share"] == pytest.approx(11 / 13)
    assert told.metrics["spilled"] == pytest.approx(21 / 210)
    assert (told.metrics["failed.aim"], told.metrics["failed.arm"]) == (1, 1)
    assert told.metrics["tilted_outside.way_in"] == 0.02
    spilled = store.get_metric_history(by_set["conditioned"].info.run_id, "n_spilled_by_draw")
    assert {point.step: point.value for point in spilled} == {0: 0, 1: 21, 2: 0}


def test_what_was_filmed_has_its_film(executed):
    store, runs = _found(executed)
    files = {
        run.data.tags["features"]: [item.path for item in store.list_artifacts(run.info.run_id, "film")]
        for run in runs
    }
    assert files == {"label_mapping": ["film/film.gif"], "conditioned": []}


def test_the_same_executions_are_no_runs_again_and_none_are_told_of_a_call_without(executed):
    assert end(executed, "success", time.time() - 60) == (0, "", "")
    assert len(_found(executed)[1]) == len(SETS)
    old = time.time() - 3600
    os.utime(executed / "processed/execute/executions.parquet", (old, old))
    film = executed / "processed/execute/mug/jug/label_mapping/film.gif"
    film.write_bytes(b"GIF89b")
    os.utime(film, (old, old))
    assert end(executed, "success", time.time() - 60) == (0, "", "")
    assert len(_found(executed)[1]) == len(SETS)
    os.utime(film)
    assert end(executed, "success", time.time() - 60) == (0, "", "")
    assert len(_found(executed)[1]) == len(SETS) + 1  # with the film that was made since
