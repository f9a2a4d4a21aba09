"""The ring among points that look like a rim, of pieces that are hardly one."""

import numpy as np
import pytest

from pipeline.warp.ring import LEAST_POINTS, _ring


def arc(radius_m: float, start_deg: float, end_deg: float, height_m: float) -> np.ndarray:
    turn = np.radians(np.linspace(start_deg, end_deg, 200))
    return np.column_stack([radius_m * np.cos(turn), radius_m * np.sin(turn), np.full(200, height_m)])


@pytest.mark.parametrize("x_m", [0.0, 0.013, 0.1 / 3])
def test_a_vertical_line_is_no_ring(x_m):
    """It ended in a traceback: none of its points is off its own axis."""
    line_m = np.column_stack([np.full(60, x_m), np.zeros(60), np.linspace(0.0, 0.08, 60)])
    ring = _ring(line_m, np.array([x_m, 0.0]))
    assert not ring.goes_round
    np.testing.assert_array_equal(ring.points_m, line_m)


def test_a_ring_does_not_go_through_where_only_something_else_is():
    """What sticks out of it was dropped, but counted: the ring was whole."""
    piece_m = np.vstack([arc(0.05, 20, 340, 0.08), arc(0.09, -19, 19, 0.08)[::20]])
    ring = _ring(piece_m, np.zeros(2))
    assert np.linalg.norm(ring.points_m[:, :2], axis=1).max() < 0.06
    assert ring.coverage == pytest.approx(320 / 360, abs=0.06)


@pytest.mark.parametrize("seed", [181, 340])  # of 400, those with fewer points
def test_a_ring_that_goes_round_has_points_about_the_centre_that_it_ends_with(seed):
    """Each centre but the last was asked for them."""
    rng = np.random.default_rng(seed)
    turn = rng.uniform(0, 2 * np.pi, (3, 1)) + rng.uniform(0, 2 * np.pi, (3, 1)) * rng.random((3, 40))
    radius_m = rng.choice([0.01, 0.03, 0.05, 0.1], (3, 1))
    x_m = rng.uniform(-0.05, 0.05, (3, 1)) + radius_m * np.cos(turn)
    y_m = rng.uniform(-0.05, 0.05, (3, 1)) + radius_m * np.sin(turn)
    z_m = rng.uniform(0.0, 0.1, (3, 1)) + rng.choice([0.0, 0.02, 0.2], (3, 1)) * rng.random((3, 40))
    ring = _ring(np.column_stack([x_m.ravel(), y_m.ravel(), z_m.ravel()]), np.zeros(2))
    assert not ring.goes_round or len(ring.points_m) >= LEAST_POINTS
