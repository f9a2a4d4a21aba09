"""The whole workflow on the small overlay: it runs, it is reproducible, and a change reruns what depends on it and no more."""

import base64
import os

import pytest
import trimesh
from workflow.jobs import OBJECTS, each

from pipeline.artefacts import read_json, read_table
from pipeline.track.store import client

ASSEMBLED = {"assemble_parameters", "assemble_tilt_references"}
ESTIMATED = {"assemble_uncertainties", "draw_parameters"}
REPORTED = {"report", "report_evaluation", "index"}
CLASSIFIED = {"classify pouring", "classify filling"} | REPORTED
LEARNT = {"classify_learning pouring", "classify_learning filling"} | CLASSIFIED
POURED, FILLED = (
    {f"classify {name}", f"classify_learning {name}"} | REPORTED for name in ("pouring", "filling")
)


FUSED = each("fuse") | each("draw_scan")
LABELLED = {"learn"} | each("label")
SIMULATED = each("simulate_pouring") | each("simulate_filling") | LEARNT
CONTAINED = each("simulate_container") | SIMULATED | {"draw_parameters"}
COMPARED = each("accuracy")
PARAMETRISED = each("parametrise") | ASSEMBLED | COMPARED | LEARNT
UNCERTAIN = each("uncertainties") | ESTIMATED | {"index"}
WARPED = each("warp") | PARAMETRISED | UNCERTAIN | {"draw_labels"}


def _of_one(name: str) -> set[str]:
    """Return all that follows from the scan of an object that is neither source nor held."""
    stages = (
        *("fuse", "draw_scan", "label", "warp", "parametrise", "uncertainties"),
        *("simulate_container", "simulate_pouring", "simulate_filling"),
    )
    return {f"{stage} {name}" for stage in stages} | ASSEMBLED | ESTIMATED | LEARNT | {"draw_labels"}


def _runs(project) -> list:
    store = client(f"sqlite:///{project / 'mlflow.db'}")
    return store.search_runs([store.get_experiment_by_name("warped-pouring").experiment_id])


def _append(path, text: str) -> None:
    with path.open("a") as file:
        file.write(text)


def test_one_call_makes_the_figure_the_numbers_and_the_runs(finished):
    assert (finished / "reports/roc.pdf").read_bytes().startswith(b"%PDF")
    numbers = read_json(finished / "reports/metrics.json")
    assert all(isinstance(value, int | float) for value in numbers.values())
    parameters = read_table(finished / "data/processed/parametrise/mug/parameters.parquet", "parameters")
    assert set(parameters["object"]) == OBJECTS
    runs = _runs(finished)
    assert [run.info.status for run in runs if "mlflow.parentRunId" not in run.data.tags] == ["FINISHED"]
    nested = {
        (run.data.tags["experiment"], run.data.tags["features"])
        for run in runs
        if "experiment" in run.data.tags
    }
    features = ("point_mapping", "label_mapping", "standard")
    assert nested >= {(experiment, name) for experiment in ("pouring", "filling") for name in features}


def test_a_second_call_does_nothing_and_records_nothing(project):
    before = project.contents(), len(_runs(project))
    told = project.call()
    assert told.returncode == 0
    assert "Nothing to be done" in told.stdout
    assert (project.contents(), len(_runs(project))) == before


@pytest.mark.long
def test_one_core_gives_the_same_bytes_as_two(finished, unfinished):
    told = unfinished.call("--config", "track={enabled: false}", cores=1)
    assert told.returncode == 0, told.stdout
    assert not (unfinished / "mlflow.db").exists()
    one, two = unfinished.contents(), finished.contents()
    assert [path for path in {*one, *two} if one.get(path) != two.get(path)] == []


