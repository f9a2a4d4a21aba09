"""The logged classifiers say what the fitted ones say: loaded, and served over HTTP."""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from dataclasses import replace

import numpy as np
import pytest
from sklearn.base import clone
from track.calls import fitted

from pipeline.models import expanded
from pipeline.track.estimators import ensemble, example, pipeline_of, probabilities
from pipeline.track.store import client


def test_a_classifier_made_of_numbers_is_the_one_that_was_fitted():
    model, pipeline, table = fitted("mug", "standard", 0)
    assert np.allclose(pipeline_of(model).predict_proba(table), pipeline.predict_proba(table), atol=1e-12)
    assert (pipeline_of(model).predict(table) == pipeline.predict(table)).all()


def test_squares_and_products_come_in_the_same_order():
    model, _, table = fitted("mug", "standard", 0)
    quadratic = replace(model, terms="quadratic", weights=(0.3, -0.2, 0.5, 0.1, -0.7))
    assert expanded(np.ones((1, 2)), "quadratic").shape == (1, 5)
    assert np.allclose(
        pipeline_of(quadratic).predict_proba(table)[:, 1], quadratic.probability(table.to_numpy())
    )


def test_the_ensemble_is_the_mean_over_draws():
    models = [fitted("mug", "standard", draw)[0] for draw in range(3)]
    rows = example(models)
    mean = np.mean([model.probability(rows.to_numpy()) for model in models], axis=0)
    assert np.allclose(ensemble(models).predict_proba(rows)[:, 1], mean, atol=1e-12)
    assert np.allclose(ensemble(models).predict_proba(rows), probabilities(models, rows), atol=1e-12)


def test_the_ensemble_holds_each_fitted_classifier_once():
    voting = ensemble([fitted("mug", "standard", draw)[0] for draw in range(3)])
    templates = [one for _, one in voting.estimators]
    assert [hasattr(one[-1], "coef_") for one in (*templates, *voting.estimators_)] == [False] * 3 + [
        True
    ] * 3
    assert all(clone(one)[-1].C == one[-1].C == 1.0 for one in templates)


def _run_id(folder, name: str) -> str:
    store = client(f"sqlite:///{folder}/mlflow.db")
    (run,) = store.search_runs([store.get_experiment_by_name("tried").experiment_id], f"run_name = '{name}'")
    return run.info.run_id


def test_it_is_loaded_with_signature_and_example(tracked, monkeypatch):
    import mlflow.sklearn

    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{tracked}/mlflow.db")
    mlflow.set_tracking_uri(f"sqlite:///{tracked}/mlflow.db")
    uri = f"runs:/{_run_id(tracked, 'pouring standard jug')}/classifier"
    loaded, about = mlflow.sklearn.load_model(uri), mlflow.models.get_model_info(uri)
    models = [fitted("jug", "standard", draw)[0] for draw in range(2)]
    rows = example(models)
    assert np.allclose(loaded.predict_proba(rows), ensemble(models).predict_proba(rows), atol=1e-12)
    assert about.signature.inputs.input_names() == ["tilt", "fill"]
    assert about.saved_input_example_info["type"] == "dataframe"
    size = sum(path.stat().st_size for path in (tracked / "mlartifacts/models").rglob("model.skops"))
    assert size < 4 * 20_000


def _ask(port: int, table) -> list:
    body = json.dumps({"dataframe_split": table.to_dict(orient="split", index=False)}).encode()
    url, head = f"http://127.0.0.1:{port}/invocations", {"Content-Type": "application/json"}
    with urllib.request.urlopen(urllib.request.Request(url, body, head), timeout=30) as answer:
        return json.load(answer)["predictions"]


@pytest.mark.timeout(180)
def test_it_is_served(tracked):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    uri = f"runs:/{_run_id(tracked, 'pouring label_mapping mug')}/classifier"
    words = [
        "models",
        "serve",
        "--model-uri",
        uri,
        "--port",
        str(port),
        "--env-manager",
        "local",
        "--workers",
        "1",
    ]
    # As with the environment active: MLflow starts uvicorn by its name.
    path = os.pathsep.join([os.path.dirname(sys.executable), os.environ["PATH"]])
    server = subprocess.Popen(
        [sys.executable, "-m", "mlflow", *words],
        **{"env": os.environ | {"MLFLOW_TRACKING_URI": f"sqlite:///{tracked}/mlflow.db", "PATH": path}},
        **{"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "start_new_session": True},
    )
    models = [fitted("mug", "label_mapping", draw)[0] for draw in range(2)]
    rows, answer = example(models), None
    try:
        while answer is None and server.poll() is None:
            try:
                answer = _ask(port, rows)
            except urllib.error.URLError:
                time.sleep(0.5)
        assert answer is not None, f"the server ended with {server.returncode}"
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(server.pid, signal.SIGTERM)
        server.wait()
    assert np.allclose(answer, ensemble(models).predict_proba(rows), atol=1e-9)
