"""The stage: from files of demonstrations to promp.json, and the figure."""

import json
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from motion import pours

from pipeline.artefacts import read_table, write_table
from pipeline.motion.conditioned import ConditionedProMP, log_parameters
from pipeline.motion.promp import ProMP
from pipeline.report import primitives as report

FEATURES = ["label_mapping", "point_mapping", "standard"]
RADIUS_M, HEIGHT_M, TILT_RAD = 0.08, 0.12, 1.0


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """Return a folder with ten demonstrations and the tables of warped parameters."""
    folder = tmp_path_factory.mktemp("inputs")
    pours.write(folder / "shown", [pours.pour(seed, length_s=4.0 + 0.1 * seed) for seed in range(10)])
    zero = {f"{what}_{axis}_m": 0.0 for what in ("opening", "lip", "centre") for axis in "xyz"}
    own = {"volume_m3": 1e-3, "capacity_m3": 1e-3, "tilt_reference_cavity_rad": 1.0, "wall_m": 0.003, **zero}
    cup = {"height_m": HEIGHT_M, "tilt_reference_rad": TILT_RAD, "radius_m": 0.04}
    bowl = {"height_m": 0.06, "tilt_reference_rad": 0.3, "radius_m": RADIUS_M}
    rows = [
        {"object": name, "mapping": mapping, **own, **values}
        for name, values in (("tall_cup", cup), ("wide_bowl", bowl))
        for mapping in FEATURES[:2]
    ]
    write_table(folder / "parameters.parquet", pd.DataFrame(rows), "parameters")
    rim = {"object": "tall_cup", "mapping": "label_mapping", "x_m": 0.04, "y_m": 0.0, "z_m": 0.12}
    rims = pd.DataFrame([{**rim, "tilt_reference_rad": TILT_RAD}])
    write_table(folder / "rims.parquet", rims, "tilt_references")
    return folder


def _call(inputs, output, features="label_mapping", shown="shown"):
    words = ["--demonstrations", inputs / shown, "--parameters", inputs / "parameters.parquet"]
    words += ["--tilt-references", inputs / "rims.parquet", "--features", features, "--seed", "1"]
    words += ["--primitive", output / "promp.json", "--trajectories", output / "demonstrations.parquet"]
    return subprocess.run(
        [sys.executable, "-m", "pipeline.primitives", *map(str, words)], capture_output=True, text=True
    )


@pytest.fixture(scope="module")
def outputs(inputs):
    """Return the folder of the primitives of all feature sets."""
    for features in FEATURES:
        told = _call(inputs, inputs / features, features)
        assert told.returncode == 0, told.stderr
    return inputs


def test_primitives_are_divided_by_the_references_of_the_pair(outputs):
    at = np.linspace(0.0, 1.0, 50)
    warped, standard = (
        ProMP.from_json(json.loads((outputs / name / "promp.json").read_text())) for name in FEATURES[::2]
    )
    assert warped.units == ("1",) * 4
    assert standard.units == ("m", "m", "m", "rad")
    back = warped.scaled(np.array([RADIUS_M, RADIUS_M, HEIGHT_M, TILT_RAD]))
    assert back.mean(at) == pytest.approx(standard.mean(at), abs=1e-4)
    assert standard.mean(at)[0] == pytest.approx([-0.24, 0.0, 0.15, 0.0], abs=0.015)
    # The rests are cut off, and the pours take 4.45 s on average.
    assert 4.0 < warped.duration_s < 4.46


def test_the_same_call_writes_the_same_bytes(outputs, tmp_path):
    assert _call(outputs, tmp_path).returncode == 0
    for name in ("promp.json", "demonstrations.parquet"):
        assert (tmp_path / name).read_bytes() == (outputs / FEATURES[0] / name).read_bytes()


