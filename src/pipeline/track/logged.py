"""Fitted classifiers in MLflow: one model a run, with signature and example, in a format that holds no code."""

import shutil
import tempfile
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from functools import cache
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from pipeline.models import chosen, read_models
from pipeline.track.estimators import ensemble, example, packed
from pipeline.track.runs import Classifiers, File

NAME = "classifier"
REQUIRED = ("mlflow", "scikit-learn", "skops", "numpy", "pandas")

Packages = dict[Classifiers, Future[bytes]]


@contextmanager
def packing(wanted: Iterable[Classifiers]) -> Iterator[Packages]:
    """Have classifiers packed in a process beside this one, which waits for the store meanwhile."""
    with ProcessPoolExecutor(1, get_context("spawn")) as beside:
        yield {classifiers: beside.submit(_packed, classifiers) for classifiers in wanted}


def log_classifiers(
    client: Any, experiment_id: str, run_id: str, classifiers: Classifiers, package: Future[bytes]
) -> None:
    """Log the classifiers of a run as the model `runs:/<run>/classifier`; `package` is what `packing` makes of them.

    The steps are those of `mlflow.sklearn.log_model`, which wants an active run and packs without compression (1.4 MB, not 0.1).
    """
    from mlflow.entities import LoggedModelOutput
    from mlflow.models import Model

    params = {"features": classifiers.features, "training_object": classifiers.training_object}
    entry = client.create_logged_model(experiment_id, NAME, source_run_id=run_id, params=params)
    about = Model(
        artifact_path=entry.artifact_location,
        model_uuid=entry.model_id,
        run_id=run_id,
        model_id=entry.model_id,
    )
    folder = Path(tempfile.mkdtemp())
    try:
        _save(folder / NAME, about, _chosen(classifiers))
        (folder / NAME / "model.skops").write_bytes(package.result())
        client.log_model_artifacts(entry.model_id, str(folder / NAME))
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    client.finalize_logged_model(entry.model_id, "READY")
    client.log_outputs(run_id, [LoggedModelOutput(entry.model_id, step=0)])


@cache
def _models(file: File) -> list[Any]:
    return read_models(file.path)


def _chosen(classifiers: Classifiers) -> list[Any]:
    return chosen(_models(classifiers.file), classifiers.features, classifiers.training_object)


def _packed(classifiers: Classifiers) -> bytes:
    return packed(_chosen(classifiers))


def _save(folder: Path, about: Any, models: list[Any]) -> None:
    """Save the first of them with what describes them all."""
    import mlflow.sklearn
    from mlflow.models import infer_signature

    first, rows = ensemble(models[:1]), example(models)
    mlflow.sklearn.save_model(
        first,
        str(folder),
        mlflow_model=about,
        signature=infer_signature(rows, first.predict_proba(rows)),
        input_example=rows,
        pip_requirements=[f"{name}=={version(name)}" for name in REQUIRED],
        serialization_format="skops",
        pyfunc_predict_fn="predict_proba",
    )
