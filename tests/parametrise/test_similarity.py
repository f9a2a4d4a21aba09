"""The same object anywhere, turned and at another size: from points alone to labels and parameters."""

from functools import cache

import numpy as np
import pandas as pd
import pytest
from conftest import PARTS, sampled
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from pipeline.artefacts import normals, points
from pipeline.geometry.frames import rotation_about
from pipeline.label.classifier import PartClassifier, train
from pipeline.label.features import neighbourhood_features
from pipeline.parametrise.cloud import warped
from pipeline.parametrise.parameters import PARAMETERS, evaluate
from pipeline.warp.clouds import Cloud
from pipeline.warp.nearest_neighbour import fit

POINTS, NEIGHBOURS = 4000, (20, 40, 100)
UP = np.array([0.0, 0.0, 1.0])
POWER = {"m": 1, "m3": 3, "rad": 0, "1": 0}
# A cup stands on what is within 1.5 mm of its lowest point, whatever its size.
TOLERANCE = {"stability_rad": 0.06}


def source() -> Cloud:
    table = sampled("mug", POINTS)
    area = table["area_m2"].to_numpy()
    return Cloud("mug", points(table), normals(table), area, table[PARTS].to_numpy())


@cache
def learnt() -> PartClassifier:
    return train(neighbourhood_features(source().points_m, NEIGHBOURS), source().parts, ridge=300.0)


def read_off(points_m: np.ndarray, directions: np.ndarray, area_m2: np.ndarray) -> tuple[np.ndarray, dict]:
    """Return labels (N, 3) of an object's points, and its parameters."""
    estimate = learnt().probabilities(neighbourhood_features(points_m, NEIGHBOURS)) > 0.5
    target = Cloud("mug", points_m, directions, area_m2, estimate)
    labelled = fit(source(), target, rng=np.random.default_rng(0)).map_labels(1).cloud
    names = ["x_m", "y_m", "z_m", "nx", "ny", "nz"]
    table = pd.DataFrame(np.hstack([points_m, directions]), columns=names)
    table = table.assign(area_m2=area_m2, **dict(zip(PARTS, labelled.parts.T, strict=True)), valid=True)
    values = evaluate(PARAMETERS, warped(table, name="mug").pieces(hull_points=2000))
    return labelled.parts, values


# No shrinking: an example takes two seconds.
@settings(max_examples=4, deadline=None, derandomize=True, phases=[Phase.generate])
@given(
    yaw_rad=st.floats(-3.1, 3.1),
    scale=st.floats(0.5, 2.0),
    x_m=st.floats(-0.5, 0.5),
    y_m=st.floats(-0.5, 0.5),
)
def test_labels_stay_and_parameters_scale_as_their_units_say(yaw_rad, scale, x_m, y_m):
    body, R, shift_m = source(), rotation_about(UP, yaw_rad), np.array([x_m, y_m, 0.0])
    parts, here = read_off(body.points_m, body.normals, body.area_m2)
    turned = body.points_m @ R.T, body.normals @ R.T
    parts_turned, there = read_off(*turned, body.area_m2)
    parts_elsewhere, elsewhere = read_off(scale * turned[0] + shift_m, turned[1], scale**2 * body.area_m2)
    np.testing.assert_array_equal(parts_turned, parts)
    np.testing.assert_array_equal(parts_elsewhere, parts)
    np.testing.assert_allclose(there["opening_m"], R @ here["opening_m"], atol=2e-4)
    # The rim is level: which of its points is the lip goes by +x, and what depends on the lip turns with neither.
    for name in ("radius_m", "volume_m3", "height_m", "capacity_m3", "wall_m", "stability_rad"):
        assert there[name] == pytest.approx(here[name], rel=0.01), name
    for found in PARAMETERS.values():
        expected = there[found.name] * scale ** POWER[found.unit]
        if found.name in ("opening_m", "lip_m"):
            expected = expected + shift_m
        rel = TOLERANCE.get(found.name, 0.005)
        np.testing.assert_allclose(
            elsewhere[found.name],
            expected,
            rtol=rel,
            atol=1e-4 * scale if found.unit == "m" else 1e-6,
            err_msg=found.name,
        )
