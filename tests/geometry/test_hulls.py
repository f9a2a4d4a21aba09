import numpy as np
import pytest

from pipeline.geometry.hulls import points_in_hull, tilt_reference_rad, tilt_references_rad

BOX = np.array([[x, y, z] for x in (-0.03, 0.03) for y in (-0.04, 0.04) for z in (0.0, 0.1)])


def test_filling_of_a_box():
    inside = points_in_hull(BOX, 20000)
    assert 19800 < len(inside) < 20200
    np.testing.assert_allclose(inside.mean(axis=0), [0.0, 0.0, 0.05], atol=1e-4)
    np.testing.assert_allclose(inside.var(axis=0), np.array([0.06, 0.08, 0.1]) ** 2 / 12, rtol=0.01)


def test_a_hull_of_many_corners_is_filled_to_its_surface():
    rng = np.random.default_rng(3)
    ball = rng.normal(size=(4000, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    inside = points_in_hull(ball, 20000)
    assert 19800 < len(inside) < 20200
    radius = np.linalg.norm(inside, axis=1)
    assert radius.max() < 1.0
    # Shells of equal volume hold equally many: none is left out near the corners.
    np.testing.assert_allclose(np.histogram(radius**3, 10, (0.0, 0.99))[0], len(inside) / 10, rtol=0.05)


def test_tilt_references_about_several_lips_are_those_about_each():
    inside, opening = points_in_hull(BOX, 3000), np.array([0.0, 0.001, 0.1])
    lips = np.array([[0.03 * np.cos(turn), 0.04 * np.sin(turn), 0.1] for turn in np.linspace(0, 6, 37)])
    each = [tilt_reference_rad(inside, lip, opening) for lip in lips]
    np.testing.assert_allclose(tilt_references_rad(inside, lips, opening), each, rtol=1e-12)


def test_half_a_box_is_above_its_lip_when_its_diagonal_is_level():
    inside = points_in_hull(BOX, 20000)
    tilt = tilt_reference_rad(inside, np.array([0.03, 0.0, 0.1]), np.array([0.0, 0.0, 0.1]))
    assert np.degrees(tilt) == pytest.approx(np.degrees(np.arctan2(0.1, 0.06)), abs=0.1)


def test_tilt_reference_does_not_depend_on_scale_or_yaw():
    inside, lip, opening = points_in_hull(BOX, 5000), np.array([0.03, 0.0, 0.1]), np.array([0.0, 0.0, 0.1])
    yaw = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    moved = tilt_reference_rad(2.0 * inside @ yaw.T, 2.0 * yaw @ lip, 2.0 * yaw @ opening)
    assert moved == pytest.approx(tilt_reference_rad(inside, lip, opening), abs=1e-9)
