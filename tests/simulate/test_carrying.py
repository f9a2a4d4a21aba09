"""A cup carried along poses: the forces in its frame, and what becomes of balls and liquid on the way."""

import numpy as np
import pytest
from simulate.test_trials import lathe

from pipeline.geometry.frames import rotation_about, transform
from pipeline.simulate import carrying, carrying_liquid, gel, liquid, prepared
from pipeline.simulate.rest import GRAVITY

EVERY_S = 1.0 / 60.0
SPACING_M = 0.012
Y = np.array([0.0, 1.0, 0.0])


def poses(position_m, tilt_rad):
    return np.array([transform(rotation_about(Y, t), x) for x, t in zip(position_m, tilt_rad, strict=True)])


def pour(lip_m, lip_x_m, tilt_deg, seconds=2.0, fall_m=0.03):
    """A cup is tilted about its lip, which stays at x above the origin's bowl (rim at 43 mm)."""
    u = np.linspace(0.0, 1.0, round(seconds / EVERY_S) + 1)
    tilts = np.radians(tilt_deg) * np.clip(1.5 * u, 0, 1) ** 2 * (3 - 2 * np.clip(1.5 * u, 0, 1))
    lip_world = np.array([lip_x_m, 0.0, 0.043 + fall_m])
    return poses([lip_world - rotation_about(Y, t) @ lip_m for t in tilts], tilts)


@pytest.fixture(scope="module")
def cup():
    return prepared.container("cup", *lathe(0.030, 0.060), SPACING_M)


@pytest.fixture(scope="module")
def bowl():
    return prepared.container("bowl", *lathe(0.045, 0.040), SPACING_M)


@pytest.fixture(scope="module")
def pots(cup, bowl):
    held = gel.prepare(cup.cavity, *cup.coarse, SPACING_M)
    return held, gel.alike(held, bowl.cavity, *bowl.coarse)


def test_a_falling_cup_weighs_nothing_and_a_lifted_one_more():
    t = np.arange(0.0, 1.0 + 1e-9, EVERY_S)
    for acceleration in (-GRAVITY, 3.0):
        height = np.column_stack([0 * t, 0 * t, 0.5 * acceleration * t**2])
        moving = carrying.motion(poses(height, 0 * t), EVERY_S, 0.005)
        middle = slice(60, 140)
        assert moving.gravity[middle, 2] == pytest.approx(-GRAVITY - acceleration, abs=0.01)
        assert moving.gravity[middle, :2] == pytest.approx(0.0, abs=1e-6)


def test_a_cup_that_turns_evenly_about_a_far_axis_feels_the_centrifugal_force():
    t, turn, arm_m = np.arange(0.0, 1.0 + 1e-9, EVERY_S), 2.0, 0.3
    positions = [rotation_about(Y, turn * s) @ [arm_m, 0.0, 0.0] for s in t]
    moving = carrying.motion(poses(positions, turn * t), EVERY_S, 0.005)
    R = moving.T_world_cup[100, :3, :3]
    expected = R.T @ [0.0, 0.0, -GRAVITY] + [turn**2 * arm_m, 0.0, 0.0]
    assert moving.gravity[100] == pytest.approx(expected, abs=0.02)
    assert moving.turning[100] == pytest.approx(turn * Y, abs=1e-4)
    assert moving.growth[100] == pytest.approx(0.0, abs=1e-3)


def test_one_short_pour_twice_gives_the_same_counts_and_all_are_counted(cup, pots):
    lip = cup.cavity.rim_m[np.argmax(cup.cavity.rim_m[:, 0])]
    moving = carrying.motion(pour(lip, 0.0, 100.0), EVERY_S, gel.GEL.step_s)
    one, two = (carrying.carry(*pots, moving, np.eye(4), 30, seed=3) for _ in range(2))
    assert [ball.time_s for ball in one.balls] == [ball.time_s for ball in two.balls]
    assert (one.n_retained, one.n_in_target, one.n_leaked) == (two.n_retained, two.n_in_target, two.n_leaked)
    assert not one.failed
    assert one.n_in_target > 20
    outside = sum(ball.outside for ball in one.balls)
    assert one.n_retained + one.n_in_target + outside + one.n_leaked == 30


def test_beside_the_bowl_all_that_is_poured_is_outside(cup, pots):
    lip = cup.cavity.rim_m[np.argmax(cup.cavity.rim_m[:, 0])]
    moving = carrying.motion(pour(lip, 0.2, 130.0), EVERY_S, gel.GEL.step_s)
    carried = carrying.carry(*pots, moving, np.eye(4), 30, seed=3)
    assert len(carried.balls) > 20
    assert carried.n_in_target == 0
    assert not any(ball.landed for ball in carried.balls)


@pytest.mark.parametrize(("lip_x_m", "caught"), [(0.0, True), (0.2, False)])
def test_the_liquid_goes_where_the_lip_is(cup, bowl, lip_x_m, caught):
    lip = cup.cavity.rim_m[np.argmax(cup.cavity.rim_m[:, 0])]
    step_s = carrying_liquid.step_s(cup.vessel, bowl.vessel)
    moving = carrying.motion(pour(lip, lip_x_m, 110.0), EVERY_S, step_s)
    n = liquid.particles_for(cup.vessel, 0.5 * cup.cavity.capacity_m3)
    one, two = (
        carrying_liquid.carry(cup.vessel, bowl.vessel, moving, np.eye(4), Y, n, 0.0, 3) for _ in range(2)
    )
    assert one._replace(first_spill_s=0.0) == two._replace(first_spill_s=0.0)
    assert not one.failed
    assert one.n_leaked == 0
    assert one.n_poured > 0.8 * n
    assert one.n_in_target == (one.n_poured if caught else 0)
    assert one.n_spilled == (0 if caught else one.n_poured)
