"""What a run is before it is written: plain data that a file can hold. Knows nothing of MLflow and reads nothing."""

import hashlib
import json
from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True)
class Data:
    """A file or folder that a run used: SHA-256 of its content, what for (`context`), and of tables columns and rows."""

    name: str
    path: str
    sha256: str
    context: str
    columns: dict[str, str] = field(default_factory=dict)
    rows: int = 0


@dataclass(frozen=True)
class File:
    """A file to attach below `folder`, as long as its content still has this SHA-256."""

    path: str
    sha256: str
    folder: str


@dataclass(frozen=True)
class Classifiers:
    """The fitted classifiers of a run: those of one feature set and training object in a file of `pipeline.models`."""

    file: File
    features: str
    training_object: str


@dataclass
class Run:
    """A run with nested ones. Times are seconds since 1970; metrics are (key, value, step); `texts` are small files, whole.

    A run with a fingerprint is written once: not again while the store has one of the same workspace and fingerprint.
    """

    name: str
    begun_s: float
    ended_s: float
    status: str = "FINISHED"
    tags: dict[str, str] = field(default_factory=dict)
    params: dict[str, Any] = field(default_factory=dict)
    metrics: list[tuple[str, float, int]] = field(default_factory=list)
    data: list[Data] = field(default_factory=list)
    files: list[File] = field(default_factory=list)
    texts: dict[str, str] = field(default_factory=dict)
    classifiers: Classifiers | None = None
    fingerprint: str = ""
    nested: list["Run"] = field(default_factory=list)


def to_tree(run: Run) -> dict[str, Any]:
    """Return a run as what JSON can hold."""
    return asdict(run)


def from_tree(tree: dict[str, Any]) -> Run:
    """Return the run that `to_tree` took apart."""
    classifiers = tree["classifiers"]
    whole = {
        "metrics": [(key, value, step) for key, value, step in tree["metrics"]],
        "data": [Data(**item) for item in tree["data"]],
        "files": [File(**item) for item in tree["files"]],
        "classifiers": classifiers and Classifiers(**{**classifiers, "file": File(**classifiers["file"])}),
        "nested": [from_tree(inner) for inner in tree["nested"]],
    }
    return Run(**{**tree, **whole})


def digest_of(run: Run) -> str:
    """Return the SHA-256 of all that a run says: what it is known by, wherever and whenever it is written."""
    text = json.dumps(to_tree(run), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()
