"""The finished project, as a user has it who follows the documentation; the site, built as `make docs` builds it."""

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml
from workflow.conftest import ROOT, copy_of, finished

__all__ = ["finished"]

SCRIPT = "#!{python}\nimport sys\nfrom {module} import {function}\nsys.exit({function}())\n"


class Workspace:
    """A folder in which commands are typed."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def bash(self, script: str) -> subprocess.CompletedProcess:
        """Run lines as someone types them there with the environment active; stdout and stderr apart."""
        path = os.pathsep.join(
            [str(self.folder / "bin"), os.path.dirname(sys.executable), os.environ["PATH"]]
        )
        kept = {key: value for key, value in os.environ.items() if key != "MLFLOW_TRACKING_URI"}
        environment = {**kept, "PATH": path, "PYTHONPATH": str(self.folder / "src"), "OMP_NUM_THREADS": "1"}
        command = ["bash", "-euo", "pipefail", "-c", script]
        return subprocess.run(command, cwd=self.folder, env=environment, capture_output=True, text=True)


@pytest.fixture(scope="session")
def workspace(finished, tmp_path_factory) -> Workspace:
    """Return a copy of the finished project, its overlay taken into config.yaml, so that commands are typed as they are printed."""
    folder = tmp_path_factory.mktemp("typed") / "project"
    copy_of(finished, folder)
    for name in ("Makefile", "pyproject.toml", "requirements.txt"):
        shutil.copy2(ROOT / name, folder)
    shutil.copytree(ROOT / "benchmarks", folder / "benchmarks", dirs_exist_ok=True)
    config = yaml.safe_load((folder / "config/config.yaml").read_text())
    _merge(config, yaml.safe_load((folder / "config/test.yaml").read_text()))
    config["track"]["enabled"] = False  # that calls are recorded is tested where the workflow is
    (folder / "config/config.yaml").write_text(yaml.safe_dump(config))
    (folder / ".venv").symlink_to(sys.prefix)
    _install_scripts(folder)
    return Workspace(folder)


def _merge(config: dict, overlay: dict) -> None:
    for key, value in overlay.items():
        if isinstance(value, dict):
            _merge(config[key], value)
        else:
            config[key] = value


def _install_scripts(folder: Path) -> None:
    """Write what pip makes of [project.scripts], for the code of the workspace."""
    (folder / "bin").mkdir()
    for name, entry in tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"].items():
        module, function = entry.split(":")
        path = folder / "bin" / name
        path.write_text(SCRIPT.format(python=sys.executable, module=module, function=function))
        path.chmod(0o755)


@pytest.fixture(scope="session")
def site(tmp_path_factory) -> Path:
    """Return the folder of the site; a warning fails it."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "docs", str(folder)]
    told = subprocess.run(
        [*command, "-d", str(folder / ".doctrees")], cwd=ROOT, capture_output=True, text=True
    )
    assert told.returncode == 0, told.stderr
    return folder
