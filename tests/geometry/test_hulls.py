import numpy as np
import pytest

from pipeline.geometry.hulls import points_in_hull, tilt_reference_rad

BOX = np.array([[x, y, z] for x in (-0.03, 0.03) for y in (-0.04, 0.04) for z in (0.0, 0.1)])


def test_filling_of_a_box():
    inside = points_in_hull(BOX, 20000)
    assert 19800 < len(inside) < 20200
    np.testing.assert_allclose(inside.mean(axis=0), [0.0, 0.0, 0.05], atol=1e-4)
    np.testing.assert_allclose(inside.var(axis=0), np.array([0.06, 0.08, 0.1]) ** 2 / 12, rtol=0.01)


def test_half_a_box_is_above_its_lip_when_its_diagonal_is_level():
    inside = points_in_hull(BOX, 20000)
    tilt = tilt_reference_rad(inside, np.array([0.03, 0.0, 0.1]), np.array([0.0, 0.0, 0.1]))
    assert np.degrees(tilt) == pytest.approx(np.degrees(np.arctan2(0.1, 0.06)), abs=0.1)


def test_tilt_reference_does_not_depend_on_scale_or_yaw():
    inside, lip, opening = points_in_hull(BOX, 5000), np.array([0.03, 0.0, 0.1]), np.array([0.0, 0.0, 0.1])
    yaw = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    moved = tilt_reference_rad(2.0 * inside @ yaw.T, 2.0 * yaw @ lip, 2.0 * yaw @ opening)
    assert moved == pytest.approx(tilt_reference_rad(inside, lip, opening), abs=1e-9)
