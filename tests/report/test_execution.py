"""Rates, intervals and safety of executions."""

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from pipeline.report import execution_numbers as numbers
from pipeline.report import pairs, robot_claims
from pipeline.report.execution import write_gif
from pipeline.report.execution_page import Film, pictures, rates, safety_table


def executions(pairs_successes, features="label_mapping", n=10):
    rows = []
    for (held, target), successes in pairs_successes.items():
        for draw in range(n):
            well = draw < successes
            counts = {"n_balls": 105, "n_poured": 105, "n_spilled": 0 if well else 21, "n_refused": 1}
            names = {"held_object": held, "target_object": target, "features": features, "draw": draw}
            rows.append({**names, **counts, "success": well, "cause": "" if well else "aim", "fits": True})
    return pd.DataFrame(rows)


def test_wilsons_interval_is_the_tabled_one():
    assert numbers.wilson(10, 10) == pytest.approx((0.7225, 1.0), abs=1e-4)
    assert numbers.wilson(5, 10) == pytest.approx((0.2366, 0.7634), abs=1e-4)


def test_intervals_take_a_pair_for_one_observation():
    split = executions({("a", "b"): 10, ("c", "d"): 0})
    even = executions({("a", "b"): 5, ("c", "d"): 5})
    assert numbers.clustered(split) == (0.0, 1.0)
    assert numbers.clustered(even) == (0.5, 0.5)


def test_a_pairs_row_counts_successes_refusals_and_causes():
    row = numbers.by_pair(executions({("a", "b"): 8})).iloc[0]
    assert (row["n"], row["successes"], row["causes"]) == (10, 8, "aim 2")
    assert row["refused_share"] == pytest.approx(0.5)
    assert row["spilled_share"] == pytest.approx(2 * 21 / 1050)


def test_a_refused_sample_counts_both_ways():
    refused = executions({("a", "b"): 8})
    followed = executions({("c", "b"): 10}).assign(n_refused=0)
    found = numbers.numbers(pd.concat([refused, followed]), drawn_and_executed([]), ("c", "b"))
    key = "execution.label_mapping"
    assert (found[f"{key}.success"], found[f"{key}.first_sample"]) == (0.9, 0.5)
    assert (found[f"{key}.novel.success"], found[f"{key}.novel.first_sample"]) == (0.8, 0.0)
    assert found[f"{key}.refused_share"] == pytest.approx(1 / 3)
    assert (found[f"{key}.first_sample_low"], found[f"{key}.first_sample_high"]) == (0.0, 1.0)


def drawn_and_executed(executed):
    names = ["held_object", "target_object", "features"]
    drawn = pd.DataFrame([("a", "b", name, 100, 0.02, 1.0) for name in ("standard", "conditioned")])
    drawn.columns = [*names, "samples", "way_in", "ever"]
    return numbers.with_drawn(pd.DataFrame(executed, columns=[*names, "way_in", "ever"]), drawn)


def test_safety_is_told_of_drawn_trajectories_and_of_executions_where_there_are_any():
    safety = drawn_and_executed([("a", "b", "standard", 0.1, 0.9)])
    found = numbers.numbers(executions({("a", "b"): 8}), safety, ("a", "b"))
    key = "execution.standard.a.b.tilted_outside"
    assert (found[f"{key}.way_in"], found[f"{key}.drawn_way_in"]) == (0.1, 0.02)
    assert "execution.conditioned.a.b.tilted_outside.way_in" not in found
    table = safety_table(safety).axes[0].tables[0]
    assert [table[1, column].get_text().get_text() for column in (0, 1)] == ["2.0 / 10", "2.0 / –"]


def trajectory(x_m, tilt_rad, draw=0):
    frame = pd.DataFrame({"lip_x_m": x_m, "lip_y_m": 0.0, "tilt_rad": tilt_rad, "draw": draw})
    return frame.assign(held_object="cup", target_object="bowl", features="standard")


def test_a_tilt_above_its_reference_outside_the_opening_is_unsafe_on_the_way_in_or_back():
    parameters = pd.DataFrame(
        {
            "object": ["cup", "bowl"],
            "mapping": "label_mapping",
            "radius_m": [0.03, 0.05],
            "tilt_reference_rad": [1.0, 0.4],
        }
    )
    x_m = np.array([-0.2, -0.06, -0.02, -0.02, -0.07])
    runs = [
        trajectory(x_m, [0.0, 0.9, 1.2, 2.0, 0.5]),
        trajectory(x_m, [0.0, 0.9, 1.2, 2.0, 1.5], 1),
        trajectory(x_m, [0.0, 1.1, 1.2, 2.0, 0.5], 2),
        trajectory(x_m, [0.0, 0.5, 0.8, 0.8, 0.5], 3),
    ]
    row = numbers.unsafe(pd.concat(runs), parameters).iloc[0]
    assert (row["way_in"], row["ever"]) == (0.25, 0.5)


