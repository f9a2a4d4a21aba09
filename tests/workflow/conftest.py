"""A copy of the project in which the workflow really runs: once for all tests, then a copy of the finished state for each."""

import fcntl
import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml
from numba.core.caching import UserProvidedCacheLocator

ROOT = Path(__file__).parents[2]
PARTS = ["Snakefile", "config", "workflow", "profiles", "src"]
JOB = re.compile(r"^(?:local)?rule (\w+):\n((?:    .*\n)*)", re.MULTILINE)
WILDCARD = re.compile(r"(?:object|experiment|stage)=(\w+)")


@dataclass(frozen=True)
class Project:
    """A folder with the workflow in it."""

    folder: Path

    def __truediv__(self, path: str) -> Path:
        """Return the path of a file of the project."""
        return self.folder / path

    def call(self, *arguments: str, cores: int = 2) -> subprocess.CompletedProcess:
        """Run Snakemake on the small overlay; stdout and stderr come together."""
        environment = {
            key: value
            for key, value in os.environ.items()
            if key not in ("MLFLOW_TRACKING_URI", "PYTHONPATH")
        }
        # The targets come first, as --configfile takes all words that follow it.
        snakemake = [sys.executable, "-m", "snakemake", f"-c{cores}"]
        command = [*snakemake, *arguments, "--configfile", "config/test.yaml"]
        return subprocess.run(
            command,
            **{"cwd": self.folder, "env": environment, "text": True},
            **{"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT},
        )

    def planned(self, *arguments: str) -> set[str]:
        """Return what the next call would run: rule and object or experiment."""
        told = self.call("--dry-run", *arguments)
        assert told.returncode == 0, told.stdout
        jobs = {" ".join([rule, *WILDCARD.findall(body)]) for rule, body in JOB.findall(told.stdout)}
        assert jobs or "Nothing to be done" in told.stdout, told.stdout
        return jobs - {"all"}

    def configure(self, key: str, value: object) -> None:
        """Set one dotted key of the overlay."""
        path = self / "config/test.yaml"
        config = yaml.safe_load(path.read_text())
        *sections, name = key.split(".")
        inner = config
        for section in sections:
            inner = inner.setdefault(section, {})
        inner[name] = value
        path.write_text(yaml.safe_dump(config))

    def contents(self) -> dict[str, bytes]:
        """Return path → bytes of every scan and result; figures are compared as numbers, in metrics.json."""
        folders = [self / "data", self / "reports"]
        paths = [path for folder in folders for path in sorted(folder.rglob("*")) if path.is_file()]
        return {
            str(path.relative_to(self.folder)): path.read_bytes() for path in paths if path.suffix != ".pdf"
        }


def new_project(folder: Path, source: Path = ROOT) -> Project:
    """Return a copy of the project at `source` without any data or result."""
    for part in PARTS:
        copy = shutil.copytree if (source / part).is_dir() else shutil.copy2
        copy(source / part, folder / part)
    (folder / "data/raw").mkdir(parents=True)
    return _compiled(Project(folder), source)


def _compiled(project: Project, source: Path) -> Project:
    """Return a copy of the project at `source` in which Numba finds what was compiled there; its folders have names by place."""
    packages = Path("src/pipeline")
    for old in (project / str(packages)).rglob("numba-*/*_*"):
        package = packages / old.name.rsplit("_", 1)[0] / "any.py"
        here, there = (
            UserProvidedCacheLocator.get_suitable_cache_subpath(root / package)
            for root in (project.folder, source)
        )
        if old.name == there:
            old.rename(old.with_name(here))
    return project


@pytest.fixture
def fresh(tmp_path) -> Project:
    """Return the project as it is after cloning."""
    (tmp_path / "project").mkdir()
    return new_project(tmp_path / "project")


@pytest.fixture(scope="session")
def finished(tmp_path_factory) -> Project:
    """Return the project after one call; shared by all processes that test, so only to be read."""
    base = tmp_path_factory.getbasetemp()
    base = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    folder, done = base / "finished", base / "finished.done"
    with (base / "finished.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # until it is closed: who comes second waits
        if not done.exists():
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            told = new_project(folder).call()
            assert told.returncode == 0, told.stdout
            done.touch()
    return Project(folder)


@pytest.fixture
def unfinished(finished, tmp_path) -> Project:
    """Return the finished project's code without its data and results."""
    (tmp_path / "unfinished").mkdir()
    return new_project(tmp_path / "unfinished", finished.folder)


@pytest.fixture
def project(finished, tmp_path) -> Project:
    """Return a copy of the finished project, with its time stamps."""
    copy = Project(shutil.copytree(finished.folder, tmp_path / "project", symlinks=True))
    return _compiled(copy, finished.folder)
