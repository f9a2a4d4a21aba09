"""What there is to record about a call of the workflow: read from its files, knows nothing of MLflow."""

import getpass
import hashlib
import os
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pipeline.artefacts import read_json

FIGURES = (".pdf", ".png", ".svg", ".html", ".json", ".gif", ".mp4")


def flatten(tree: dict, prefix: str = "") -> dict[str, Any]:
    """Return nested `tree` as one level with dotted keys; lists become words with spaces between."""
    flat: dict[str, Any] = {}
    for key, value in tree.items():
        name = f"{prefix}{key}"
        if isinstance(value, dict):
            flat |= flatten(value, f"{name}.")
        else:
            flat[name] = " ".join(map(str, value)) if isinstance(value, list) else value
    return flat


def sha256(path: str | Path) -> str:
    """Return the SHA-256 of a file."""
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def digest(folder: str | Path) -> str:
    """Return the SHA-256 over names and contents of all files below `folder`; hidden ones are left out."""
    total = hashlib.sha256()
    for path in sorted(_files(Path(folder))):
        total.update(f"{path.relative_to(folder).as_posix()} {sha256(path)}\n".encode())
    return total.hexdigest()


def _files(folder: Path) -> Iterator[Path]:
    for parent, folders, names in os.walk(folder, followlinks=True):
        folders[:] = [name for name in folders if not name.startswith(".")]
        yield from (Path(parent, name) for name in names if not name.startswith("."))


def commit() -> dict[str, str]:
    """Return commit and whether files differ from it (`git.commit`, `git.dirty`), or `unknown` outside a repository."""
    try:
        head = _git("rev-parse", "HEAD")
        return {"git.commit": head, "git.dirty": str(bool(_git("status", "--porcelain"))).lower()}
    except (OSError, subprocess.CalledProcessError):
        return {"git.commit": "unknown", "git.dirty": "unknown"}


def _git(*arguments: str) -> str:
    return subprocess.run(["git", *arguments], capture_output=True, text=True, check=True).stdout.strip()


def who() -> dict[str, str]:
    """Return who called and from which folder of which machine (`user`, `workspace`)."""
    try:
        user = getpass.getuser()
    except (OSError, KeyError):  # a user without a name, as in containers
        user = str(os.getuid())
    return {"user": user, "workspace": f"{socket.gethostname()}:{Path.cwd()}"}


def made(path: str | Path, since_s: float) -> bool:
    """Return whether the file is there and was written at or after `since_s` (seconds since 1970)."""
    return Path(path).is_file() and Path(path).stat().st_mtime >= since_s


def reported(reports: str | Path, since_s: float) -> list[Path]:
    """Return the figures, pages and numbers below `reports` that this call made."""
    return [
        path
        for path in sorted(_files(Path(reports)))
        if path.suffix in FIGURES and path.stat().st_mtime >= since_s
    ]


def headline(reports: str | Path, since_s: float) -> dict[str, float]:
    """Return the numbers of `metrics.json`, when this call made it."""
    path = Path(reports) / "metrics.json"
    numbers = read_json(path) if made(path, since_s) else {}
    return {key: float(value) for key, value in numbers.items() if isinstance(value, int | float)}
