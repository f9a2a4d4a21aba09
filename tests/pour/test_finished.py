"""`pour` on a workflow that has run: what it says is what the stages' files say."""

import json
import math
import subprocess
import sys

import numpy as np
import pytest
from browser import opened
from pour.served import serving
from workflow.conftest import finished

from pipeline.artefacts import read_json, read_table
from pipeline.predictions import Predictor

__all__ = ["finished"]
OBJECTS = ("mug", "short_cup", "wide_bowl")
ASKED = ("--fill", "60%", "--tilt", "45")


@pytest.fixture(scope="module")
def project(finished):
    """Return the finished project with its overlay as configuration; only to be read."""
    return finished


def _call(project, *words) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "pipeline.pour", *words, "--project", str(project.folder)]
    return subprocess.run(command, capture_output=True, text=True)


def _json(project, *words) -> dict:
    told = _call(project, *words, "--json")
    assert (told.returncode, told.stderr) == (0, "")
    return json.loads(told.stdout)


def _parameters(project):
    table = read_table(project / "data/processed/parametrise/mug/parameters.parquet", "parameters")
    return table[table["mapping"] == "label_mapping"].set_index("object")


def test_a_pour_is_predicted_as_in_python_and_with_the_parameters_behind_it(project):
    found, held = _json(project, "predict", "short_cup", *ASKED), _parameters(project).loc["short_cup"]
    fill_m3 = 0.6 * held["capacity_m3"]
    assert found["features"] == pytest.approx(
        {"tilt": math.pi / 4 / held["tilt_reference_rad"], "fill": fill_m3 / held["volume_m3"]}
    )
    predictor = Predictor(project / "data/processed", "mug", training_object="mug")
    same = predictor.pouring("short_cup", fill_m3=fill_m3, tilt_rad=math.pi / 4)
    assert (found["probability"], found["spread"]) == pytest.approx((same.probability, same.spread))
    assert found["n_classifiers"] == 3  # draws of the overlay
    said = _call(project, "predict", "short_cup", *ASKED)
    assert (said.returncode, said.stderr) == (0, "")
    assert f"pours with probability {found['probability']:.2f}" in said.stdout


def test_what_is_predicted_is_what_was_simulated(project):
    """Over an object's own trials the classifiers of another object tell pours from others."""
    trials = read_table(project / "data/processed/simulate/pouring/wide_bowl/trials.parquet", "trials")
    predictor = Predictor(project / "data/processed", "mug", training_object="mug")
    asked = zip(trials["fill_m3"], trials["tilt_rad"], strict=True)
    p = np.array(
        [predictor.pouring("wide_bowl", fill_m3=fill, tilt_rad=tilt).probability for fill, tilt in asked]
    )
    poured = trials["poured"].to_numpy()
    assert p[poured].mean() > 0.5 > p[~poured].mean()
    assert p[poured].mean() - p[~poured].mean() > 0.35


def test_a_filling_is_predicted_by_classifiers_of_the_object_that_is_named(project):
    words = ("predict", "short_cup", *ASKED[:2], "--tilt", "120", "--into", "wide_bowl", "--into-fill", "20%")
    own, other = (_json(project, *words, "--learnt-from", name) for name in ("mug", "short_cup"))
    assert (own["experiment"], own["into"]) == ("filling", "wide_bowl")
    assert set(own["features"]) == {"tilt", "fill", "second_fill", "height", "along", "across"}
    assert own["features"] == other["features"]
    assert own["probability"] != other["probability"]
    radius_m = own["parameters"]["second"]["radius_m"]
    assert own["variables"]["abs_dx_m"] == radius_m
    assert "fill" in own["beyond"]  # the trials' cups hold ten particles
    assert "fill" not in _json(project, *words[:2], "--fill", "20ml", *words[4:])["beyond"]
    point = _json(project, *words, "--mapping", "point_mapping")
    assert point["parameters"]["second"] != own["parameters"]["second"]


@pytest.mark.parametrize("name", OBJECTS)
def test_every_object_is_shown_as_it_was_scanned_and_measured(project, name):
    found, row = _json(project, "show", name), _parameters(project).loc[name]
    assert found["source"] == (name == "mug")
    assert found["scan"]["n_views"] == 16
    assert (
        found["scan"]["residual_m"]
        == read_json(project / f"data/processed/fuse/{name}/fusion.json")["residual_m"]
    )
    assert found["parameters"]["label_mapping"]["capacity_m3"] == row["capacity_m3"]
    assert 0.9 < found["parts"]["container"] <= 1.0 if name != "mug" else found["parts"]["handle"] > 0.05
    said = _call(project, "show", name).stdout
    assert f"{row['radius_m'] * 1e3:.1f} mm" in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("predict", "shortcup", *ASKED), "did you mean 'short_cup'?"),
        (("predict", "short_cup", *ASKED, "--into", "wide_bow"), "did you mean 'wide_bowl'?"),
        (("predict", "short_cup", *ASKED, "--learnt-from", "mag"), "did you mean 'mug'?"),
        (("show", "short_cups"), "did you mean 'short_cup'?"),
        (("view", "mug", "wide_bol"), "did you mean 'wide_bowl'?"),
        (("annotate", "mugg"), "did you mean 'mug'?"),
        (("show", "tall_cup"), "run: snakemake -c2 data/processed/fuse/tall_cup/fusion.json"),
    ],
)
def test_mistakes_end_with_one_sentence_and_exit_code_1(project, words, said):
    told = _call(project, *words, "--json")
    assert (told.returncode, told.stdout, told.stderr.count("\n")) == (1, "", 1)
    assert said in told.stderr


def test_options_that_are_wrong_end_with_exit_code_2(project):
    for words in (("predict", "mug"), ("predict", "mug", *ASKED, "--mapping", "mine"), ("pour", "mug")):
        assert _call(project, *words).returncode == 2


def test_an_object_of_a_finished_run_is_viewed(project, browser):
    with (
        serving(project, "view", "wide_bowl", "mug") as (url, process),
        opened(browser, url, 700, 500) as tab,
    ):
        tab.page.wait_for_selector("#panel[data-shown=wide_bowl]")
        held = _parameters(project).loc["wide_bowl", "capacity_m3"] * 1e6
        told = int(tab.page.locator(".readout").inner_text().split("capacity of ")[1].split(" ml")[0])
        assert told == pytest.approx(held, rel=0.05)
        assert tab.complaints == []
        process.send_signal(2)
        assert json.loads(process.communicate(timeout=20)[0]) == {"objects": ["wide_bowl", "mug"]}
    assert process.returncode == 0
