"""A folder as a call of the workflow leaves it, with classifiers that are really fitted, and the call itself."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler

from pipeline.artefacts import write_json, write_table
from pipeline.models import Model, write_models

CONFIG = {
    "classify": {"draws": 2, "ridge": 1.0},
    "simulate": {"pouring": {"trials": 80}},
    "fuse": {"voxel_m": 0.001},
    "track": {"experiment": "tried"},
}
OBJECTS = ("mug", "jug")
FEATURES = ("label_mapping", "standard")


def fitted(name: str, features: str, draw: int) -> tuple[Model, Pipeline, pd.DataFrame]:
    """Return a classifier as plain numbers, the same as scikit-learn fitted it, and what it was fitted to."""
    rng = np.random.default_rng([len(name), len(features), draw])
    table = pd.DataFrame(rng.normal([0.8, 0.5], [0.4, 0.3], (50, 2)), columns=["tilt", "fill"])
    labels = table["tilt"] + table["fill"] + rng.normal(0, 0.1, 50) > 1.3
    pipeline = make_pipeline(StandardScaler(), LogisticRegression()).fit(table, labels)
    scaler, regression = pipeline
    model = Model(
        **{"experiment": "pouring", "features": features, "training_object": name, "draw": draw},
        **{"feature_names": ("tilt", "fill"), "variables": ("tilt_rad", "fill_m3")},
        references=("held.tilt_reference_rad", "held.volume_m3"),
        mean=tuple(scaler.mean_.tolist()),
        std=tuple(scaler.scale_.tolist()),
        terms="linear",
        weights=tuple(regression.coef_[0].tolist()),
        intercept=float(regression.intercept_[0]),
        **{"training_objects": (name,), "samples": 50, "penalty": "ridge", "ridge": 1.0},
        **{"converged": True, "separable": False},
    )
    return model, pipeline, table


def _scores() -> pd.DataFrame:
    counts = {"n_test": 5, "n_positive": 2, "n_iterations": 3, "n_redrawn": 0}
    rates = {"tpr_at_fpr_00": 0.1, "tpr_at_fpr_01": 0.2, "tpr_at_fpr_05": 0.3, "brier": 0.05}
    return pd.DataFrame(
        {
            **{"experiment": "pouring", "features": features, "split": split, "training_object": name},
            **{"draw": draw, "auc": 0.8 + 0.1 * draw, "separable": draw == 0, "converged": True},
            **counts,
            **rates,
        }
        for features in (*FEATURES, "hydrostatic")
        for split in ("same", "novel")
        for name in OBJECTS
        for draw in range(1 if features == "hydrostatic" else 2)
    )


def _curves() -> pd.DataFrame:
    head = _scores()[["experiment", "features", "split", "training_object", "draw"]]
    fpr = pd.DataFrame({"fpr": [0.0, 0.5, 1.0]})
    curves = head.merge(fpr, how="cross")
    return curves.assign(tpr=curves["fpr"] ** (0.5 / (1 + curves["draw"])))


def _learning() -> pd.DataFrame:
    """Return areas of 0.7, 0.8, 0.9 with 10, 50, 500 trials; a resampled replicate has others."""
    scores = dict.fromkeys(("partial_auc", "tpr_at_fpr_00", "tpr_at_fpr_01", "tpr_at_fpr_05", "brier"), 0.1)
    return pd.DataFrame(
        {
            **{"experiment": "pouring", "features": "standard", "split": "novel", "samples": samples},
            **{"replicate": replicate, "auc": auc - 0.1 * replicate, **scores},
            **{"separable_share": 0.5, "converged_share": 1.0, "n_redrawn": 0},
        }
        for samples, auc in ((500, 0.9), (10, 0.7), (50, 0.8))
        for replicate in range(2)
    )


def leave(folder: Path) -> Path:
    """Fill `folder` with raw data, classifiers, figures, benchmarks and logs; return it."""
    for name in OBJECTS:
        (folder / "raw" / name).mkdir(parents=True)
        (folder / "raw" / name / "scan.ply").write_text(name)
        trials = folder / "processed/simulate/pouring" / name / "trials.parquet"
        trials.parent.mkdir(parents=True)
        pd.DataFrame({"trial": [0, 1], "tilt_rad": [0.1, 0.2 + len(name)]}).to_parquet(trials)
    made = folder / "processed/classify/pouring"
    write_table(made / "scores.parquet", _scores(), "scores")
    write_table(made / "curves.parquet", _curves(), "curves")
    write_table(made / "learning.parquet", _learning(), "learning")
    everyone = [fitted(name, set_, draw)[0] for name in OBJECTS for set_ in FEATURES for draw in range(2)]
    write_models(made / "models.json", everyone)
    (folder / "reports/scans").mkdir(parents=True)
    (folder / "reports/roc.pdf").write_bytes(b"%PDF")
    (folder / "reports/scans/mug.png").write_bytes(b"PNG")
    write_json(folder / "reports/metrics.json", {"simulate.pouring.leaked": 0})
    (folder / "benchmarks/fuse").mkdir(parents=True)
    for name, wall_s in zip(OBJECTS, (2.5, 4.0), strict=True):
        table = f"s\th:m:s\tmax_rss\tcpu_time\n{wall_s}\t0:00:02\t{100 * wall_s}\t1.5\n"
        (folder / f"benchmarks/fuse/{name}.tsv").write_text(table)
    (folder / "config.json").write_text(json.dumps(CONFIG))
    (folder / "call.log").write_text("a log")
    return folder


def track(folder: Path, *arguments: str, **environment: str) -> subprocess.Popen:
    """Start `python -m pipeline.track` in a folder, with the default store unless the environment names one."""
    kept = {key: value for key, value in os.environ.items() if key != "MLFLOW_TRACKING_URI"}
    return subprocess.Popen(
        [sys.executable, "-m", "pipeline.track", *arguments],
        **{"cwd": folder, "env": kept | environment, "text": True},
        **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE},
    )


def end(folder: Path, status: str, since_s: float, **environment: str) -> tuple[int, str, str]:
    """Record the end of a call as the workflow does; return what `told` does."""
    return told(start_end(folder, status, since_s, **environment))


def told(job: subprocess.Popen) -> tuple[int, str, str]:
    """Wait for a process; return exit code, stdout, and stderr without the progress that a busy machine is told of."""
    out, err = job.communicate()
    lines = [line for line in err.splitlines(keepends=True) if not line.startswith("track: runs")]
    return job.returncode, out, "".join(lines)


def start_end(folder: Path, status: str, since_s: float, **environment: str) -> subprocess.Popen:
    """Begin to record the end of a call."""
    folders = [word for name in ("raw", "processed", "reports", "benchmarks") for word in (f"--{name}", name)]
    return track(
        folder,
        *("end", "--status", status, "--since", str(since_s), "--log", "call.log", "--config", "config.json"),
        *(*folders, "--objects", *OBJECTS),
        **environment,
    )
