"""Gel balls in Bullet: none is lost, none crosses a wall, and the trials are the same as the liquid's."""

import sys

import numpy as np
import pytest
from simulate.test_trials import FILLING, HALF_FULL, lathe, prepare

from pipeline import artefacts
from pipeline.errors import PipelineError
from pipeline.geometry.cavity import lip_alone, pour_axis
from pipeline.simulate import __main__ as command_line
from pipeline.simulate import bullet, engines, prepared, spheres, trials

SPACING_M = 0.012
N = 50


@pytest.fixture(scope="module")
def cup():
    return prepared.container("cup", *lathe(0.030, 0.060), SPACING_M, engines.engine("bullet"))


@pytest.fixture(scope="module")
def bowl():
    return prepared.container("bowl", *lathe(0.045, 0.040), SPACING_M, engines.engine("bullet"))


def pour(cup, n, tilt_deg, seed=1):
    lip = lip_alone(cup.cavity)
    axis = pour_axis(cup.cavity.opening_m, lip)
    return bullet.pour(cup.vessel, n, lip, axis, np.radians(tilt_deg), seed)


def test_the_packed_balls_fill_as_much_as_the_liquid(cup):
    n = round(0.7 * cup.cavity.capacity_m3 / SPACING_M**3)
    filled_m3 = bullet.bulk_m3(cup.vessel, bullet._settled(cup.vessel, n))
    assert filled_m3 == pytest.approx(n * SPACING_M**3, rel=0.06)
    share = 4 / 3 * np.pi * cup.vessel.radius_m**3 / SPACING_M**3
    assert 0.45 < share < 0.70


def test_upright_no_ball_leaves_and_upside_down_all(cup):
    upright, over = pour(cup, N, 0.0), pour(cup, N, 150.0)
    assert (upright.n_left, upright.n_retained, upright.n_leaked) == (0, N, 0)
    assert (over.n_left, over.n_retained, over.n_leaked) == (N, 0, 0)
    assert not upright.failed
    assert not over.failed


def test_the_same_arguments_give_the_same_bits(cup):
    one, two = pour(cup, N, 80.0), pour(cup, N, 80.0)
    assert 0 < one.n_left < N
    assert one.retained.tobytes() == two.retained.tobytes()


def test_the_turning_frame_throws_a_ball_as_the_world_does(cup):
    """A free ball at rest in the world, seen from a frame that turns about y at a constant 2 rad/s."""
    turning, pivot = np.array([0.0, 2.0, 0.0]), np.array([0.0, 0.0, 0.5])
    start = np.array([0.3, 0.0, 0.5])
    with spheres.World(cup.vessel) as world:
        world.add(start[None], -np.cross(turning, start - pivot)[None])
        for _ in range(60):
            world.step(np.zeros(3), turning, np.zeros(3), pivot)
        x, _ = world.state()
    angle = -2.0 * 60 * spheres.STEP_S
    assert x[0] == pytest.approx(pivot + 0.3 * np.array([np.cos(angle), 0.0, -np.sin(angle)]), abs=2e-3)


def test_the_trials_are_those_of_the_liquid(cup):
    liquid_cup = prepared.container("cup", *lathe(0.030, 0.060), SPACING_M)
    for number in range(2):
        balls, liquid = (trials.pouring_trial(each, HALF_FULL, number, 4) for each in (cup, liquid_cup))
        for key in ("seed", "fill_m3", "tilt_rad", "lip_x_m", "n_particles", "hydrostatic_margin"):
            assert balls[key] == liquid[key]
        assert balls["n_left"] + balls["n_retained"] == balls["n_particles"]


def test_every_ball_of_a_filling_is_somewhere(cup, bowl):
    with trials.FillingExperiment(bowl, [cup], FILLING) as experiment:
        rows = [experiment.trial(number, 4) for number in range(3)]
    for row in rows:
        assert not row["failed"]
        assert row["n_leaked"] == 0
        assert row["n_left"] + row["n_retained"] == FILLING.held_particles
        assert 0 <= row["n_spilled"] <= row["n_left"] + row["n_second"]
        assert row["filled"] == (row["n_spilled"] + row["n_retained"] == 0)


def test_a_blow_up_is_recorded_as_failed(cup):
    lip = lip_alone(cup.cavity)
    result = bullet.pour(cup.vessel, 10, lip, np.array([0.0, 1.0, 0.0]), 400.0, 1)
    assert result.failed


def test_an_engine_is_chosen_by_name(tmp_path, monkeypatch):
    cup, output = prepare("cup", lathe(0.030, 0.060), tmp_path, 0.014), tmp_path / "trials.parquet"
    words = ["pouring", "--object", "cup", "--container", cup, "--trials-table", str(output), "--trials", "2"]
    monkeypatch.setattr(sys, "argv", ["simulate", *words, "--engine", "bullet"])
    command_line.main()
    assert artefacts.read_table(output, "trials").density_error.isna().all()
    monkeypatch.setattr(sys, "argv", ["simulate", *words, "--engine", "bulet"])
    with pytest.raises(PipelineError, match=r"bulet.*liquid bullet"):
        command_line.main()
