"""Fitted classifiers in MLflow: one model a run, with signature and example, in a format that holds no code."""

import shutil
import tempfile
import zipfile
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from pipeline.models import chosen, read_models
from pipeline.track.estimators import ensemble, example, probabilities
from pipeline.track.runs import Classifiers, File

NAME = "classifier"
REQUIRED = ("mlflow", "scikit-learn", "skops", "numpy", "pandas")


def log_classifiers(client: Any, experiment_id: str, run_id: str, classifiers: Classifiers) -> None:
    """Log the classifiers of a run as the model `runs:/<run>/classifier`.

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
        _save(folder / NAME, about, classifiers)
        client.log_model_artifacts(entry.model_id, str(folder / NAME))
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    client.finalize_logged_model(entry.model_id, "READY")
    client.log_outputs(run_id, [LoggedModelOutput(entry.model_id, step=0)])


@cache
def _models(file: File) -> list[Any]:
    return read_models(file.path)


def _save(folder: Path, about: Any, classifiers: Classifiers) -> None:
    import mlflow.sklearn
    import skops.io
    from mlflow.models import infer_signature

    models = chosen(_models(classifiers.file), classifiers.features, classifiers.training_object)
    rows = example(models)
    mlflow.sklearn.save_model(
        ensemble(models[:1]),  # only what describes it is kept: packing all of them takes ten times as long
        str(folder),
        mlflow_model=about,
        signature=infer_signature(rows, probabilities(models, rows)),
        input_example=rows,
        pip_requirements=[f"{name}=={version(name)}" for name in REQUIRED],
        serialization_format="skops",
        pyfunc_predict_fn="predict_proba",
    )
    # The least compression is a tenth larger and takes half as long.
    packed = {"compression": zipfile.ZIP_DEFLATED, "compresslevel": 1}
    skops.io.dump(ensemble(models), folder / "model.skops", **packed)
