"""A mistake of a user ends the call before anything runs, with one sentence that names it."""

import pytest
import yaml
from workflow.conftest import jobs

from pipeline.scan.shapes import NAMES

ROOT_CONFIG = "config/config.yaml"


def _refusal(project, *arguments):
    code, said = project.dry_run(*arguments)
    assert code == 1
    assert "Traceback" not in said
    (sentence,) = [line for line in said.splitlines() if line.startswith("error: ")]
    return sentence


def test_a_dry_run_of_the_tests_is_that_of_the_program(fresh):
    """They call it in a process that has it loaded."""
    told = fresh.call("--dry-run")
    assert (told.returncode, jobs(told.stdout)) == (0, fresh.planned())
    fresh.configure("fuse.points", 10)
    told, sentence = fresh.call("--dry-run"), _refusal(fresh)
    assert told.returncode == 1
    assert sentence in told.stdout.splitlines()


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("fuse.voxl_m", 0.001, "fuse.voxl_m: expected one of the keys"),
        ("fuse.voxl_m", 0.001, "did you mean 'voxel_m'?"),
        ("simulatte", {}, "did you mean 'simulate'?"),
        ("simulate.pouring.trails", 3, "did you mean 'trials'?"),
        ("fuse.points", 10, "fuse.points: expected at least 5000"),
        ("scan.views", "many", "scan.views: expected a value of type integer"),
        ("scan.objects", ["mug", "short_cap"], "did you mean 'short_cup'?"),
        ("objects.source", "mugg", "objects.source: expected objects of scan.objects or data/raw"),
        (
            "objects.source",
            "wide_bowl",
            "config/annotations/wide_bowl.parquet: expected the human annotation",
        ),
        ("objects.exclude", ["bowl"], "objects.exclude: expected objects of scan.objects or data/raw"),
        (
            "objects.exclude",
            ["short_cup"],
            "simulate.filling.held_objects: expected an object that takes part",
        ),
        (
            "simulate.filling.held_objects",
            ["mug", "cup"],
            "simulate.filling.held_objects: expected objects of",
        ),
        ("simulate.pouring.fill_min", 1.0, "simulate.pouring.fill_min: expected less than fill_max"),
        ("classify.samples", 80, "classify.samples: expected less than simulate.pouring.trials (60)"),
        ("fuse.truncation_m", 0.0015, "fuse.truncation_m: expected at least two voxels"),
    ],
)
def test_configuration(fresh, key, value, said):
    fresh.configure(key, value)
    assert said in _refusal(fresh)


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("my mug/cup.ply", "data/raw/my mug/: expected an object's name"),
        ("my mug/cup.ply", "for instance to 'my_mug'"),
        ("Mug2/cup.ply", "for instance to 'mug2'"),
        ("parameters/cup.ply", "for instance to 'my_parameters'"),
        ("cup.ply", "data/raw/cup.ply: expected a folder an object, found a file"),
        ("mug/cup.ply", "data/raw/mug/cup.ply: expected only what the scan stage writes"),
        ("my_mug/cup{1}.ply", "data/raw/my_mug/cup{1}.ply: expected a file name without braces"),
    ],
)
def test_raw_data(fresh, path, said):
    file = fresh / "data/raw" / path
    file.parent.mkdir(exist_ok=True)
    file.touch()
    assert said in _refusal(fresh)


def test_a_source_file_that_is_no_python_is_named(fresh):
    (fresh / "src/pipeline/warp/__main__.py").write_text("def\n")
    assert "src/pipeline/warp/__main__.py, line 1: expected Python" in _refusal(fresh)


def test_hidden_files_are_no_objects(fresh):
    (fresh / "data/raw/.DS_Store").touch()
    assert {job for job in fresh.planned() if job.startswith("fuse")} == {
        "fuse mug",
        "fuse short_cup",
        "fuse wide_bowl",
    }


def test_a_broken_folder_can_be_excluded(fresh):
    (fresh / "data/raw/my mug").mkdir()
    fresh.configure("objects.exclude", ["my mug"])
    assert "fuse mug" in fresh.planned()


def test_numbers_on_the_command_line(fresh):
    before = fresh.planned(
        "data/processed/fuse/mug/mesh.ply", "--config", "fuse={voxel_m: 9e-4, points: 7000}"
    )
    assert before == {"scan mug", "fuse mug", "compile fuse"}
    assert "fuse.points: expected at least 5000" in _refusal(fresh, "--config", "fuse={points: 7}")


def test_both_configurations_plan_every_object(fresh):
    (fresh / "config/test.yaml").write_text("{}\n")
    planned = fresh.planned()
    config = yaml.safe_load((fresh / ROOT_CONFIG).read_text())
    assert {job.removeprefix("simulate_filling ") for job in planned if "filling " in job} == set(NAMES)
    assert set(config["scan"]["objects"]) == set(NAMES)
    assert {"classify pouring", "classify filling", "report"} <= planned
