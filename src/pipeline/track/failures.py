"""Which jobs of a call failed, read off Snakemake's log, and what their own logs say."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

# "Error in rule fuse:", then indented lines, of which "log: a.log, b.log (check log file(s) for error details)" is one.
_FAILED = re.compile(r"^Error in rule (?P<rule>\w+):\n(?P<body>(?:    .*\n)*)", re.MULTILINE)
_LOGS = re.compile(r"^    log: (?P<logs>.*?)(?: \(check log file.*)?$", re.MULTILINE)
# A line of `command.progress` or `command.steps`: no reason why a job ended.
_PROGRESS = re.compile(r".*\((?:[\d.]+/s, \d+ s left|step \d+ of \d+, \d+ s so far)\)")
_STOPPED = "Terminating processes on user request"
LONGEST_CHARACTERS = 65536


@dataclass(frozen=True)
class Failure:
    """A job that failed: its rule, its own logs and the last line of them that says why."""

    rule: str
    logs: tuple[str, ...]
    reason: str

    @property
    def stage(self) -> str:
        """Return the stage: its logs are in logs/<stage>/."""
        parts = Path(self.logs[0]).parts if self.logs else ()
        return parts[1] if len(parts) > 2 and parts[0] == "logs" else self.rule


def failures(snakemake_logs: Iterable[str | Path]) -> list[Failure]:
    """Return the jobs that failed, each once, in the order in which they did; those that a retry mended count as well."""
    found: dict[tuple[str, tuple[str, ...]], Failure] = {}
    for path in snakemake_logs:
        for match in _FAILED.finditer(text(path)):
            listed = _LOGS.search(match["body"])
            logs = tuple(listed["logs"].split(", ")) if listed else ()
            found[match["rule"], logs] = Failure(match["rule"], logs, _reason(logs))
    return list(found.values())


def stopped(snakemake_logs: Iterable[str | Path]) -> bool:
    """Return whether a call ended because its user wanted it to (Ctrl-C): then it is no news that jobs failed."""
    return any(_STOPPED in text(path) for path in snakemake_logs)


def text(path: str | Path) -> str:
    """Return the end of a log; nothing, when there is none."""
    try:
        return Path(path).read_text(errors="replace")[-LONGEST_CHARACTERS:]
    except OSError:
        return ""


def _reason(logs: tuple[str, ...]) -> str:
    lines = [line.strip() for path in logs for line in text(path).splitlines() if line.strip()]
    said = [line for line in lines if line.startswith("error: ")]
    reason = (said or lines or [""])[-1]
    if not reason:
        return "ended without a word, as when it is killed"
    if _PROGRESS.fullmatch(reason):
        return f"ended without an error, as when it is killed, after: {reason}"
    return reason
