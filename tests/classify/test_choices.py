"""What is not the default: Firth's penalty, quadratic terms, cavities, margins, readings of filled."""

import numpy as np
import pandas as pd
import pytest
import trimesh

from pipeline.classify.cavities import margins, with_cavities
from pipeline.classify.features import Parameters
from pipeline.classify.inputs import outcomes
from pipeline.classify.protocol import Protocol, fit
from pipeline.classify.regression import classifier, iterations
from pipeline.geometry.sampling import even_points
from pipeline.simulate.references import references


def test_firth_s_estimate_of_a_two_by_two_table_adds_a_half_to_each_cell():
    """With one binary feature, Jeffreys' prior is half a trial in each cell, also where a cell is empty."""
    x = np.repeat([0.0, 1.0], [12, 8])[:, None]
    y = np.array([True] * 3 + [False] * 9 + [True] * 8)
    fitted = classifier(1.0, "firth").fit(x, y)
    probability = fitted.predict_proba(np.array([[0.0], [1.0]]))[:, 1]
    np.testing.assert_allclose(probability, [3.5 / 13, 8.5 / 9], atol=1e-6)
    assert iterations(fitted)[1]


@pytest.mark.parametrize("penalty", ["ridge", "firth"])
def test_separated_samples_have_a_finite_estimate_that_says_so(penalty):
    x = np.random.default_rng(0).normal(size=(50, 2))
    fitted, told = fit(x, x[:, 0] > 0.1, Protocol(50, 1, 0, penalty=penalty), 0)
    assert told["separable"]
    assert told["converged"]
    assert np.abs(fitted[-1].coef_).max() < 100.0


def test_quadratic_terms_learn_what_no_plane_separates():
    x = np.random.default_rng(0).normal(size=(200, 2))
    y = x[:, 0] * x[:, 1] > 0.0
    accuracy = {
        terms: (classifier(1.0, terms=terms).fit(x, y).predict(x) == y).mean()
        for terms in ("linear", "quadratic")
    }
    assert accuracy["quadratic"] > 0.9 > 0.7 > accuracy["linear"]


def cylinder() -> tuple[Parameters, trimesh.Trimesh]:
    """Return a cylinder of 37 × 97 mm inside with walls of 3 mm, and parameters as of its outer hull."""
    inside = references()[0].inner_m + [0.0, 0.003]
    outline = np.vstack([[(0.0, 0.0), (0.040, 0.0), (0.040, 0.100)], inside[::-1]])
    mesh = trimesh.creation.revolve(outline, sections=96)
    azimuth = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    rim = pd.DataFrame({"x_m": 0.0385 * np.cos(azimuth), "y_m": 0.0385 * np.sin(azimuth), "z_m": 0.100})
    row = {"volume_m3": np.pi * 0.040**2 * 0.100, "opening_x_m": 0.0, "opening_y_m": 0.0, "opening_z_m": 0.1}
    return Parameters(pd.DataFrame({"can": row}).T, {"can": rim.assign(tilt_reference_rad=1.0)}), mesh


def test_the_cavity_s_volume_and_tilt_reference_are_those_of_a_cylinder():
    """Half of a cylinder is above its lip when the liquid's plane goes through lip and floor's edge: tan θ = height / diameter."""
    hull, mesh = cylinder()
    found = with_cavities(hull, {"can": (np.asarray(mesh.vertices), np.asarray(mesh.faces))})
    assert found.table.loc["can", "volume_m3"] == pytest.approx(np.pi * 0.037**2 * 0.097, rel=0.01)
    expected = np.arctan2(0.097, 0.037 + 0.0385 - 0.0015)
    np.testing.assert_allclose(found.references["can"]["tilt_reference_rad"], expected, atol=np.radians(2.0))
    assert hull.table.loc["can", "volume_m3"] > found.table.loc["can", "volume_m3"]


def test_the_margin_of_a_tilted_cylinder():
    """Up to tan θ = height / diameter what leaves is a wedge of half the circle's area times its height: r³ π tan θ."""
    parameters, mesh = cylinder()
    cloud, _ = even_points(np.asarray(mesh.vertices), np.asarray(mesh.faces), 5000, np.random.default_rng(0))
    cloud = pd.DataFrame(cloud, columns=["x_m", "y_m", "z_m"]).assign(valid=True, container=True)
    tilts = np.radians([0.0, 20.0, 40.0])
    table = pd.DataFrame({"object": "can", "tilt_rad": tilts, "fill_m3": 2e-4})
    table[["lip_x_m", "lip_y_m", "lip_z_m"]] = [0.0400, 0.0, 0.100]
    radius, height, volume = 0.040, 0.100, np.pi * 0.040**2 * 0.100
    kept = 1.0 - np.pi * radius**3 * np.tan(tilts) / (np.pi * radius**2 * height)
    np.testing.assert_allclose(margins(table, parameters, {"can": cloud}), 2e-4 / volume - kept, atol=0.03)


def test_three_readings_of_filled():
    counts = {"n_left": [10, 9, 10, 8, 0], "n_spilled": [0, 0, 1, 8, 0], "n_leaked": 0}
    table = pd.DataFrame({**counts, "filled": [True, False, False, False, False]})
    assert list(outcomes(table, "filling", "none_outside")) == [True, False, False, False, False]
    assert list(outcomes(table, "filling", "none_spilled")) == [True, True, False, False, True]
    assert list(outcomes(table, "filling", "some_arrive")) == [True, True, True, False, False]
