"""Where each feature set believes lip and opening to be."""

import numpy as np
import pandas as pd
import pytest

from pipeline.errors import PipelineError
from pipeline.execute import pairs

SHOWN = "tall", "wide"


def row(name, mapping, lip, opening, centre):
    values = {"lip": lip, "opening": opening, "centre": centre}
    places = {f"{what}_{axis}_m": v for what, at in values.items() for axis, v in zip("xyz", at, strict=True)}
    return {"object": name, "mapping": mapping, **places}


PARAMETERS = pd.DataFrame(
    [
        row("tall", "label_mapping", (0.04, 0, 0.13), (0, 0, 0.129), (0, 0, 0.06)),
        row("wide", "label_mapping", (0.07, 0, 0.05), (0.001, 0, 0.052), (0, 0, 0.02)),
        row("low", "label_mapping", (0, 0.03, 0.06), (0, 0, 0.058), (0.002, 0, 0.03)),
        row("low", "point_mapping", (0, 0.032, 0.06), (0, 0, 0.058), (0.002, 0, 0.03)),
        row("deep", "label_mapping", (0.08, 0, 0.07), (0.003, 0.004, 0.072), (0, 0, 0.03)),
        row("deep", "point_mapping", (0.08, 0, 0.07), (0.005, 0.004, 0.072), (0, 0, 0.03)),
    ]
)


@pytest.mark.parametrize(
    ("features", "y_m", "x_m"), [("label_mapping", 0.03, 0.003), ("point_mapping", 0.032, 0.005)]
)
def test_warped_sets_read_the_pairs_own_warps(features, y_m, x_m):
    task = pairs.task(PARAMETERS, features, "low", "deep", SHOWN)
    assert task.lip_m == pytest.approx([0, y_m, 0.06])
    assert task.opening_m == pytest.approx([x_m, 0.004, 0.072])
    assert task.yaw_rad == pytest.approx(np.pi / 2)
    stands = task.T_world_second[:3, 3]
    assert stands == pytest.approx([-x_m, -0.004, 0.0])


def test_the_standard_set_knows_the_centres_alone_and_agrees_on_the_demonstrated_pair():
    task = pairs.task(PARAMETERS, "standard", "low", "deep", SHOWN)
    assert task.lip_m == pytest.approx([0.042, 0, 0.10])
    assert task.opening_m == pytest.approx([0.001, 0, 0.062])
    shown, warped = (pairs.task(PARAMETERS, name, *SHOWN, SHOWN) for name in ("standard", "label_mapping"))
    assert shown.lip_m == pytest.approx(warped.lip_m)
    assert shown.opening_m == pytest.approx(warped.opening_m)


def test_an_object_without_warped_parameters_is_named():
    with pytest.raises(PipelineError, match=r"vase: .*label_mapping.*0 rows"):
        pairs.task(PARAMETERS, "label_mapping", "vase", "deep", SHOWN)