def test_several_pairs_give_a_primitive_that_knows_them_apart(inputs, tmp_path):
    pair = "held_object: tall_cup\ntarget_object: tall_cup\n"
    higher = [(t, values + [0.02, 0.0, 0.05, 0.0]) for t, values in map(pours.pour, range(10, 16))]
    pours.write(inputs / "other", higher, pair)
    words = ["--demonstrations", inputs / "shown", inputs / "other", "--primitive", tmp_path / "promp.json"]
    words += ["--parameters", inputs / "parameters.parquet", "--tilt-references", inputs / "rims.parquet"]
    call = [sys.executable, "-m", "pipeline.primitives.conditioned", *map(str, words)]
    subprocess.run(call, check=True)
    content = json.loads((tmp_path / "promp.json").read_text())
    assert (content["learnt_from"]["pours"], content["learnt_from"]["pairs"][0]) == (16, "tall_cup/wide_bowl")
    learnt = ConditionedProMP.from_json(content)
    parameters = read_table(inputs / "parameters.parquet", "parameters")
    at = np.linspace(0.0, 1.0, 50)
    shown, other = (
        learnt.given(log_parameters(parameters, "label_mapping", "tall_cup", name)).mean(at)
        for name in ("wide_bowl", "tall_cup")
    )
    assert (other - shown)[:, 2] == pytest.approx(0.05, abs=0.02)
    assert (other - shown).mean(axis=0)[:3] == pytest.approx([0.02, 0.0, 0.05], abs=0.01)
    alone = subprocess.run([*call[:4], *call[5:]], capture_output=True, text=True)
    assert alone.returncode == 1
    assert "at least two pairs" in alone.stderr


def test_mistakes_end_the_call_with_one_sentence_and_no_file(inputs, tmp_path):
    pours.write(inputs / "one", [pours.pour(0)])
    told = _call(inputs, tmp_path, shown="one")
    assert told.returncode == 1
    assert told.stderr.startswith("error: ")
    assert "at least two demonstrations" in told.stderr
    assert "Traceback" not in told.stderr
    assert not list(tmp_path.iterdir())
    pair = "held_object: vase\ntarget_object: wide_bowl\n"
    pours.write(inputs / "vase", [pours.pour(seed) for seed in range(2)], pair)
    told = _call(inputs, tmp_path, shown="vase")
    assert told.returncode == 1
    assert "vase: expected one row of warped parameters" in told.stderr


def test_figure_and_numbers(outputs, tmp_path):
    paths = {
        option: [str(outputs / features / name) for features in FEATURES]
        for option, name in (("--primitives", "promp.json"), ("--trajectories", "demonstrations.parquet"))
    }
    words = [word for option, files in paths.items() for word in (option, *files)]
    written = ["--pages", str(tmp_path / "promp.pdf"), "--numbers", str(tmp_path / "promp.json")]
    subprocess.run([sys.executable, "-m", "pipeline.report.primitives", *words, *written], check=True)
    found = json.loads((tmp_path / "promp.json").read_text())
    assert (tmp_path / "promp.pdf").read_bytes().startswith(b"%PDF")
    for features in FEATURES:
        assert found[f"primitives.{features}.pours"] == 10
        assert 0.88 < found[f"primitives.{features}.left_out_coverage"] < 0.99
        # Tilting begins when the lip is there; on the way back the cup is still tilted.
        assert found[f"primitives.{features}.tilted_outside.way_in"] < 0.01
        assert found[f"primitives.{features}.tilted_outside.ever"] > 0.5


def test_the_page_shows_what_was_learnt(outputs):
    content = json.loads((outputs / FEATURES[0] / "promp.json").read_text())
    promp = ProMP.from_json(content)
    shown = read_table(outputs / FEATURES[0] / "demonstrations.parquet", "demonstrations")
    figure = report.draw(promp, shown, content["learnt_from"], np.ones(4))
    x, _, z, tilt = figure.axes
    assert x.lines[10].get_ydata() == pytest.approx(promp.mean(report.PHASE)[:, 0])
    assert [list(line.get_ydata()) for line in x.lines[11:]] == [[-1.0, -1.0]]
    assert all([1.0, 1.0] in [list(line.get_ydata()) for line in axis.lines] for axis in (z, tilt))
    inside = np.abs(promp.mean(report.PHASE)[:, 0]) < 1.0
    marked = x.collections[-1].get_paths()[0].vertices[:, 0]
    assert (marked.min(), marked.max()) == pytest.approx(
        (report.PHASE[inside].min(), report.PHASE[inside].max())
    )
