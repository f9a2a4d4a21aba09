"""The comparison of warping methods: its numbers, what counts as a bar reached, and that gaps are shown as gaps."""

from pathlib import Path

import numpy as np
import pytest
from conftest import PARTS, sampled

from pipeline.artefacts import read_table, write_json, write_table
from pipeline.report import warping
from pipeline.report.accuracy import parameter_errors, read_truth
from pipeline.report.warping import numbers
from pipeline.report.warping_page import COLUMNS, MEASURES, bars_met, matrices, over_targets, overview
from pipeline.scan import truth
from pipeline.scan.shapes import shape

ASKED = [key for key, measure in MEASURES.items() if measure.bar is not None]


def scores(**changed: float) -> dict[str, float]:
    """Return scores that reach every bar, but for those named."""
    good = {key: (1.0 if measure.higher else 0.0) for key, measure in MEASURES.items()}
    return {**good, **changed}


def found() -> dict:
    """Return a method that reaches every bar, and one that leaves an object without a rim."""
    nan = float("nan")
    lost = scores(**dict.fromkeys(("radius", "opening_mm", "height", "hull_volume"), nan), rim_iou=0.0)
    return {
        "good": {"jug": scores(), "cup": scores(handle_iou=nan)},
        "bad": {"jug": scores(residual_mm=6.0), "cup": lost},
    }


def test_bars_are_those_of_the_mean_or_of_the_worst_target():
    both = found()
    assert bars_met(both["good"]) == len(ASKED)
    # Mean residual 3 mm, mean IoU 0.5, and four parameters that one object lacks.
    assert bars_met(both["bad"]) == len(ASKED) - 6
    assert over_targets(both["bad"], "residual_mm") == {"mean": 3.0, "worst": 6.0}
    assert over_targets(both["bad"], "rim_iou") == {"mean": 0.5, "worst": 0.0}
    assert over_targets(both["good"], "handle_iou") == {"mean": 1.0, "worst": 1.0}


def test_numbers_are_finite_and_name_method_target_and_measure():
    flat = numbers(found())
    assert all(np.isfinite(value) for value in flat.values())
    assert flat["warping.bad.jug.residual_mm"] == 6.0
    assert flat["warping.bad.residual_mm.worst"] == 6.0
    assert "warping.bad.cup.radius" not in flat
    assert "warping.bad.radius.mean" not in flat
    assert flat["warping.good.bars_met"] == len(ASKED)


def test_the_overview_says_how_many_bars_each_method_reaches_and_where_parameters_lack():
    figure = overview(found(), "mug")
    names = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert names == [f"good ({len(ASKED)} of {len(ASKED)})", f"bad ({len(ASKED) - 6} of {len(ASKED)})"]
    titles = [axis.get_title() for axis in figure.axes]
    radius = figure.axes[list(MEASURES).index("radius")]
    assert titles[list(MEASURES).index("radius")] == "radius: error, % (worst)"
    assert [text.get_text() for text in radius.texts] == ["none on some"]


def test_the_matrices_have_every_target_and_a_dash_where_there_is_no_number():
    figure = matrices(found())
    radius = figure.axes[list(MEASURES).index("radius")]
    assert [text.get_text() for text in radius.texts] == ["0.0", "0.0", "0.0", "–"]
    rim = figure.axes[list(MEASURES).index("rim_iou")]
    assert [text.get_text() for text in rim.texts] == ["1.00", "1.00", "1.00", "0.00"]
    assert rim.get_ylim() == pytest.approx((2, 0))


def test_the_matrices_stand_in_even_rows():
    figure = matrices(found())
    figure.canvas.draw()
    first, second, third = (figure.axes[row * COLUMNS].get_position() for row in range(3))
    assert second.y0 - third.y1 == pytest.approx(first.y0 - second.y1, abs=0.01)


def compared(processed: Path, **changed: float) -> dict[str, float]:
    """Return the scores of a warp whose labels and parameters are a cup's true ones, but for those named."""
    body, table = shape("short_cup"), sampled("short_cup")
    warp = processed / "warp/mug/by/some_k1/short_cup"
    rows = range(len(table))
    names = ["x_m", "y_m", "z_m", "nx", "ny", "nz", "area_m2", *PARTS]
    mapped = table[names].assign(source_index=rows, target_index=rows, valid=True)
    own = {"residual_m": 0.001, "share_without_candidate": 0.0, "wall_side_flips": 0.0}
    opening_m, lip_m = body.lip_edge_m.mean(axis=0), body.lip_edge_m[0]
    row = {
        "radius_m": np.linalg.norm(lip_m - opening_m),
        **{"volume_m3": body.hull_volume_m3, "height_m": body.height_m, "capacity_m3": body.capacity_m3},
        **{"wall_m": body.wall_m, "tilt_reference_rad": 0.8, "tilt_reference_cavity_rad": 0.8},
        **{f"opening_{axis}_m": value for axis, value in zip("xyz", opening_m, strict=True)},
        **{f"lip_{axis}_m": value for axis, value in zip("xyz", lip_m, strict=True)},
        **{f"centre_{axis}_m": 0.0 for axis in "xyz"},
    } | changed
    columns = {"object": ["short_cup"], "mapping": ["label_mapping"]} | {
        key: [value] for key, value in row.items()
    }
    truth.write(processed / "scan/short_cup", body, np.eye(4), np.random.default_rng(1))
    write_json(processed / "fuse/short_cup/fusion.json", {"T_object_world": np.eye(4).tolist()})
    write_json(warp / "alignment.json", {"label_mapping": own, "wall_side_flips_without_check": 0.4})
    write_json(warp / "cpu.json", {"fit_s": 1.0})
    write_table(warp / "label_mapping.parquet", mapped, "mapping")
    write_table(processed / "parametrise/mug/by/some_k1/short_cup.parquet", columns, "parameters")
    return warping.scores(processed, "mug", "short_cup", "some_k1", read_truth(processed, "short_cup"))


def test_a_wall_that_could_not_be_told_costs_no_other_error(tmp_path):
    found = compared(tmp_path, wall_m=np.nan)
    row = read_table(tmp_path / "parametrise/mug/by/some_k1/short_cup.parquet", "parameters").iloc[0]
    errors = parameter_errors(row, read_truth(tmp_path, "short_cup"))
    assert "wall" not in errors
    assert np.isfinite(list(errors.values())).all()
    assert all(np.isfinite(found[key]) for key in warping.PARAMETERS)
    assert found == pytest.approx(compared(tmp_path), nan_ok=True)


def test_a_mapping_without_a_container_or_a_rim_has_no_errors_of_parameters(tmp_path):
    found = compared(tmp_path, **dict.fromkeys(("radius_m", "volume_m3", "capacity_m3"), np.nan))
    assert all(np.isnan(found[key]) for key in warping.PARAMETERS)
    assert found["rim_iou"] > 0.9
