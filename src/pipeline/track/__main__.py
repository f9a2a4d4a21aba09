"""Record a call of the workflow in MLflow: `start` prepares the store, `end` writes the runs. Neither ever fails the call."""

import argparse
import time
from datetime import datetime
from pathlib import Path

from pipeline.command import parser, say
from pipeline.track import facts


def main() -> None:
    """Do what the command line says; a mistake becomes one warning."""
    arguments = _arguments()
    try:
        arguments.do(arguments)
    except Exception as error:  # whatever the store throws, the results are there
        reason = " ".join(str(error).split())[:300] or type(error).__name__
        say(
            f"warning: track: expected to record this call in MLflow, found: {reason}; the results are not affected"
        )


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
    return options.parse_args()


def _start(_: argparse.Namespace) -> None:
    from pipeline.track.store import prepare

    prepare()


def _end(arguments: argparse.Namespace) -> None:
    from pipeline.artefacts import read_json
    from pipeline.track.store import Recorder, prepare

    prepare()
    config = read_json(arguments.config)
    recorder = Recorder(config["track"]["experiment"])
    status = "FINISHED" if arguments.status == "success" else "FAILED"
    commit = facts.commit()
    begun = datetime.fromtimestamp(arguments.since).strftime("%Y-%m-%d %H:%M:%S")
    parent = recorder.run(
        f"call {begun}", start_s=arguments.since, tags={**commit, "status": arguments.status}
    )
    try:
        _record_call(recorder, parent, arguments, config)
        _record_experiments(recorder, parent, arguments, facts.flatten(config), commit)
        recorder.end(parent, status)
    except BaseException:
        recorder.end(parent, "FAILED")
        raise


def _record_call(recorder, parent: str, arguments: argparse.Namespace, config: dict) -> None:
    digests = {name: facts.digest(Path(arguments.raw) / name) for name in arguments.objects}
    spent = facts.seconds(arguments.benchmarks, arguments.since)
    metrics = facts.headline(arguments.reports, arguments.since)
    metrics |= {f"seconds.{stage}": value for stage, value in spent.items()}
    metrics["seconds.call"] = time.time() - arguments.since
    params = facts.flatten(config) | {"objects": " ".join(arguments.objects)}
    params |= {f"data.{name}.sha256": value for name, value in digests.items()}
    recorder.record(parent, params=params, metrics=metrics)
    recorder.inputs(parent, digests, arguments.raw)
    figures = [Path(arguments.reports) / name for name in ("roc.pdf", "metrics.json")]
    made = [path for path in figures if facts.made(path, arguments.since)]
    recorder.files(parent, *made, arguments.config, *arguments.log)


def _record_experiments(
    recorder, parent: str, arguments: argparse.Namespace, config: dict, commit: dict
) -> None:
    for experiment, scores in facts.experiments(
        arguments.processed, arguments.reports, arguments.since
    ).items():
        used = {
            key: value
            for key, value in config.items()
            if key.startswith(("classify.", f"simulate.{experiment}."))
        }
        for features, metrics in facts.score_means(scores).items():
            name = f"{experiment} {features}"
            tags = {**commit, "experiment": experiment, "features": features}
            run = recorder.run(name, parent=parent, start_s=arguments.since, tags=tags)
            recorder.record(
                run, params={"experiment": experiment, "features": features, **used}, metrics=metrics
            )
            recorder.end(run, "FINISHED")


if __name__ == "__main__":
    main()