def robot(novel: int, way_in: float, off_m: float) -> pd.DataFrame:
    """Return the robot's claims of a demonstrated and two novel pairs: successes of ten pours of one, tilts, where drops fall."""
    poured = executions({("cup", "bowl"): 0, ("mug", "bowl"): 10, ("jug", "bowl"): novel}).assign(
        first_drop_s=1.0
    )
    paths = [
        pd.DataFrame(
            {"t_s": [0.0, 1.0, 2.0], "lip_x_m": [-0.2, -off_m, -0.2], "lip_y_m": 0.0, "draw": draw}
        ).assign(held_object=held, target_object="bowl", features="label_mapping")
        for held in ("cup", "mug", "jug")
        for draw in range(10)
    ]
    parameters = pd.DataFrame({"object": ["bowl"], "mapping": "label_mapping", "radius_m": [0.05]})
    safety = poured[["held_object", "target_object", "features"]].drop_duplicates().assign(way_in=way_in)
    return robot_claims.claim_rows(poured, pd.concat(paths), safety, parameters, ("cup", "bowl")).set_index(
        "name"
    )


def test_the_papers_claims_about_the_robot_are_told_of_the_pairs_they_are_about():
    rows = robot(novel=10, way_in=0.001, off_m=0.04)
    assert list(rows["holds"]) == [True] * len(robot_claims.CLAIMS)
    assert rows["sure"].all()
    assert (
        rows.loc["robot_pours_novel_objects", "value"] == 1.0
    )  # the demonstrated pair fails, and is not asked
    worse = robot(novel=6, way_in=0.1, off_m=0.01)
    assert list(worse["holds"]) == [False] * len(robot_claims.CLAIMS)
    assert worse.loc["robot_spills_a_couple", "value"] == pytest.approx(21 * 0.4 / 2)
    assert not worse.loc["robot_pours_novel_objects", "sure"]
    assert worse.loc["robot_pours_near_the_rim", "value"] == 0.0


def test_every_pair_that_fails_is_listed_with_the_causes_of_each_set():
    label = executions({("a_b", "c"): 9, ("d", "c"): 10, ("e", "c"): 10})
    standard = executions({("a_b", "c"): 10, ("d", "c"): 3, ("e", "c"): 10}, "standard")
    none = executions({("f", "c"): 0}, "standard").assign(fits=False)
    (page,) = pairs.failures(pd.concat([label, standard, none]))
    texts = [text.get_text() for text in page.texts]
    heads = [text for text in texts if text.startswith(("label mapping", "standard"))]
    assert heads == ["label mapping\n97 % [90, 100]", "standard features\n77 % [30, 100]"]
    assert texts[-6:] == ["a b → c", "9: aim 1", "", "d → c", "", "3: aim 7"]


def test_pages_are_drawn_of_any_number_of_pairs_and_sets():
    both = pd.concat(
        [executions({("a", "b"): 9, ("c", "b"): 3}, name) for name in ("label_mapping", "standard")]
    )
    safety = both[["held_object", "target_object", "features"]].drop_duplicates().assign(way_in=0.1, ever=0.5)
    assert len(rates(both, safety).axes) == 3
    film = Film("a into\nb", "105 of 105", np.zeros((5, 4, 6, 3), np.uint8), 0.1, 0.2)
    assert len(pictures([film, film]).axes) == 6
    maps = pairs.maps(both)
    shown = maps.axes[0].images[0].get_array()
    assert shown[0, 1] == pytest.approx(100 * 21 / 1050)  # one of ten spilled 21 of 105
    assert shown.mask[1, 1]
    assert {text.get_text() for text in maps.axes[0].texts} == {"9", "3"}
    found = pairs.numbers(both)
    assert found["pairs.standard.fit.success"] == pytest.approx(0.6)
    assert found["pairs.standard.fit.failed.aim"] == 8


def test_the_film_is_as_long_as_its_longest_and_tells_what_it_is_at(tmp_path):
    ramp = np.tile(np.linspace(0, 255, 60, dtype=np.uint8)[:, None], (40, 1, 3))
    moving = np.stack([np.roll(ramp, 7 * k, axis=1) for k in range(5)])
    short, long = (Film("a into\nb", "", moving[:n], 0.1, 0.2) for n in (2, 5))
    told: list[str] = []
    write_gif(tmp_path / "film.gif", [short, long], told.append)
    assert told == ["films side by side", "making them smaller", "writing the film"]
    with Image.open(tmp_path / "film.gif") as film:
        assert film.n_frames == 5
        assert film.size == (720, 240)
