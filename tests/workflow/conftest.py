"""A copy of the project in which the workflow really runs: once for all tests, then a copy of the finished state for each."""

import atexit
import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest
import yaml
from numba.core.caching import UserProvidedCacheLocator
from sharing import alone, shared_folder

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
        return subprocess.run(
            [sys.executable, "-m", "snakemake", *_words(cores, arguments)],
            **{"cwd": self.folder, "env": _environment(), "text": True},
            **{"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT},
        )

    def dry_run(self, *arguments: str) -> tuple[int, str]:
        """Return the exit code of the next call's dry run and what it says."""
        said = self.folder / "dry_run.txt"
        asked = [str(self.folder), _words(2, ("--dry-run", *arguments)), str(said)]
        job = _loaded()
        job.stdin.write(f"{json.dumps(asked)}\n")
        job.stdin.flush()
        return int(job.stdout.readline()), said.read_text()

    def plan(self, *arguments: str) -> str:
        """Return what a dry run says that succeeds."""
        code, said = self.dry_run(*arguments)
        assert code == 0, said
        return said

    def planned(self, *arguments: str) -> set[str]:
        """Return what the next call would run: rule and object or experiment."""
        return jobs(self.plan(*arguments))

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


def jobs(plan: str) -> set[str]:
    """Return the jobs of a plan: rule and object or experiment."""
    found = {" ".join([rule, *WILDCARD.findall(body)]) for rule, body in JOB.findall(plan)}
    assert found or "Nothing to be done" in plan, plan
    return found - {"all"}


def _words(cores: int, arguments: tuple[str, ...]) -> list[str]:
    """Return Snakemake's arguments; the targets come first, as --configfile takes all words that follow it."""
    return [f"-c{cores}", *arguments, "--configfile", "config/test.yaml"]


def _environment() -> dict[str, str]:
    return {
        key: value for key, value in os.environ.items() if key not in ("MLFLOW_TRACKING_URI", "PYTHONPATH")
    }


@cache
def _loaded() -> subprocess.Popen:
    """Return the process that makes dry runs; it ends with its input."""
    job = subprocess.Popen(
        [sys.executable, "-P", Path(__file__).with_name("loaded.py")],
        **{"env": _environment(), "text": True, "stdin": subprocess.PIPE, "stdout": subprocess.PIPE},
    )
    atexit.register(job.communicate)
    return job


def new_project(folder: Path, source: Path = ROOT) -> Project:
    """Return a copy of the project at `source` without any data or result."""
    for part in PARTS:
        copy = shutil.copytree if (source / part).is_dir() else shutil.copy2
        copy(source / part, folder / part)
    (folder / "data/raw").mkdir(parents=True)
    return _compiled(Project(folder), source)


def copy_of(finished: Project, folder: Path) -> Project:
    """Return a copy of a finished project, with its time stamps."""
    return _compiled(Project(shutil.copytree(finished.folder, folder, symlinks=True)), finished.folder)


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


def _compile(base: Path) -> None:
    """Compile here what the workflow would compile in its copy, which takes it over as do the other tests."""
    for stage in ("fuse", "simulate"):
        command = [sys.executable, "-m", "pipeline.compile", stage, "--compiled", base / f"{stage}.json"]
        subprocess.run(command, check=True, cwd=ROOT)


@pytest.fixture
def fresh(tmp_path) -> Project:
    """Return the project as it is after cloning."""
    (tmp_path / "project").mkdir()
    return new_project(tmp_path / "project")


@pytest.fixture(scope="session")
def finished(tmp_path_factory) -> Project:
    """Return the project after one call; shared by all processes that test, so only to be read."""
    base = shared_folder(tmp_path_factory)
    folder, done = base / "finished", base / "finished.done"
    with alone(base, "finished"):
        if not done.exists():
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            _compile(base)
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
    return copy_of(finished, tmp_path / "project")
