"""How often drawn trajectories tilt too far outside the opening, where lip and opening really are."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm

from pipeline.artefacts import write_arrays, write_json
from pipeline.execute import primitives, safety
from pipeline.motion.promp import ProMP

RIM = np.column_stack([np.cos(np.linspace(0, 2 * np.pi, 72)), np.sin(np.linspace(0, 2 * np.pi, 72))])


def container(path, radius_m, height_m):
    rim = np.column_stack([radius_m * RIM, np.full(72, height_m)])
    write_arrays(path, {"cavity_rim_m": rim, "cavity_opening_m": np.array([0.0, 0.0, height_m])})
    return path


def row(name, mapping, radius, height, lip_x):
    at = {"lip": (lip_x, 0.0, height), "opening": (0.0, 0.0, height), "centre": (0.0, 0.0, height / 2)}
    places = {f"{what}_{axis}_m": v for what, p in at.items() for axis, v in zip("xyz", p, strict=True)}
    return {"object": name, "mapping": mapping, "radius_m": radius, "height_m": height, **places}


# The point mapping takes the cup's lip to be 10 mm further in than it is.
PARAMETERS = pd.DataFrame(
    [
        row("cup", "label_mapping", 0.04, 0.12, 0.04),
        row("cup", "point_mapping", 0.04, 0.12, 0.03),
        row("bowl", "label_mapping", 0.08, 0.06, 0.08),
        row("bowl", "point_mapping", 0.08, 0.06, 0.08),
    ]
).assign(tilt_reference_rad=1.0, volume_m3=1e-3)


def standing(x, tilt, x_sd):
    """A primitive that stays where it is: x (±), tilt, in units of the references."""
    n = 4
    mean = np.repeat([x, 0.0, 1.0, tilt], n)
    covariance = np.zeros((4 * n, 4 * n))
    covariance[:n, :n] = x_sd**2
    return ProMP(mean, covariance, np.zeros(4), n, 0.3, units=("1",) * 4, duration_s=1.0)


@pytest.mark.parametrize(("features", "off"), [("label_mapping", 0.0), ("point_mapping", 0.01 * np.cos(1.2))])
def test_the_share_is_that_of_the_distribution_at_the_real_lip(tmp_path, features, off):
    held, target = container(tmp_path / "cup.npz", 0.04, 0.12), container(tmp_path / "bowl.npz", 0.08, 0.06)
    write_json(tmp_path / "promp.json", standing(-1.1, 1.2, 0.2).to_json())
    one = primitives.read(tmp_path / "promp.json", PARAMETERS, features, ("cup", "bowl"), ("cup", "bowl"))
    found = safety.tilted_outside(one, held, target, PARAMETERS, 20_000, np.random.default_rng(1))
    x = norm(-1.1 * 0.08 + off, 0.2 * 0.08)
    expected = x.cdf(-0.08) + x.sf(0.08)
    assert found["way_in"] == pytest.approx(expected, abs=0.012)
    assert found["ever"] == pytest.approx(expected, abs=0.012)


def test_an_upright_cup_is_safe_anywhere(tmp_path):
    held, target = container(tmp_path / "cup.npz", 0.04, 0.12), container(tmp_path / "bowl.npz", 0.08, 0.06)
    write_json(tmp_path / "promp.json", standing(-3.0, 0.9, 0.2).to_json())
    one = primitives.read(tmp_path / "promp.json", PARAMETERS, "standard", ("cup", "bowl"), ("cup", "bowl"))
    found = safety.tilted_outside(one, held, target, PARAMETERS, 200, np.random.default_rng(1))
    assert (found["way_in"], found["ever"]) == (0.0, 0.0)
