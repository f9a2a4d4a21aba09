"""What is made when it is asked for: pages beside the default run, further sources."""

import numpy as np
import pytest
from workflow.conftest import jobs
from workflow.jobs import OBJECTS, each

from pipeline.artefacts import read_table
from pipeline.report.accuracy import read_truth
from pipeline.report.warping import scores
from pipeline.report.warping_page import MEASURES
from pipeline.warp.methods import METHODS


def test_the_pages_on_physics_are_made_when_they_are_asked_for(project):
    """And the engines that they compare with are the other ones."""
    others = each("simulate_pouring_other") | each("simulate_filling_other")
    page = each("physics_object") | others | {"physics_references", "report_physics"}
    assert project.planned("reports/physics.pdf") == page
    engines = {"liquid", "bullet", "bullet_fluid"}
    for key in engines:
        project.configure("simulate.engine", key)
        told = project.plan("-p", "reports/physics.pdf")
        commands = [line for line in told.splitlines() if "python -m pipeline.simulate " in line]
        for other in engines - {key}:
            assert sum(f"--engine {other} " in line for line in commands) == len(others)


def test_ablations_are_made_when_they_are_asked_for_and_reuse_what_their_key_does_not_move(project):
    told = project.plan("-p", "reports/ablations.pdf")
    planned = jobs(told)
    assert {"report_ablations", "ablate_labels wide_bowl"} <= planned
    assert not {job for job in planned if job.split()[0].startswith(("fuse", "label", "simulate", "warp"))}
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
    told = project.plan("-p", "reports/warping.pdf")
    compared = each("warp_by", targets) | each("parametrise_by", targets)
    assert jobs(told) == compared | {"report_warping"}
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
    further = set().union(*(each(stage) for stage in stages))
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
