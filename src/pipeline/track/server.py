"""A team's MLflow: a server on PostgreSQL in one folder, until it is interrupted. Others set MLFLOW_TRACKING_URI to its address."""

import argparse
import os
import signal
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from types import FrameType

from pipeline.command import parser, run, say
from pipeline.errors import PipelineError
from pipeline.track.postgres import Cluster


def main() -> None:
    """Start the database and the server, and stop both when told to."""
    options = _options()
    if find_spec("psycopg2") is None:
        raise PipelineError(
            "MLflow on PostgreSQL: expected the package psycopg2, found none; run: pip install psycopg2-binary"
        )
    signal.signal(signal.SIGTERM, _interrupt)
    with Cluster(options.folder) as database:
        server = subprocess.Popen(
            _command(options, database), env=_environment(options), start_new_session=True
        )
        say(f"MLflow: http://{options.host}:{options.port}, data in {options.folder}; Ctrl-C ends it")
        try:
            code = server.wait()
        except KeyboardInterrupt:
            code = 0
        finally:
            _stop(server)
    if code:
        raise PipelineError(
            f"MLflow: expected a server on {options.host}:{options.port}, found that it ended with code {code}; "
            "is the port in use? --port takes another"
        )


def _options() -> argparse.Namespace:
    options = parser(__doc__)
    options.add_argument("--folder", type=Path, default=Path("mlserver"), help="database and artifacts")
    options.add_argument("--host", default="127.0.0.1", help="address to listen on, 0.0.0.0 for a network")
    options.add_argument("--port", type=int, default=5000)
    options.add_argument("--workers", type=int, default=2, help="processes that answer")
    options.add_argument(
        "--allowed-hosts", default="localhost:*,127.0.0.1:*", help="names under which others reach it"
    )
    return options.parse_args()


def _command(options: argparse.Namespace, database: str) -> list[str]:
    artifacts = (options.folder / "artifacts").resolve()
    return [
        *(sys.executable, "-m", "mlflow", "server", "--backend-store-uri", database),
        *("--artifacts-destination", str(artifacts), "--host", options.host, "--port", str(options.port)),
        *("--workers", str(options.workers), "--allowed-hosts", options.allowed_hosts),
    ]


def _environment(options: argparse.Namespace) -> dict[str, str]:
    """Return the environment without what only language models need: half of the memory, a quarter of the start."""
    off = {"MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false", "MLFLOW_DISABLE_TELEMETRY": "true"}
    return {key: value for key, value in os.environ.items() if key != "MLFLOW_TRACKING_URI"} | off


def _interrupt(_: int, __: FrameType | None) -> None:
    raise KeyboardInterrupt


def _stop(server: subprocess.Popen) -> None:
    """End the server with its workers; then nobody uses the database."""
    try:
        os.killpg(server.pid, signal.SIGTERM)
        server.wait(timeout=15)
    except ProcessLookupError:
        pass
    except subprocess.TimeoutExpired:
        os.killpg(server.pid, signal.SIGKILL)
        server.wait()


if __name__ == "__main__":
    run(main)
