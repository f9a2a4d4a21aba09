"""The whole workflow on the small overlay: it runs, it is reproducible, and a change reruns what depends on it and no more."""

import os
import sys
from contextlib import contextmanager

import numpy as np
import pytest
import trimesh

from pipeline import command
from pipeline.artefacts import read_json, read_table
from pipeline.report import accuracy, scans
from pipeline.report.accuracy import read_truth
from pipeline.report.warping import scores
from pipeline.report.warping_page import MEASURES
from pipeline.track.store import client
from pipeline.warp.methods import METHODS

OBJECTS = {"mug", "short_cup", "wide_bowl"}
ASSEMBLED = {"assemble_parameters", "assemble_tilt_references"}
ESTIMATED = {"assemble_uncertainties", "draw_parameters"}
REPORTED = {"report", "report_evaluation", "index"}
CLASSIFIED = {"classify pouring", "classify filling"} | REPORTED
LEARNT = {"classify_learning pouring", "classify_learning filling"} | CLASSIFIED
POURED, FILLED = (
    {f"classify {name}", f"classify_learning {name}"} | REPORTED for name in ("pouring", "filling")
)


def _each(rule: str, objects=frozenset(OBJECTS)) -> set[str]:
    return {f"{rule} {name}" for name in objects}


FUSED = _each("fuse") | _each("draw_scan")
LABELLED = {"learn"} | _each("label")
SIMULATED = _each("simulate_pouring") | _each("simulate_filling") | LEARNT
CONTAINED = _each("simulate_container") | SIMULATED | {"draw_parameters"}
COMPARED = _each("accuracy")
PARAMETRISED = _each("parametrise") | ASSEMBLED | COMPARED | LEARNT
UNCERTAIN = _each("uncertainties") | ESTIMATED | COMPARED | {"report", "index"}
WARPED = _each("warp") | PARAMETRISED | UNCERTAIN | {"draw_labels"}


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


def test_one_core_gives_the_same_bytes_as_two(finished, unfinished):
    told = unfinished.call("--config", "track={enabled: false}", cores=1)
    assert told.returncode == 0, told.stdout
    assert not (unfinished / "mlflow.db").exists()
    one, two = unfinished.contents(), finished.contents()
    assert [path for path in {*one, *two} if one.get(path) != two.get(path)] == []