@pytest.mark.parametrize(
    ("key", "value", "jobs"),
    [
        ("scan.noise", 0.5, each("scan") | FUSED | LABELLED | WARPED | CONTAINED),
        ("fuse.points", 7000, FUSED | LABELLED | WARPED | CONTAINED),
        ("label.ridge", 2.0, LABELLED | WARPED),
        ("warp.k", 2, WARPED),
        # Shapes are learnt from warps by the default method, onto all but the target.
        ("warp.method", "shape_space", WARPED | each("warp_by", OBJECTS - {"mug"})),
        ("parametrise.hull_points", 3000, PARAMETRISED | UNCERTAIN),
        ("parametrise.redraws", 3, UNCERTAIN),
        ("simulate.seed", 40, SIMULATED),
        ("simulate.spacing_m", 0.015, CONTAINED),
        ("simulate.engine", "bullet", SIMULATED),
        ("simulate.device", "cuda", SIMULATED),
        ("simulate.physics.convergence_trials", 3, set()),
        ("simulate.ranges", "absolute", SIMULATED),
        ("simulate.pouring.tilt_max_deg", 90.0, each("simulate_pouring") | POURED),
        ("simulate.filling.tilt_deg", 90.0, each("simulate_filling") | FILLED),
        (
            "simulate.filling.held_objects",
            ["short_cup", "mug"],
            each("simulate_filling") | FILLED,
        ),
        ("classify.draws", 4, CLASSIFIED),
        ("classify.terms", "quadratic", LEARNT),
        (
            "classify.learning_draws",
            3,
            {"classify_learning pouring", "classify_learning filling", "report_evaluation", "index"},
        ),
        ("ablate.draws", 3, set()),
        ("track.experiment", "another", set()),
    ],
)
def test_a_changed_key_reruns_what_depends_on_it(project, key, value, jobs):
    project.configure(key, value)
    assert project.planned() == jobs


def test_two_keys_that_swap_their_values_are_a_change(project):
    project.configure("classify.samples", 3)
    project.configure("classify.draws", 50)
    assert project.planned() == CLASSIFIED


@pytest.mark.parametrize(
    ("module", "jobs"),
    [
        ("scan/camera.py", each("scan") | FUSED | LABELLED | WARPED | CONTAINED),
        ("label/features.py", LABELLED | WARPED),
        ("simulate/trials.py", SIMULATED),
        ("simulate/fields.py", CONTAINED),
        ("classify/regression.py", LEARNT),
        ("report/roc.py", {"report", "index"}),
        ("track/store.py", set()),
        ("workflow/objects.py", set()),
    ],
)
def test_a_changed_module_reruns_what_imports_it(project, module, jobs):
    _append(project / "src/pipeline" / module, "\n_ADDED = 1\n")
    assert project.planned() == jobs


def test_comments_and_touched_files_rerun_nothing(project):
    for path in [*(project / "src").rglob("*.py"), *(project / "config").rglob("*.yaml")]:
        _append(path, "# a comment\n")
    for folder in ("data", "config", "src", "workflow"):
        for path in (project / folder).rglob("*"):
            os.utime(path)
    assert project.planned() == set()


def test_a_changed_scan_reruns_its_object_alone(project):
    scan = project / "data/raw/wide_bowl"
    (scan / "frame-000000.depth.png").write_bytes((scan / "frame-000001.depth.png").read_bytes())
    assert project.planned() == _of_one("wide_bowl") | {"accuracy wide_bowl"}


def test_a_changed_scan_of_a_held_cup_reruns_every_filling(project):
    _append(project / "data/raw/short_cup/camera-intrinsics.txt", "\n")
    assert project.planned() == _of_one("short_cup") | each("simulate_filling") | {"accuracy short_cup"}


def test_a_changed_annotation_reruns_the_labels(project):
    path = project / "config/annotations/mug.parquet"
    table = read_table(path, "annotation")
    table.iloc[:-1].to_parquet(path, index=False)
    assert project.planned() == LABELLED | WARPED


