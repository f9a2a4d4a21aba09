"""The MLflow store: prepared once, then one parent run a call with nested runs. The only importer of mlflow."""

import logging
import os
import sqlite3
import time
import warnings
from pathlib import Path
from typing import Any

DEFAULT_DATABASE = "mlflow.db"
ARTIFACTS = "mlartifacts"
# Quiet, and a server that cannot be reached is given up after seconds, not minutes.
_ENVIRONMENT = {
    "MLFLOW_DISABLE_TELEMETRY": "true",
    "GIT_PYTHON_REFRESH": "quiet",
    "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "1",
    "MLFLOW_HTTP_REQUEST_TIMEOUT": "20",
}
BATCH = 100  # parameters and tags in one request, MLflow's own limit


def tracking_uri() -> str:
    """Return MLFLOW_TRACKING_URI, or the SQLite file of the working folder."""
    return os.environ.get("MLFLOW_TRACKING_URI") or f"sqlite:///{Path(DEFAULT_DATABASE).resolve()}"


def prepare() -> None:
    """Make a fresh SQLite store under another name and put it in place whole; does nothing when there is one.

    Processes that open a fresh store at the same time can leave it broken for ever.
    """
    uri = tracking_uri()
    path = Path(uri.removeprefix("sqlite:///"))
    if not uri.startswith("sqlite:///") or path.exists():
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        client(f"sqlite:///{temporary.resolve()}").search_experiments()
        _settle(temporary)
        _put(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def _put(temporary: Path, path: Path) -> None:
    try:
        os.link(temporary, path)
    except FileExistsError:  # another call was faster, and may have written runs
        pass
    except OSError:  # a file system without links
        if not path.exists():
            temporary.rename(path)


def _settle(database: Path) -> None:
    with sqlite3.connect(database) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    connection.close()


def client(uri: str) -> Any:
    """Return a quiet MLflow client of the store at `uri`."""
    for key, value in _ENVIRONMENT.items():
        os.environ.setdefault(key, value)
    warnings.filterwarnings("ignore")
    for name in ("mlflow", "alembic"):
        logging.getLogger(name).setLevel(logging.ERROR)
    import mlflow

    for name in ("mlflow", "alembic"):
        logging.getLogger(name).setLevel(logging.ERROR)
    return mlflow.MlflowClient(tracking_uri=uri)


class Recorder:
    """Writes the runs of one call into one experiment."""

    def __init__(self, experiment: str) -> None:
        """Open the store and take the experiment of this name, made when it is not there."""
        self.client = client(tracking_uri())
        found = self.client.get_experiment_by_name(experiment)
        self.experiment_id = found.experiment_id if found else self._create(experiment)

    def run(self, name: str, *, parent: str | None = None, start_s: float, tags: dict[str, str]) -> str:
        """Begin a run, nested when `parent` is the id of another; return its id."""
        nested = {"mlflow.parentRunId": parent} if parent else {}
        run = self.client.create_run(
            self.experiment_id, start_time=int(start_s * 1000), run_name=name, tags={**tags, **nested}
        )
        return run.info.run_id

    def record(self, run_id: str, *, params: dict[str, Any], metrics: dict[str, float]) -> None:
        """Write parameters and metrics of a run in as few requests as the store takes."""
        from mlflow.entities import Metric, Param

        now_ms = int(time.time() * 1000)
        rows = [Param(key, str(value)) for key, value in params.items()]
        values = [Metric(key, value, now_ms, 0) for key, value in metrics.items()]
        for start in range(0, max(len(rows), 1), BATCH):
            self.client.log_batch(
                run_id, params=rows[start : start + BATCH], metrics=values if start == 0 else ()
            )

    def inputs(self, run_id: str, digests: dict[str, str], folder: str) -> None:
        """Attach data sets to a run: name → SHA-256, of which MLflow's own field keeps the first 36 characters."""
        from mlflow.entities import Dataset, DatasetInput

        inputs = [
            DatasetInput(Dataset(name, digest[:36], "local", f"{folder}/{name}"), [])
            for name, digest in digests.items()
        ]
        self.client.log_inputs(run_id, inputs)

    def files(self, run_id: str, *paths: str | Path) -> None:
        """Attach those of the files that are there."""
        for path in filter(os.path.isfile, paths):
            self.client.log_artifact(run_id, str(path))

    def end(self, run_id: str, status: str) -> None:
        """Close a run as FINISHED or FAILED."""
        self.client.set_terminated(run_id, status)

    def _create(self, experiment: str) -> str:
        # A server decides by itself where artifacts go; beside a local database they are in the project's folder.
        local = Path(ARTIFACTS).resolve().as_uri() if tracking_uri().startswith("sqlite:") else None
        return self.client.create_experiment(experiment, artifact_location=local)
