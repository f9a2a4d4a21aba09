"""Record calls of the workflow in MLflow: `start` prepares the store, `end` writes a call, `again` all calls that it lacks.

`start` and `end` are called by the workflow and never fail it. `again` is for a store that was lost or could not be reached.
"""

import argparse
import sys
import time
from pathlib import Path

from pipeline.command import parser, run, say
from pipeline.errors import PipelineError


def main() -> None:
    """Do what the command line says; only `again` can fail."""
    arguments = _arguments()
    if arguments.do is _again:
        run(lambda: _again(arguments))
        return
    try:
        arguments.do(arguments)
    except Exception as error:  # whatever the store throws, the results are there
        say(
            f"warning: track: expected to record this call in MLflow, found: {_reason(error)}; {_CONSOLATION}"
        )


_CONSOLATION = (
    "the results are not affected; `python -m pipeline.track again` records it when the store is back"
)


def _reason(error: Exception) -> str:
    return " ".join(str(error).split())[:300] or type(error).__name__


def _arguments() -> argparse.Namespace:
    options = parser(__doc__)
    commands = options.add_subparsers(required=True)
    start = commands.add_parser("start", help="prepare the store")
    start.set_defaults(do=_start)
    end = commands.add_parser("end", help="record a finished call")
    end.add_argument("--status", choices=["success", "failed"], required=True, help="how the call ended")
    end.add_argument("--since", type=float, required=True, help="when the call began, in seconds since 1970")
    end.add_argument("--log", nargs="*", default=[], help="Snakemake's logs of the call")
    end.add_argument("--config", required=True, help="the merged configuration as JSON")
    for name in ("raw", "processed", "reports", "benchmarks"):
        end.add_argument(f"--{name}", required=True, help=f"the folder {name}")
    end.add_argument("--objects", nargs="+", required=True, help="the objects that take part")
    end.set_defaults(do=_end)
    again = commands.add_parser("again", help="record the calls of logs/track/calls that the store lacks")
    again.set_defaults(do=_again)
    return options.parse_args()


def _start(_: argparse.Namespace) -> None:
    from pipeline.track.store import prepare

    prepare()


def _end(arguments: argparse.Namespace) -> None:
    from pipeline.artefacts import read_json
    from pipeline.track import ledger
    from pipeline.track.call import Call, call_run

    folders = {name: getattr(arguments, name) for name in ("raw", "processed", "reports", "benchmarks")}
    call = Call(
        status=arguments.status,
        since_s=arguments.since,
        until_s=time.time(),
        logs=tuple(arguments.log),
        config=read_json(arguments.config),
        objects=tuple(arguments.objects),
        **folders,
    )
    written = call_run(call)
    ledger.keep(written)
    from pipeline.track.store import Recorder, prepare

    prepare()
    Recorder(call.config["track"]["experiment"]).call(written)


def _again(_: argparse.Namespace) -> None:
    from pipeline.track import ledger

    if not ledger.kept():
        raise PipelineError(
            f"{ledger.CALLS}: expected the records of earlier calls, found none; run the workflow in {Path.cwd()} first"
        )
    from pipeline.track.store import Recorder, prepare, tracking_uri

    try:
        prepare()
        written = [Recorder(call.params["track.experiment"]).call(call) for call in ledger.calls()]
    except PipelineError:
        raise
    except Exception as error:
        raise PipelineError(
            f"{tracking_uri()}: expected a store of MLflow, found: {_reason(error)}; "
            "start it, or set MLFLOW_TRACKING_URI"
        ) from error
    sys.stdout.write(f"{sum(written)} calls recorded, {len(written) - sum(written)} were there already\n")


if __name__ == "__main__":
    main()
