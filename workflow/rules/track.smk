# Needs what a call of Snakemake left behind: outputs, benchmarks, Snakemake's own log.
# Makes the call's runs in MLflow (default: mlflow.db, mlartifacts/) and logs/track/calls/, what was said of each call; no rule depends on them.
# How: called by the Snakefile's handlers, once beside the first job and once after the last; it never fails a call.

import json
from pathlib import Path


def track_start():
    """Return the command that prepares the store, while the first jobs run: a fresh one takes seconds."""
    return "(python -m pipeline.track start || true) &" if config["track"]["enabled"] else "true"


def track_end(status, log):
    """Return the command that records a finished call; `status` is success or failed, `log` Snakemake's log files."""
    if not config["track"]["enabled"]:
        return "true"
    resolved = Path("logs/track/config.json")
    resolved.parent.mkdir(parents=True, exist_ok=True)
    resolved.write_text(json.dumps(config, indent=2, sort_keys=True))
    return (
        f"python -m pipeline.track end --status {status} --since {STARTED_S} --log {' '.join(map(shlex.quote, log))} --config {resolved}"
        f" --raw {RAW} --processed {PROCESSED} --reports {REPORTS} --benchmarks benchmarks --objects {' '.join(OBJECTS)} || true"
    )
