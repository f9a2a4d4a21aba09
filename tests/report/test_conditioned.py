"""The page of the conditioned primitive shows both primitives at each pair, in metres and radians."""

import numpy as np
import pandas as pd
import pytest
from motion import pours

from pipeline.motion.conditioned import ConditionedProMP, log_parameters
from pipeline.motion.promp import ProMP
from pipeline.report import conditioned_page as page

PARAMETERS = pd.DataFrame(
    [["cup", 0.04, 0.12, 1.0, 4e-4], ["low cup", 0.04, 0.06, 0.7, 2e-4], ["bowl", 0.08, 0.06, 0.4, 9e-4]],
    columns=["object", "radius_m", "height_m", "tilt_reference_rad", "volume_m3"],
).assign(mapping="label_mapping")
PAIRS = [("cup", "bowl"), ("low cup", "bowl")]


def test_each_row_is_a_pair_with_both_means():
    shown = [pours.pour(seed)[1] for seed in range(6)]
    contexts = np.repeat([log_parameters(PARAMETERS, "label_mapping", *pair) for pair in PAIRS], 3, axis=0)
    conditioned = ConditionedProMP.fit(shown, contexts)
    scaled = ProMP.fit([one / [0.08, 0.08, 0.12, 1.0] for one in shown])
    axes = np.reshape(page.draw(conditioned, scaled, PARAMETERS, PAIRS).axes, (2, 3))
    height_m = axes[1, 1].lines[0].get_ydata(), axes[1, 1].lines[1].get_ydata()
    assert height_m[0] == pytest.approx(0.06 * scaled.mean(page.PHASE)[:, 2])
    given = conditioned.given(log_parameters(PARAMETERS, "label_mapping", *PAIRS[1]))
    assert height_m[1] == pytest.approx(given.mean(page.PHASE)[:, 2])
    tilt_rad = axes[0, 2].lines[0].get_ydata()
    assert tilt_rad == pytest.approx(scaled.mean(page.PHASE)[:, 3])