@pytest.mark.long
def test_an_object_is_dropped_and_taken_away_again(project):
    before = project.contents()
    mesh = trimesh.load_mesh(project / "data/processed/scan/short_cup/truth.ply")
    (project / "data/raw/my_cup").mkdir()
    mesh.apply_scale(1.15).export(project / "data/raw/my_cup/cup.ply")
    assert project.planned() == _of_one("my_cup")

    told = project.call()
    assert told.returncode == 0, told.stdout
    for experiment in ("pouring", "filling"):
        scores = read_table(project / f"data/processed/classify/{experiment}/scores.parquet", "scores")
        assert set(scores["training_object"]) >= OBJECTS | {"my_cup"}
    assert "my_cup" in set(
        read_table(project / "data/processed/parametrise/mug/parameters.parquet", "parameters")["object"]
    )

    (project / "data/raw/my_cup/cup.ply").unlink()
    (project / "data/raw/my_cup").rmdir()
    assert project.planned() == ASSEMBLED | ESTIMATED | LEARNT | {"draw_labels"}
    assert project.call().returncode == 0
    after = project.contents()
    assert [path for path in before if before[path] != after.get(path)] == []


def test_a_call_that_was_stopped_while_it_compiled_is_taken_up_to_its_end(project):
    (project / "reports/roc.pdf").unlink()
    name = base64.b64encode(b"data/processed/compile/simulate.json").decode()
    (project / ".snakemake/incomplete").mkdir(exist_ok=True)
    (project / f".snakemake/incomplete/{name}").touch()  # as Snakemake's that was killed leaves it
    assert {"compile simulate", "report"} <= project.planned("reports/roc.pdf")


def test_a_touched_file_of_what_is_compiled_reruns_nothing(project):
    (project / "data/processed/compile/fuse.json").touch()
    assert project.planned() == set()


def test_a_broken_object_costs_itself_alone(project):
    (project / "data/raw/broken_cup").mkdir()
    (project / "data/raw/broken_cup/frame-000000.depth.png").write_bytes(b"no image")
    for path in ("simulate/pouring/wide_bowl/trials.parquet", "fuse/wide_bowl/fusion.json"):
        (project / "data/processed" / path).unlink()
    (project / "reports/roc.pdf").unlink()
    told = project.call("reports/roc.pdf")
    assert told.returncode == 1
    (said,) = {line for line in told.stdout.splitlines() if line.startswith("error: ")}
    assert "data/raw/broken_cup" in said
    assert "Traceback" not in told.stdout
    assert (project / "data/processed/simulate/pouring/wide_bowl/trials.parquet").is_file()
    assert not (project / "data/processed/fuse/broken_cup/mesh.ply").exists()
    assert not (project / "reports/roc.pdf").exists()
    failed = {run.data.tags["kind"]: run for run in _runs(project) if run.info.status == "FAILED"}
    assert set(failed) == {"call", "stage"}
    assert failed["stage"].data.tags["stage"] == "fuse"
    assert failed["call"].data.tags["failed.rule"] == "fuse"
    assert failed["call"].data.tags["failed.reason"] == said

    project.configure("objects.exclude", ["broken_cup"])
    assert "fuse broken_cup" not in project.planned()


def test_jobs_run_the_code_that_was_hashed_and_leave_nothing_half_written(project):
    _append(project / "src/pipeline/report/metrics.py", "\nraise RuntimeError('this copy runs')\n")
    told = project.call()
    assert told.returncode == 1
    assert "this copy runs" in told.stdout
    assert not (project / "reports/metrics.json").exists()
    assert not (project / "reports/roc.pdf").exists()


def test_the_figure_alone_can_be_asked_for_without_tracking(project):
    runs = len(_runs(project))
    for name in ("roc.pdf", "metrics.json"):
        (project / "reports" / name).unlink()
    told = project.call("reports/roc.pdf", "--config", "track={enabled: false}")
    assert told.returncode == 0, told.stdout
    assert (project / "reports/metrics.json").is_file()
    assert len(_runs(project)) == runs
