"""Every command and every piece of Python that the documentation prints is run: as it is printed, or in a listed dry form."""

import ast
import json
import re
import runpy
import shutil
from pathlib import Path

import pytest
from docs import forms, pages
from docs.conftest import Workspace
from motion import pours
from workflow.conftest import ROOT, new_project

from pipeline.artefacts import write_json

TESTS = ROOT / "tests"
TYPED = ("pour", "source", "python -")  # and what these begin is run as it is printed
NO_COMMAND = re.compile(r"pour \w+|.*…")  # a subcommand or a pattern that is spoken of


@pytest.fixture(scope="module")
def followed(workspace) -> list[tuple[str, str]]:
    """Type the tutorial; return its commands, and what each wrote."""
    commands = [command for block in _tutorial("bash") for command in pages.lines(block)]
    said = []
    for command in commands:
        dry = forms.form(command)
        told = workspace.bash(dry.typed(command) if dry else command)
        assert told.returncode == 0, f"{command}\n{told.stdout}{told.stderr}"
        said.append((command, told.stdout))
    return said


def _tutorial(language: str) -> list[str]:
    return [block.text for block in pages.blocks(language) if block.page == "docs/tutorial.md"]


def test_the_tutorial_is_typed_from_its_first_line_to_its_last(workspace, followed):
    shown = json.loads(workspace.bash("pour show my_mug --json").stdout)
    capacity_m3 = shown["parameters"]["label_mapping"]["capacity_m3"]
    assert capacity_m3 == pytest.approx(3.1416 * 0.037**2 * 0.091, rel=0.04)
    assert shown["parameters"]["label_mapping"]["height_m"] == pytest.approx(0.095, rel=0.03)
    pours_at = {
        tilt: json.loads(workspace.bash(f"pour predict my_mug --fill 60% --tilt {tilt} --json").stdout)
        for tilt in (10, 110)
    }
    assert pours_at[10]["probability"] < 0.5 < pours_at[110]["probability"]


def test_what_the_tutorial_shows_is_what_is_written(followed):
    """But for the numbers, which are those of the default configuration."""
    written = _words("".join(said for command, said in followed if command.startswith("pour")))
    for shown in _tutorial("text"):
        assert _words(shown) in written, shown


def _words(text: str) -> str:
    return " ".join(re.sub(r"[-+]?\d+(\.\d+)?", "0", text).split())


def test_python_of_the_guides_runs(workspace, followed):
    _with_a_primitive(workspace)
    for block in pages.blocks("python"):
        (workspace.folder / "typed.py").write_text(block.text)
        told = workspace.bash("python typed.py")
        assert told.returncode == 0, f"{block.page}: {told.stderr}"


def _with_a_primitive(workspace: Workspace) -> None:
    """Learn from pours of known shape what the small configuration has no containers for."""
    from pipeline.motion.promp import ProMP

    shown = [values for _, values in (pours.pour(seed) for seed in range(5))]
    primitive = ProMP.fit(shown, n_basis=15)
    write_json(
        workspace.folder / "data/processed/primitives/mug/label_mapping/promp.json", primitive.to_json()
    )


def _others() -> list[str]:
    """Return the commands that are neither the tutorial's nor Snakemake's."""
    known = {command for block in _tutorial("bash") for command in pages.lines(block)}
    found = [command for command in pages.commands() if not NO_COMMAND.fullmatch(command)]
    return [command for command in found if command not in known and forms.planned(command) is None]


def test_other_commands_are_typed(workspace, followed):
    for command in _others():
        dry = forms.form(command)
        assert dry or command.startswith(TYPED) or command.endswith("--help"), (
            f"{command}: add it to forms.py"
        )
        told = workspace.bash(dry.typed(command) if dry else command)
        assert told.returncode == 0, f"{command}\n{told.stdout}{told.stderr}"
    spoken_of = {command.split()[1] for command in pages.commands() if re.fullmatch(r"pour \w+", command)}
    assert spoken_of <= {"add", "annotate", "view", "show", "predict"}


@pytest.fixture(scope="module")
def clone(tmp_path_factory, workspace, followed) -> Workspace:
    """Return a fresh clone in the default configuration, with the tutorial's mug and the demonstrations."""
    folder = tmp_path_factory.mktemp("clone")
    new_project(folder)
    shutil.copytree(workspace.folder / "data/raw/my_mug", folder / "data/raw/my_mug")
    shutil.copytree(ROOT / "data/demonstrations", folder / "data/demonstrations")
    return Workspace(folder)


def test_snakemake_can_make_every_target(clone):
    """In one plan but for calls with options of their own; that each is made somewhere is listed."""
    asked = {words for command in pages.commands() if (words := forms.planned(command)) is not None}
    assert asked <= forms.MADE_BY.keys(), "add these to forms.py, with the test that makes them"
    plain = sorted(words for words in asked if "--" not in words)
    for words in (" ".join(plain), *sorted(asked - set(plain))):
        told = clone.bash(f"snakemake -n {words} --quiet rules")
        assert told.returncode == 0, f"{words}\n{told.stderr}"


def test_the_picture_of_the_rules_is_that_of_the_workflow(clone):
    drawn = runpy.run_path(str(ROOT / "docs/rulegraph.py"))
    now = drawn["svg"](drawn["rules"](clone.folder))
    assert (ROOT / "docs/rulegraph.svg").read_text() == now, "run: python docs/rulegraph.py"


@pytest.mark.parametrize(
    "named", sorted({*forms.MADE_BY.values(), *filter(None, (one.real for one in forms.FORMS))})
)
def test_a_test_that_is_named_exists(named):
    path, name = named.split("::")
    module = ast.parse((TESTS / path).read_text())
    assert name in {node.name for node in module.body if isinstance(node, ast.FunctionDef)}


def test_links_between_pages_lead_somewhere():
    """Those that the site's builder does not see: in the README."""
    readme = ROOT / "README.md"
    for target in re.findall(r"\]\(([^)#]+)", readme.read_text()):
        assert "://" in target or (readme.parent / Path(target)).is_file(), target
