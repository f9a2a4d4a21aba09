"""What cannot be poured from is refused before the first trial; what blows up is recorded and never becomes a label."""

import sys

import numpy as np
import pandas as pd
import pytest
import trimesh
from simulate.test_trials import INNER_M, lathe, prepare

from pipeline import artefacts, command
from pipeline.classify import __main__ as classify
from pipeline.simulate import __main__ as simulate
from pipeline.simulate import draws

TURNS = 12.0  # in the second that a tilt takes: no liquid stays slower than is physical
SAMPLES = 10


def box(x_m: float, y_m: float, z_m: float) -> trimesh.Trimesh:
    mesh = trimesh.creation.box([x_m, y_m, z_m])
    mesh.apply_translation([0.0, 0.0, z_m / 2])
    return mesh


def holed() -> trimesh.Trimesh:
    """Return a cup with a hole of 10 mm radius in its floor."""
    profile = [(0.01, 0), (0.033, 0), (0.033, 0.063), (0.03, 0.063), (0.03, 0.003), (0.01, 0.003), (0.01, 0)]
    return trimesh.creation.revolve(profile, sections=96)


@pytest.mark.parametrize(
    ("name", "mesh"),
    [("plate", box(0.2, 0.2, 0.004)), ("block", box(0.06, 0.06, 0.06)), ("sieve", holed())],
    ids=["plate", "block", "sieve"],
)
def test_what_holds_no_liquid_is_one_sentence_and_no_container(tmp_path, monkeypatch, capsys, name, mesh):
    """And so no trial, whatever the engine: they all start from the container."""
    path, output = str(tmp_path / f"{name}.ply"), tmp_path / "container.npz"
    artefacts.write_mesh(path, (np.array(mesh.vertices), np.array(mesh.faces)))
    words = ["prepare", "--object", name, "--mesh", path, "--container", str(output)]
    monkeypatch.setattr(sys, "argv", ["simulate", *words])
    with pytest.raises(SystemExit) as stopped:
        command.run(simulate.main)
    assert stopped.value.code == 1
    said = capsys.readouterr().err.strip()
    assert said.startswith(f"error: {name}: ")
    assert "\n" not in said
    assert not output.exists()


@pytest.fixture(scope="module")
def violent(tmp_path_factory):
    """The path of trials in which the cup turns up to 12 times in a second."""
    folder = tmp_path_factory.mktemp("violent")
    cup = prepare("cup", lathe(INNER_M, 0.060), folder)
    words = ["pouring", "--object", "cup", "--container", cup, "--trials", "60"]
    ranges = ["--tilt-max-deg", str(360 * TURNS), "--fill-min", "0.02", "--threshold", "40"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["simulate", *words, *ranges, "--trials-table", str(folder / "t.parquet")])
        simulate.main()
    return folder / "t.parquet"


def test_a_trial_that_blows_up_is_recorded_with_its_seed(violent):
    rows = artefacts.read_table(violent, "trials")
    assert 5 < rows.failed.sum() < 55
    assert rows.seed.tolist() == [draws.trial_seed(4, "pouring", "cup", k) for k in range(60)]
    assert not rows[rows.failed].poured.any()
    assert rows[rows.failed].tilt_rad.min() > np.radians(360.0)


def test_a_failed_trial_is_neither_trained_nor_tested_on(violent, tmp_path, monkeypatch):
    rows = artefacts.read_table(violent, "trials")
    point = {f"{what}_{axis}_m": 0.03 for what in ("opening", "lip", "centre") for axis in "xyz"}
    values = {"radius_m": 0.03, "volume_m3": 2e-4, "height_m": 0.06, "tilt_reference_rad": 0.8}
    values |= {"tilt_reference_cavity_rad": 0.8, "wall_m": 0.003}
    parameters = [
        {"object": "cup", "mapping": mapping, "capacity_m3": 2e-4, **values, **point}
        for mapping in ("point_mapping", "label_mapping")
    ]
    rims = [
        {"object": "cup", "mapping": row["mapping"], "tilt_reference_rad": 0.8, "x_m": 0.03, "y_m": 0.0}
        for row in parameters
    ]
    artefacts.write_table(tmp_path / "p.parquet", pd.DataFrame(parameters), "parameters")
    artefacts.write_table(tmp_path / "r.parquet", pd.DataFrame(rims).assign(z_m=0.06), "tilt_references")
    words = ["--experiment", "pouring", "--trials", violent, "--samples", SAMPLES, "--draws", 2]
    words += ["--parameters", tmp_path / "p.parquet", "--tilt-references", tmp_path / "r.parquet"]
    for name in ("predictions", "scores", "curves", "replicates"):
        words += [f"--{name}", tmp_path / f"{name}.parquet"]
    monkeypatch.setattr(sys, "argv", ["classify", *map(str, words)])
    classify.main()
    well = rows[~rows.failed]
    scores = artefacts.read_table(tmp_path / "scores.parquet", "scores")
    learnt = scores[scores.features == "standard"]
    assert (learnt.n_test == len(well) - SAMPLES).all()
    assert (scores[scores.features == "hydrostatic"].n_test == len(well)).all()
    assert (scores[scores.features == "hydrostatic"].n_positive == well.poured.sum()).all()
