"""The hash of a stage's code follows imports and ignores what does not run."""

import os
from pathlib import Path

import pytest

from pipeline.errors import PipelineError
from pipeline.workflow.code import Code

SOURCE = Path(__file__).parents[2] / "src"
STAGES = ["scan", "fuse", "label", "warp", "parametrise", "simulate", "classify", "track"]


@pytest.fixture
def source(tmp_path):
    """Return a package in which stage `a` reaches helper and deep, and stage `b` nothing of it."""
    files = {
        "__init__.py": "",
        "helper.py": "from pipeline.deep.well import water\n",
        "deep/__init__.py": "import math\n",
        "deep/well.py": '"""Doc."""\nwater = 1\n',
        "a/__init__.py": "",
        "a/__main__.py": "def main():\n    from pipeline import helper\n    from . import part\n",
        "a/part.py": "x = 1\n",
        "a/unused.py": "x = 1\n",
        "b/__init__.py": "",
        "b/__main__.py": "import numpy\n",
    }
    for name, text in files.items():
        (tmp_path / "pipeline" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "pipeline" / name).write_text(text)
    return tmp_path


def test_modules_are_those_that_run(source):
    reached = ["", ".a", ".a.__main__", ".a.part", ".deep", ".deep.well", ".helper"]
    assert Code(source).modules("pipeline.a") == [f"pipeline{name}" for name in reached]
    assert Code(source).modules("pipeline.b") == ["pipeline", "pipeline.b", "pipeline.b.__main__"]


@pytest.mark.parametrize(
    "name", ["a/__main__.py", "a/part.py", "helper.py", "deep/__init__.py", "deep/well.py"]
)
def test_a_statement_in_any_of_them_changes_the_hash(source, name):
    before = Code(source).hash("pipeline.a"), Code(source).hash("pipeline.b")
    with (source / "pipeline" / name).open("a") as file:
        file.write("y = 2\n")
    after = Code(source).hash("pipeline.a"), Code(source).hash("pipeline.b")
    assert before[0] != after[0]
    assert before[1] == after[1]


@pytest.mark.parametrize(
    "text",
    ['"""Doc."""\nwater = 1  # comment\n', '"""Another."""\nwater = 1\n', '"""Doc."""\n\n\nwater  =  1\n'],
)
def test_comments_docstrings_and_layout_do_not(source, text):
    before = Code(source).hash("pipeline.a")
    (source / "pipeline/deep/well.py").write_text(text)
    os.utime(source / "pipeline/a/part.py", (1, 1))
    (source / "pipeline/a/unused.py").write_text("x = 2\n")
    assert Code(source).hash("pipeline.a") == before


NESTED = """
async def asked():
    async for _ in water():
        async with water():
            {}
class Well:
    def draw(self, pails):
        for pail in pails:
            while pail:
                {}
        else:
            {}
        match pails:
            case []:
                {}
        try:
            {}
        except* OSError:
            {}
        finally:
            if pails:
                {}
            else:
                {}
"""


@pytest.mark.parametrize("place", range(NESTED.count("{}")))
def test_imports_and_docstrings_are_found_in_every_statement_that_holds_others(source, place):
    def written(line: str) -> str:
        return NESTED.format(*(line if number == place else "pass" for number in range(NESTED.count("{}"))))

    part = source / "pipeline/b/__main__.py"
    part.write_text(written("from pipeline import helper"))
    assert "pipeline.helper" in Code(source).modules("pipeline.b")
    part.write_text(written("def inner(): 'Doc.'; return 1"))
    before = Code(source).hash("pipeline.b")
    part.write_text(written("def inner(): 'Another.'; return 1"))
    assert Code(source).hash("pipeline.b") == before
    part.write_text(written("def inner(): 'Another.'; return 2"))
    assert Code(source).hash("pipeline.b") != before


def test_a_missing_stage_is_named(source):
    with pytest.raises(PipelineError, match=r"expected the module pipeline\.c, found none"):
        Code(source).hash("pipeline.c")


@pytest.mark.parametrize("stage", STAGES)
def test_no_stage_reaches_another_one(stage):
    rooms = {name.split(".")[1] for name in Code(SOURCE).modules(f"pipeline.{stage}") if "." in name}
    assert rooms & {*STAGES, "report", "workflow"} == {stage}


def test_mlflow_is_imported_by_track_alone():
    importers = {
        path.parent.name
        for path in SOURCE.rglob("*.py")
        if "mlflow" in path.read_text().replace("MLFLOW", "")
    }
    assert importers == {"track"}


def test_what_a_page_is_made_from_changes_the_hash_of_who_uses_it(source):
    before = Code(source).hash("pipeline.a"), Code(source).hash("pipeline.b")
    (source / "pipeline/deep/assets").mkdir()
    (source / "pipeline/deep/assets/page.html").write_text("<p>")
    after = Code(source).hash("pipeline.a"), Code(source).hash("pipeline.b")
    assert before[0] != after[0]
    assert before[1] == after[1]
