"""When the classifiers spoke, and when it poured."""

import numpy as np
import pandas as pd
import pytest

from pipeline.report import watching_numbers as numbers
from pipeline.report import watching_page as page
from pipeline.report.watching_numbers import Curve

T = np.linspace(0.0, 6.0, 361)
TILT = np.interp(T, [1.0, 4.0, 6.0], [0.0, 1.5, 0.0])


def curve(draw, crosses_s, classifiers="label_mapping", fills=True):
    """p(pour) passes one half at a time; p(fill) is high or low from 0.5 s before on."""
    pour = 1.0 / (1.0 + np.exp(-8.0 * (T - crosses_s)))
    fill = np.where(crosses_s - 0.5 < T, 0.9 if fills else 0.2, 0.4)
    return Curve(("cup", "bowl", "label_mapping", draw), classifiers, T, TILT, pour, fill, T < 2.2)


def outcomes(*rows):
    names = ["draw", "first_drop_s", "n_spilled", "first_spill_s"]
    table = pd.DataFrame(rows, columns=names)
    return table.assign(held_object="cup", target_object="bowl", features="label_mapping")


def test_leads_are_from_one_half_to_the_first_drop():
    table = outcomes((0, 2.5, 0, np.nan), (1, 1.8, 0, np.nan), (2, np.nan, 0, np.nan))
    found = numbers.events([curve(0, 2.0), curve(1, 2.0), curve(2, 9.0)], {"balls": table})
    assert found["lead_s"].tolist()[:2] == pytest.approx([0.5, -0.2], abs=0.02)
    # Half a radian a second.
    assert found["lead_deg"].tolist()[:2] == pytest.approx(np.degrees([0.25, -0.1]), abs=0.6)
    assert np.isnan(found["lead_s"][2])
    told = numbers.numbers(found)
    assert told["watching.label_mapping.balls.not_foreseen"] == 0.5
    assert told["watching.label_mapping.balls.lead_s"] == pytest.approx(0.15, abs=0.02)
    assert told["watching.label_mapping.balls.lead_s_between_objects"] == 0.0


def test_an_alarm_is_pouring_that_is_likely_where_filling_is_not():
    shown = [curve(0, 2.0), curve(1, 2.0, fills=False), curve(2, 2.0, fills=False)]
    table = outcomes((0, 2.5, 0, np.nan), (1, 2.5, 9, 2.7), (2, 2.5, 0, np.nan))
    found = numbers.events(shown, {"liquid": table})
    assert np.isnan(found["unlikely_s"][0])
    assert found["unlikely_s"][1] == pytest.approx(2.0, abs=0.02)
    told = numbers.numbers(found)
    assert told["watching.label_mapping.liquid.unlikely.before_the_spill"] == 1.0
    assert told["watching.label_mapping.liquid.unlikely.of_the_clean"] == 0.5
    assert told["watching.label_mapping.liquid.unlikely.lead_s"] == pytest.approx(0.7, abs=0.02)
    assert found["outside_s"].tolist() == pytest.approx([2.0] * 3, abs=0.02)
    assert told["watching.label_mapping.liquid.outside.of_the_clean"] == 1.0
    assert told["watching.label_mapping.liquid.p_fill_auc"] == 0.75


def test_an_alarm_on_the_way_back_is_none():
    late = curve(0, 4.5, fills=False)
    (found,) = numbers.events([late], {"balls": outcomes((0, 3.9, 0, np.nan))}).to_dict("records")
    assert np.isnan(found["unlikely_s"])


def test_pages_are_drawn_of_any_number_of_pairs():
    shown = [curve(d, 2.0, name) for d in range(3) for name in ("label_mapping", "standard")]
    table = outcomes(*((d, 2.5, 0, np.nan) for d in range(3)))
    both = {"balls": table, "liquid": table.assign(first_drop_s=2.2)}
    drawn = page.moments(shown, both)
    line = next(line for line in drawn.axes[0].lines if len(line.get_xdata()) > 100)
    assert np.interp(-0.5, line.get_xdata(), line.get_ydata()) == pytest.approx(0.5, abs=0.02)
    assert len(page.leads(numbers.events(shown, both)).axes) == 2
