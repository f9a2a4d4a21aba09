"""`add`, `show` and `predict` on a project with known parameters, classifiers and meshes."""

import json
import math

import numpy as np
import pandas as pd
import pytest
import trimesh
import yaml
from track.calls import fitted

from pipeline.artefacts import read_mesh, write_json, write_table
from pipeline.errors import PipelineError
from pipeline.models import write_models
from pipeline.pour import quantities
from pipeline.pour.__main__ import main
from pipeline.scan.shapes import shape
from pipeline.schemas import TABLES

VALUES = {
    "tilt_reference_rad": 0.8,
    "volume_m3": 4e-4,
    "height_m": 0.1,
    "radius_m": 0.04,
    "capacity_m3": 3e-4,
}


@pytest.fixture
def project(tmp_path):
    """Return a project with one object that was scanned, measured and learnt from."""
    (tmp_path / "config").mkdir()
    (tmp_path / "data/raw/mug").mkdir(parents=True)
    config = {"objects": {"source": "mug", "exclude": []}, "scan": {"objects": ["mug"]}}
    (tmp_path / "config/config.yaml").write_text(yaml.safe_dump(config))
    processed = tmp_path / "data/processed"
    row = {
        **dict.fromkeys(TABLES["parameters"].names, 0.0),
        "object": "mug",
        "mapping": "label_mapping",
        **VALUES,
    }
    write_table(processed / "parametrise/mug/parameters.parquet", pd.DataFrame([row]), "parameters")
    models = [fitted("mug", "label_mapping", draw)[0] for draw in range(2)]
    write_models(processed / "classify/pouring/models.json", models)
    fusion = {"layout": "7-scenes", "n_views": 36, "watertight": True, "complaints": ["the rim was not seen"]}
    write_json(processed / "fuse/mug/fusion.json", fusion)
    return tmp_path


def _json(capsys, *arguments) -> dict:
    main([*map(str, arguments), "--json"])
    return json.loads(capsys.readouterr().out)


def test_predict_says_what_the_classifiers_say(project, capsys):
    found = _json(capsys, "predict", "mug", "--fill", "60%", "--tilt", "45", "--project", project)
    assert found["features"] == pytest.approx({"tilt": math.pi / 4 / 0.8, "fill": 0.6 * 3e-4 / 4e-4})
    one = [
        fitted("mug", "label_mapping", draw)[1].predict_proba(pd.DataFrame([found["features"]]))[0, 1]
        for draw in range(2)
    ]
    assert (found["probability"], found["spread"]) == pytest.approx((np.mean(one), np.std(one)))
    assert found["parameters"]["held"] == VALUES
    assert found["beyond"] == {}
    main(["predict", "mug", "--fill", "60%", "--tilt", "45", "--project", str(project)])
    assert f"pours with probability {np.mean(one):.2f}" in capsys.readouterr().out


def test_what_nothing_was_learnt_of_is_said(project, capsys):
    main(["predict", "mug", "--fill", "60%", "--tilt", "180", "--project", str(project)])
    said = capsys.readouterr().out  # the trials' tilts are 0.8 ± 0.4
    assert f"beyond what was learnt: tilt of {math.pi / 0.8:.2f}, trials had 0." in said
    assert "fill of" not in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["mugg", "--fill", "60%", "--tilt", "45"], "did you mean 'mug'"),
        (["mug", "--fill", "60", "--tilt", "45"], "expected a number with a unit"),
        (["mug", "--fill", "400ml", "--tilt", "45"], "which are 300 ml"),
        (["mug", "--fill", "60%", "--tilt", "200"], "from 0 to 180 degrees, found 200"),
        (
            ["mug", "--fill", "60%", "--tilt", "45", "--along", "2cm"],
            "--along 2cm: expected a second container",
        ),
        (["mug", "--fill", "60%", "--tilt", "45", "--into-fill", "0%"], "--into-fill 0%: expected a second"),
        (["mug", "--fill", "60%", "--tilt", "45", "--into", "mug"], "another object than the cup"),
    ],
)
def test_predict_refuses_in_one_sentence(project, words, said):
    with pytest.raises(PipelineError, match=said):
        main(["predict", *words, "--project", str(project)])


def test_units():
    assert quantities.volume_m3("150ml", "--fill", 1e-3) == pytest.approx(1.5e-4)
    assert quantities.length_m("-5cm", "--along") == pytest.approx(-0.05)
    assert quantities.angle_rad("0.8rad", "--tilt") == 0.8
    assert quantities.angle_rad("90", "--tilt") == pytest.approx(math.pi / 2)


def test_show_gives_what_there_is(project, capsys):
    found = _json(capsys, "show", "mug", "--project", project)
    assert found["parameters"] == {"label_mapping": VALUES}
    assert (found["source"], found["parts"], found["scan"]["n_views"]) == (True, None, 36)
    main(["show", "mug", "--project", str(project)])
    said = capsys.readouterr().out
    assert "capacity" in said
    assert "parts       not made yet" in said
    assert "told        the rim was not seen" in said


@pytest.fixture
def mesh(tmp_path):
    """Return an STL of the true mug in millimetres."""
    body, path = shape("mug"), tmp_path / "cup.stl"
    trimesh.Trimesh(body.vertices_m * 1000, body.triangles, process=False).export(path)
    return path


def test_add_copies_what_can_be_read_and_says_its_size(project, mesh, capsys):
    arguments = ["add", mesh, "--name", "my_mug", "--units", "mm", "--project", project]
    found = _json(capsys, *arguments)
    assert found["height_m"] == pytest.approx(np.ptp(shape("mug").vertices_m[:, 2]), abs=1e-4)
    folder = project / "data/raw/my_mug"
    assert yaml.safe_load((folder / "scan.yaml").read_text()) == {"units": "mm"}
    assert np.allclose(read_mesh(folder / "cup.stl")[0], read_mesh(mesh)[0])
    with pytest.raises(PipelineError, match="found an object of this name"):
        main([*map(str, arguments)])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--name", "my_mug"], "give --units mm"),
        (["--name", "my_mug", "--units", "mm", "--up", "x"], "give --up z"),
        (["--name", "My-Mug", "--units", "mm"], "expected small letters"),
    ],
)
def test_add_leaves_nothing_of_what_it_refuses(project, mesh, words, said):
    with pytest.raises(PipelineError, match=said):
        main(["add", str(mesh), *words, "--project", str(project)])
    assert [path.name for path in (project / "data/raw").iterdir()] == ["mug"]
