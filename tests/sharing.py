"""What one process that tests has made is there for all of them."""

import fcntl
import os
import pickle
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

import pytest

T = TypeVar("T")


def shared_folder(factory: pytest.TempPathFactory) -> Path:
    """Return a folder of this session that all processes that test have in common."""
    base = factory.getbasetemp()
    return base.parent if "PYTEST_XDIST_WORKER" in os.environ else base


@contextmanager
def alone(folder: Path, name: str) -> Iterator[None]:
    """Let one process at a time do something; who comes second waits."""
    with (folder / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # until it is closed
        yield


def made_once(factory: pytest.TempPathFactory, name: str, make: Callable[[], T]) -> T:
    """Return a copy of what `make` returns, which is called by the first process that asks for the name."""
    folder = shared_folder(factory)
    made = folder / f"{name}.pickle"
    with alone(folder, name):
        if not made.exists():
            half = made.with_suffix(".half")
            half.write_bytes(pickle.dumps(make()))
            half.rename(made)
    return pickle.loads(made.read_bytes())
