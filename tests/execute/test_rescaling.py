"""Primitives at a pair: what is scaled besides the paper's four dimensions, and how a sample that touches is drawn again."""

import numpy as np
import pandas as pd
import pytest

from pipeline.artefacts import write_json
from pipeline.execute import __main__ as execute
from pipeline.execute import primitives
from pipeline.execute.following import Plan
from pipeline.motion import scaling
from pipeline.motion.promp import ProMP

N = 6
TILTS = np.array([0.0, 0.6, 1.6, 2.2, 2.2, 0.8])
SHOWN = "cup", "wide"


def row(name, radius, height, tilt_rad, volume):
    zero = {f"{what}_{axis}_m": 0.0 for what in ("opening", "lip", "centre") for axis in "xyz"}
    own = {"radius_m": radius, "height_m": height, "tilt_reference_rad": tilt_rad, "volume_m3": volume}
    return {"object": name, "mapping": "label_mapping", **own, **zero, "lip_x_m": radius}


PARAMETERS = pd.DataFrame(
    [
        row("cup", 0.036, 0.130, 1.05, np.pi * 0.036**2 * 0.130),
        row("mug", 0.040, 0.095, 0.90, np.pi * 0.040**2 * 0.095),
        row("wide", 0.073, 0.055, 0.31, 0.00075),
    ]
)


@pytest.fixture
def read(tmp_path):
    """Return what reads one primitive, of units of the references, at a pair."""
    mean = np.concatenate([np.full(N, -0.6), np.zeros(N), np.full(N, 0.4), TILTS])
    covariance = np.kron(np.diag([0.1, 0.1, 0.05, 0.02]) ** 2, np.ones((N, N)))
    promp = ProMP(mean, covariance, np.zeros(4), N, 0.08, units=("1",) * 4, duration_s=6.0)
    write_json(tmp_path / "promp.json", promp.to_json())
    return lambda held, target, features="label_mapping": primitives.read(
        tmp_path / "promp.json", PARAMETERS, features, (held, target), SHOWN
    )


def drawn(primitive, higher=0.0):
    return primitive.samples(np.linspace(0.0, 1.0, 101), 1, np.random.default_rng(3), higher)[0]


def test_of_a_pair_twice_as_large_everything_is_slower_by_the_root_of_two():
    twice = PARAMETERS.assign(radius_m=2 * PARAMETERS["radius_m"], volume_m3=8 * PARAMETERS["volume_m3"])
    one, two = (scaling.pouring_s(table, "label_mapping", *SHOWN) for table in (PARAMETERS, twice))
    assert two / one == pytest.approx(np.sqrt(2.0))


@pytest.mark.parametrize(
    ("foot", "tilt_rad"),
    [(0.0, np.arctan(2.0)), (0.02, np.arctan(4.0)), (0.04, np.pi / 2), (0.05, np.pi / 2)],
)
def test_a_container_is_emptied_where_its_wall_is_level(foot, tilt_rad):
    volume = np.pi * 0.08 * (0.04**2 + 0.04 * foot + foot**2) / 3.0
    table = pd.DataFrame([row("cone", 0.04, 0.08, 0.5, volume)])
    assert scaling.emptied_rad(table, "label_mapping", "cone") == pytest.approx(tilt_rad)


def test_the_demonstrated_pair_and_quicker_ones_are_poured_as_shown(read):
    for held, target in (SHOWN, ("mug", "wide")):
        found = read(held, target)
        assert found.duration_s == 6.0
        assert found.steeper == 1.0
    assert read(*SHOWN).further == 0.0
    standard = read("wide", "mug", "standard")
    assert (standard.duration_s, standard.steeper, standard.further) == (6.0, 1.0, 0.0)


def test_a_narrow_opening_is_poured_into_slowly(read):
    cup, mug = (PARAMETERS.set_index("object").loc[name] for name in ("cup", "mug"))
    assert read("cup", "mug").duration_s == pytest.approx(6.0 * (0.073 / mug["radius_m"]) ** 2.5)
    assert read("wide", "cup").duration_s == pytest.approx(
        6.0 * (0.00075 / cup["volume_m3"]) * (0.073 / cup["radius_m"]) ** 2.5
    )


def test_a_bowl_is_tilted_until_it_is_empty_and_as_shown_before_it_pours(read):
    bowl, cup = drawn(read("wide", "cup"))[:, 3] / 0.31, drawn(read("cup", "wide"))[:, 3] / 1.05
    carried = cup < 1.0
    assert bowl[carried] == pytest.approx(cup[carried])
    level = scaling.emptied_rad(PARAMETERS, "label_mapping", "wide")
    assert bowl.max() * 0.31 == pytest.approx(level, abs=0.1)
    assert cup.max() * 0.31 < 0.75


def test_the_lip_goes_in_by_as_much_as_the_arc_reaches_back(read):
    one = read("wide", "cup")
    assert one.further == pytest.approx(primitives.FLOW_DEPTH * (1.0 / np.sin(0.31) - 1.0 / np.sin(1.05)))
    shift = drawn(one)[:, 0] / 0.036 - drawn(read(*SHOWN))[:, 0] / 0.073
    assert shift == pytest.approx(one.further)


def test_a_sample_drawn_higher_is_the_same_but_for_its_height(read):
    low, high = (drawn(read("wide", "cup"), higher) for higher in (0.0, 3.0))
    lift = high - low
    assert lift[:, [0, 1, 3]] == pytest.approx(0.0)
    assert lift[:, 2] == pytest.approx(3.0 * 0.05 * 0.055)


def test_each_touch_of_the_second_container_raises_the_samples_to_come():
    reasons = iter(
        [
            "the cup touches the second container",
            "joint 2 would turn",
            "link 5 touches the second container",
            "",
        ]
    )
    asked = []

    def sample(attempt, higher):
        asked.append((attempt, higher))
        return np.zeros((2, 4))

    found = [
        plan.refused for _, plan in execute.tried(sample, lambda _: Plan(np.zeros((2, 7)), next(reasons)), 9)
    ]
    assert asked == [(0, 0), (1, 1), (2, 1), (3, 2)]
    assert found[-1] == ""
    assert len(found) == 4


def test_a_draw_ends_after_its_attempts():
    refused = Plan(np.zeros((2, 7)), "the cup touches the table")
    assert len(list(execute.tried(lambda *_: np.zeros((2, 4)), lambda _: refused, 3))) == 3
