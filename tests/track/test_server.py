"""A team's server on a real PostgreSQL: eight write at once and nothing is lost, nor when it is started again."""

import json
import multiprocessing
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from contextlib import contextmanager
from pathlib import Path

import pytest

from pipeline.errors import PipelineError
from pipeline.track import postgres
from pipeline.track.runs import Data, Run
from pipeline.track.store import Recorder, client

WRITERS, NESTED = 8, 3

try:
    postgres.programs()
except PipelineError as error:
    pytestmark = pytest.mark.skip(reason=str(error))


@pytest.fixture
def folder():
    """Return a folder that the user 'postgres' can reach, which those of pytest are not."""
    path = Path(tempfile.mkdtemp())
    path.chmod(0o755)
    yield path
    shutil.rmtree(path)


@contextmanager
def _served(folder: Path):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    words = ["--folder", str(folder / "team"), "--port", str(port), "--workers", "1"]
    with (folder / "server.log").open("w") as log:
        server = subprocess.Popen(
            [sys.executable, "-m", "pipeline.track.server", *words], stdout=log, stderr=log
        )
    try:
        while server.poll() is None:
            try:
                with urllib.request.urlopen(f"http://127.0.0.1:{port}/health", timeout=5):
                    break
            except (urllib.error.URLError, OSError):
                time.sleep(0.3)
        assert server.poll() is None, (folder / "server.log").read_text()
        yield f"http://127.0.0.1:{port}"
    finally:
        server.send_signal(signal.SIGTERM)
        code = server.wait()
    assert code == 0, (folder / "server.log").read_text()


def _call(number: int) -> Run:
    def one(name: str, **more) -> Run:
        metrics = [("curve", float(step * number), step) for step in range(200)]
        data = [Data("mug", "data/raw/mug", str(number) * 64, "raw")]
        params = {f"key.{index}": index * number for index in range(150)}
        tags = {"kind": "stage", "writer": str(number)}
        return Run(name, 100.0, 101.0, tags=tags, params=params, metrics=metrics, data=data, **more)

    return one(
        f"call {number}",
        nested=[one(f"{number} {index}") for index in range(NESTED)],
        texts={"a.txt": "said"},
    )


def _write(number: int) -> bool:
    return Recorder("team").call(_call(number))


@pytest.mark.timeout(300)
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_eight_write_at_once_and_nothing_is_lost(folder, monkeypatch):
    with _served(folder) as uri:
        monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
        client(uri)  # imported once, before the fork
        with multiprocessing.get_context("fork").Pool(WRITERS) as pool:
            assert pool.map(_write, range(WRITERS), chunksize=1) == [True] * WRITERS
        _check(client(uri))
    with _served(folder) as uri:
        monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
        assert not _write(3)  # it is there
        _check(client(uri))
    assert not list((folder / "team/postgres").glob("postmaster.pid"))


def _check(store) -> None:
    runs = store.search_runs([store.get_experiment_by_name("team").experiment_id])
    names = {f"call {number}" for number in range(WRITERS)}
    names |= {f"{number} {index}" for number in range(WRITERS) for index in range(NESTED)}
    assert sorted(run.info.run_name for run in runs) == sorted(names)
    for run in runs:
        number = int(run.data.tags["writer"])
        assert run.info.status == "FINISHED"
        assert run.data.params == {f"key.{index}": str(index * number) for index in range(150)}
        curve = store.get_metric_history(run.info.run_id, "curve")
        assert [(point.step, point.value) for point in sorted(curve, key=lambda point: point.step)] == [
            (step, float(step * number)) for step in range(200)
        ]
        (item,) = run.inputs.dataset_inputs
        assert json.loads(item.dataset.profile)["sha256"] == str(number) * 64


def test_a_folder_that_cannot_be_used_is_named(tmp_path):
    (tmp_path / "team").write_text("a file")
    words = ["--folder", str(tmp_path / "team/inner")]
    told = subprocess.run(
        [sys.executable, "-m", "pipeline.track.server", *words], capture_output=True, text=True
    )
    assert told.returncode == 1
    assert told.stderr.startswith(f"error: {tmp_path}/team/inner")
    assert told.stderr.count("\n") == 1