@pytest.mark.parametrize(
    ("key", "value", "jobs"),
    [
        ("scan.noise", 0.5, _each("scan") | FUSED | LABELLED | WARPED | CONTAINED),
        ("fuse.points", 7000, FUSED | LABELLED | WARPED | CONTAINED),
        ("label.ridge", 2.0, LABELLED | WARPED),
        ("warp.k", 2, WARPED),
        # Shapes are learnt from warps by the default method, onto all but the target.
        ("warp.method", "shape_space", WARPED | _each("warp_by", OBJECTS - {"mug"})),
        ("parametrise.hull_points", 3000, PARAMETRISED | UNCERTAIN),
        ("parametrise.redraws", 3, UNCERTAIN),
        ("simulate.seed", 40, SIMULATED),
        ("simulate.spacing_m", 0.015, CONTAINED),
        ("simulate.engine", "bullet", SIMULATED),
        ("simulate.device", "cuda", SIMULATED),
        ("simulate.physics.convergence_trials", 3, set()),
        ("simulate.ranges", "absolute", SIMULATED),
        ("simulate.pouring.tilt_max_deg", 90.0, _each("simulate_pouring") | POURED),
        ("simulate.filling.tilt_deg", 90.0, _each("simulate_filling") | FILLED),
        (
            "simulate.filling.held_objects",
            ["short_cup", "mug"],
            _each("simulate_filling") | FILLED,
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


def test_the_pages_on_physics_are_made_when_they_are_asked_for(project):
    """And the engines that they compare with are the other ones."""
    others = _each("simulate_pouring_other") | _each("simulate_filling_other")
    page = _each("physics_object") | others | {"physics_references", "report_physics"}
    assert project.planned("reports/physics.pdf") == page
    engines = {"liquid", "bullet", "bullet_fluid"}
    for key in engines:
        project.configure("simulate.engine", key)
        told = project.call("-n", "-p", "reports/physics.pdf").stdout
        commands = [line for line in told.splitlines() if "python -m pipeline.simulate " in line]
        for other in engines - {key}:
            assert sum(f"--engine {other} " in line for line in commands) == len(others)


def test_ablations_are_made_when_they_are_asked_for_and_reuse_what_their_key_does_not_move(project):
    planned = project.planned("reports/ablations.pdf")
    assert {"report_ablations", "ablate_labels wide_bowl"} <= planned
    assert not {job for job in planned if job.split()[0].startswith(("fuse", "label", "simulate", "warp"))}
    told = project.call("-n", "-p", "reports/ablations.pdf").stdout
    commands = [line for line in told.splitlines() if "python -m pipeline." in line]
    simulated = [line for line in commands if "pipeline.simulate" in line]
    assert len(simulated) == 2 * len(OBJECTS)
    assert all("--ranges absolute" in line for line in simulated)
    for changed in (
        "--terms quadratic",
        "--penalty firth",
        "--held-cups disjoint",
        "--volume cavity --margin none",
    ):
        assert any(changed in line for line in commands), changed


def test_methods_of_warping_are_compared_when_it_is_asked_for(project):
    targets = OBJECTS - {"mug"}
    compared = _each("warp_by", targets) | _each("parametrise_by", targets)
    assert project.planned("reports/warping.pdf") == compared | {"report_warping"}
    told = project.call("-n", "-p", "reports/warping.pdf").stdout
    warps = [line for line in told.splitlines() if "python -m pipeline.warp " in line]
    assert len(warps) == len(METHODS) * len(targets)
    learning = [line for line in warps if "--examples data" in line]
    assert [("--method shape_space" in line) for line in learning] == [True] * len(targets)
    # Shapes are learnt from the others, never from the target.
    for line in learning:
        called, learnt = line.split(" --examples ")
        target = next(name for name in targets if f"_k1/{name}/warp.npz" in called)
        assert f"{target}/" not in learnt.split(" > ")[0]


def test_a_method_that_leaves_an_object_without_a_rim_is_compared_all_the_same(project):
    """A mug that keeps its size reaches no rim of a wide bowl."""
    path = "data/processed/parametrise/mug/by/rigid_k1/wide_bowl.parquet"
    told = project.call(path, "--config", "track={enabled: false}")
    assert told.returncode == 0, told.stdout
    rows = read_table(project / path, "parameters").set_index("mapping")
    assert np.isnan(rows.loc["label_mapping", ["radius_m", "capacity_m3"]].to_numpy(float)).all()
    processed = project / "data/processed"
    found = scores(processed, "mug", "wide_bowl", "rigid_k1", read_truth(processed, "wide_bowl"))
    assert set(found) == set(MEASURES)
    assert np.isnan(found["radius"])
    assert found["wall_side_flips"] == 0.0 < found["fit_s"]


def test_a_second_source_is_warped_and_measured_beside_the_first(project):
    project.configure("objects.source", ["mug", "short_cup"])
    stages = ("label_from_further", "warp", "parametrise")
    further = set().union(*(_each(stage) for stage in stages))
    assert project.planned() == further | {"adopt_labels", "learn_from_further", "assemble_parameters"}
    told = project.call("data/processed/parametrise/short_cup/parameters.parquet")
    assert told.returncode == 0, told.stdout
    first, second = (
        read_table(project / f"data/processed/parametrise/{name}/parameters.parquet", "parameters")
        .query("mapping == 'label_mapping'")
        .set_index("object")["radius_m"]
        for name in ("mug", "short_cup")
    )
    assert set(second.index) == OBJECTS
    assert second[sorted(OBJECTS)].to_numpy() == pytest.approx(first[sorted(OBJECTS)].to_numpy(), rel=0.03)


def test_two_keys_that_swap_their_values_are_a_change(project):
    project.configure("classify.samples", 3)
    project.configure("classify.draws", 50)
    assert project.planned() == CLASSIFIED


@pytest.mark.parametrize(
    ("module", "jobs"),
    [
        ("scan/camera.py", _each("scan") | FUSED | LABELLED | WARPED | CONTAINED),
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
    assert project.planned() == _of_one("short_cup") | _each("simulate_filling") | {"accuracy short_cup"}


def test_a_changed_annotation_reruns_the_labels(project):
    path = project / "config/annotations/mug.parquet"
    table = read_table(path, "annotation")
    table.iloc[:-1].to_parquet(path, index=False)
    assert project.planned() == LABELLED | WARPED


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


@pytest.mark.parametrize("module", [accuracy, scans])
def test_reports_that_take_seconds_tell_the_step_they_are_at(finished, tmp_path, monkeypatch, module):
    processed, name = finished / "data/processed", "short_cup"
    fused = processed / "fuse" / name
    options = {
        accuracy: ["--processed", processed, "--source", "mug", "--object", name, "--errors"],
        scans: [
            *("--mesh", fused / "mesh.ply", "--cloud", fused / "cloud.parquet"),
            *("--fusion", fused / "fusion.json", "--output"),
        ],
    }[module]
    begun: list[str] = []
    announced: list[int] = []

    @contextmanager
    def steps(what, total):
        assert "short_cup" in what
        announced.append(total)
        yield begun.append

    monkeypatch.setattr(command, "steps", steps)
    monkeypatch.setattr(sys, "argv", ["report", *map(str, options), str(tmp_path / "made.png")])
    module.main()
    assert [len(begun)] == announced
    assert (tmp_path / "made.png").exists()
