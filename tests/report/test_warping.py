"""The comparison of warping methods: its numbers, what counts as a bar reached, and that gaps are shown as gaps."""

import numpy as np
import pytest

from pipeline.report.warping import numbers
from pipeline.report.warping_page import COLUMNS, MEASURES, bars_met, matrices, over_targets, overview

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
