"""The MLflow store: prepared once, then one parent run a call with nested runs. The only importer of mlflow."""

import json
import logging
import os
import sqlite3
import warnings
from pathlib import Path
from typing import Any

from pipeline.command import progress
from pipeline.track.facts import sha256
from pipeline.track.logged import log_classifiers
from pipeline.track.runs import Data, File, Run, digest_of

DEFAULT_DATABASE = "mlflow.db"
ARTIFACTS = "mlartifacts"
# Quiet, and a server that cannot be reached is given up after seconds, not minutes.
_ENVIRONMENT = {
    "MLFLOW_DISABLE_TELEMETRY": "true",
    "GIT_PYTHON_REFRESH": "quiet",
    "MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT": "true",
    "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "1",
    "MLFLOW_HTTP_REQUEST_TIMEOUT": "20",
}
PARAMS, METRICS = 100, 900  # in one request: MLflow takes 1,000 in all
TAG_CHARACTERS = 5000
# Arrow's types in MLflow's words.
_TYPES = {"double": "double", "float": "float", "int64": "long", "bool": "boolean"}


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
    """Writes calls into one experiment."""

    def __init__(self, experiment: str) -> None:
        """Open the store and take the experiment of this name, made when it is not there."""
        self.client = client(tracking_uri())
        self.experiment_id = self._experiment(experiment)

    def call(self, call: Run) -> bool:
        """Write a call with all its nested runs; a call that the store has whole is left alone. Return whether it was written."""
        digest = digest_of(call)
        for run in self._found(f"tags.`call.digest` = '{digest}'"):
            if run.info.status != "RUNNING":
                return False
            self._forget(run.info.run_id)  # its writer was stopped on the way
        call_id = self._begin(call, {"call.digest": digest})
        known = {run.data.tags["fingerprint"] for run in self._known(call)}
        fresh = [run for run in call.nested if not run.fingerprint or run.fingerprint not in known]
        for run in progress(fresh, len(fresh), "track: runs"):
            self._end(self._begin(run, {"mlflow.parentRunId": call_id}), run)
        self._end(call_id, call)
        return True

    def _begin(self, run: Run, tags: dict[str, str]) -> str:
        """Begin a run and write all that it says; return its id."""
        tags = {**run.tags, **tags, **_system_tags(run)}
        info = self.client.create_run(
            self.experiment_id, start_time=int(run.begun_s * 1000), run_name=run.name, tags=tags
        ).info
        self._record(info.run_id, run)
        self._inputs(info.run_id, run)
        self._attach(info.run_id, run)
        return info.run_id

    def _end(self, run_id: str, run: Run) -> None:
        self.client.set_terminated(run_id, run.status, end_time=int(run.ended_s * 1000))

    def _record(self, run_id: str, run: Run) -> None:
        """Write parameters and metrics in as few requests as the store takes."""
        from mlflow.entities import Metric, Param

        written_ms = int(run.ended_s * 1000)
        params = [Param(key, str(value)) for key, value in run.params.items()]
        metrics = [Metric(key, value, written_ms, step) for key, value, step in run.metrics]
        while params or metrics:
            self.client.log_batch(run_id, params=params[:PARAMS], metrics=metrics[:METRICS])
            params, metrics = params[PARAMS:], metrics[METRICS:]

    def _inputs(self, run_id: str, run: Run) -> None:
        from mlflow.entities import Dataset, DatasetInput, InputTag

        inputs = [
            DatasetInput(Dataset(**_dataset(item)), [InputTag("mlflow.data.context", item.context)])
            for item in run.data
        ]
        if inputs:
            self.client.log_inputs(run_id, inputs)

    def _attach(self, run_id: str, run: Run) -> None:
        """Attach texts, files and classifiers; a file that is not what it was is named in a tag instead."""
        for name, text in run.texts.items():
            self.client.log_text(run_id, text, name)
        changed = [file.path for file in run.files if not _is_same(file)]
        for file in run.files:
            if file.path not in changed:
                self.client.log_artifact(run_id, file.path, file.folder)
        if run.classifiers and _is_same(run.classifiers.file):
            log_classifiers(self.client, self.experiment_id, run_id, run.classifiers)
        elif run.classifiers:
            changed.append(run.classifiers.file.path)
        if changed:
            self.client.set_tag(run_id, "changed_since", " ".join(changed)[:TAG_CHARACTERS])

    def _known(self, call: Run) -> list[Any]:
        """Return the runs of this workspace that are written once."""
        where = _quoted(call.tags.get("workspace", ""))
        kinds = ("classifier", "execution")
        return [
            run for kind in kinds for run in self._found(f"tags.kind = '{kind}' AND tags.workspace = {where}")
        ]

    def _found(self, condition: str) -> list[Any]:
        found, token = [], None
        while True:
            page = self.client.search_runs(
                [self.experiment_id], condition, max_results=1000, page_token=token
            )
            found += page
            token = page.token
            if not token:
                return found

    def _forget(self, call_id: str) -> None:
        for run in self._found(f"tags.`mlflow.parentRunId` = '{call_id}'"):
            self.client.delete_run(run.info.run_id)
        self.client.delete_run(call_id)

    def _experiment(self, name: str) -> str:
        from mlflow.exceptions import MlflowException

        found = self.client.get_experiment_by_name(name)
        if found:
            return found.experiment_id
        # A server decides by itself where artifacts go; beside a local database they are in the project's folder.
        local = Path(ARTIFACTS).resolve().as_uri() if tracking_uri().startswith("sqlite:") else None
        try:
            return self.client.create_experiment(name, artifact_location=local)
        except MlflowException:  # another call was faster
            found = self.client.get_experiment_by_name(name)
            if not found:
                raise
            return found.experiment_id


def _system_tags(run: Run) -> dict[str, str]:
    """Return what MLflow's own pages show of a run: who, from where, which commit."""
    given = {"mlflow.source.git.commit": "git.commit", "mlflow.user": "user"}
    tags = {name: run.tags[key] for name, key in given.items() if key in run.tags}
    tags |= {"mlflow.source.name": "Snakefile", "mlflow.source.type": "PROJECT"}
    return tags | ({"fingerprint": run.fingerprint} if run.fingerprint else {})


def _dataset(item: Data) -> dict[str, str]:
    """Return the fields of MLflow's data set; its digest holds 36 characters, so the whole one is in the profile."""
    columns = [{"name": name, "type": _TYPES.get(kind, "string")} for name, kind in item.columns.items()]
    profile = {"sha256": item.sha256} | ({"num_rows": item.rows} if item.columns else {})
    return {
        **{"name": item.name, "digest": item.sha256[:36], "source_type": "local"},
        "source": json.dumps({"uri": str(Path(item.path).resolve())}),
        "profile": json.dumps(profile),
        **({"schema": json.dumps({"mlflow_colspec": columns})} if columns else {}),
    }


def _is_same(file: File) -> bool:
    return os.path.isfile(file.path) and sha256(file.path) == file.sha256


def _quoted(text: str) -> str:
    return "'" + text.replace("'", "''") + "'"
