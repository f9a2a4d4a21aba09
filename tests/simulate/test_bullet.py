"""Trials by Bullet's spheres, gel balls and fluid: none is lost, none crosses a wall, and they are the liquid's trials."""

import sys

import numpy as np
import pytest
from simulate.test_trials import FILLING, HALF_FULL, lathe, prepare

from pipeline import artefacts
from pipeline.errors import PipelineError
from pipeline.geometry.cavity import lip_alone, pour_axis
from pipeline.simulate import __main__ as command_line
from pipeline.simulate import bullet, engines, gel, packing, prepared, spheres, trials

SPACING_M = 0.012
N = 50
ENGINES = ("bullet", "bullet_fluid")


@pytest.fixture(scope="module", params=ENGINES)
def cup(request):
    return prepared.container("cup", *lathe(0.030, 0.060), SPACING_M, engines.engine(request.param))


@pytest.fixture(scope="module")
def bowl(cup):
    return prepared.container("bowl", *lathe(0.045, 0.040), SPACING_M, cup.engine)


def pour(cup, n, tilt_deg, seed=1, **options):
    lip = lip_alone(cup.cavity)
    axis = pour_axis(cup.cavity.opening_m, lip)
    return bullet.pour(cup.vessel, n, lip, axis, np.radians(tilt_deg), seed, **options)


def test_the_spheres_at_rest_fill_as_much_as_the_liquid(cup):
    n = round(0.7 * cup.cavity.capacity_m3 / SPACING_M**3)
    filled_m3 = gel.bulk_m3(cup.vessel, packing.settled(cup.vessel, n)[0])
    assert filled_m3 == pytest.approx(n * SPACING_M**3, rel=0.06)
    if cup.engine.name == "bullet":
        share = 4 / 3 * np.pi * cup.vessel.radius_m**3 / SPACING_M**3
        assert 0.45 < share < 0.70


def test_balls_at_the_bottom_of_a_deep_cup_are_not_pressed_through_its_floor():
    deep = prepared.container("deep", *lathe(0.035, 0.130), 0.010, engines.engine("bullet"))
    full = round(deep.cavity.capacity_m3 / 0.010**3)
    assert [packing.settled(deep.vessel, n)[1] for n in (round(0.9 * full), full)] == [0, 0]


def test_upright_no_sphere_leaves_and_upside_down_all(cup):
    upright, over = pour(cup, N, 0.0), pour(cup, N, 150.0)
    assert (upright.n_left, upright.n_retained, upright.n_leaked) == (0, N, 0)
    assert (over.n_left, over.n_retained, over.n_leaked) == (N, 0, 0)
    assert not upright.failed
    assert not over.failed


def test_the_same_arguments_give_the_same_bits(cup):
    one, two = pour(cup, N, 80.0), pour(cup, N, 80.0)
    assert 0 < one.n_left < N
    assert one.retained.tobytes() == two.retained.tobytes()


def test_waiting_for_longer_changes_nothing(cup):
    for tilt_deg in (20.0, 75.0):
        soon, late = pour(cup, N, tilt_deg), pour(cup, N, tilt_deg, patient=True, wait_s=3.0)
        assert (soon.n_left > 0) == (late.n_left > 0)


def test_the_turning_frame_throws_a_sphere_as_the_world_does(cup):
    """A free sphere at rest in the world, seen from a frame that turns about y at a constant 2 rad/s."""
    turning, pivot = np.array([0.0, 2.0, 0.0]), np.array([0.0, 0.0, 0.5])
    start, step_s = np.array([0.3, 0.0, 0.5]), cup.vessel.matter.step_s
    with spheres.World(cup.vessel) as world:
        world.add(start[None], -np.cross(turning, start - pivot)[None])
        for _ in range(60):
            world.step(np.zeros(3), turning, np.zeros(3), pivot)
        x, _ = world.state()
    angle = -2.0 * 60 * step_s
    assert x[0] == pytest.approx(pivot + 0.3 * np.array([np.cos(angle), 0.0, -np.sin(angle)]), abs=2e-3)


def test_the_trials_are_those_of_the_liquid(cup):
    liquid_cup = prepared.container("cup", *lathe(0.030, 0.060), SPACING_M)
    for number in range(2):
        balls, liquid = (trials.pouring_trial(each, HALF_FULL, number, 4) for each in (cup, liquid_cup))
        for key in ("seed", "fill_m3", "tilt_rad", "lip_x_m", "n_particles", "hydrostatic_margin"):
            assert balls[key] == liquid[key]
        assert balls["n_left"] + balls["n_retained"] == balls["n_particles"]


def test_every_sphere_of_a_filling_is_somewhere(cup, bowl):
    with trials.FillingExperiment(bowl, [cup], FILLING) as experiment:
        rows = [experiment.trial(number, 4) for number in range(3)]
    for row in rows:
        assert not row["failed"]
        assert row["n_leaked"] == 0
        assert row["n_left"] + row["n_retained"] == FILLING.held_particles
        assert 0 <= row["n_spilled"] <= row["n_left"] + row["n_second"]
        assert row["filled"] == (row["n_spilled"] + row["n_retained"] == 0)


def test_a_thrown_sphere_lands_where_ballistics_says(cup, bowl):
    """Into an empty bowl from beside its rim: inside at one speed, over and beyond at another."""
    rim_m = bowl.cavity.rim_m[:, 2].max()
    start = np.array([-0.045, 0.0, rim_m + 0.05])
    fall_s = np.sqrt(2 * 0.05 / 9.81)
    for reach_m, caught in ((0.045, 1), (0.075, 1), (0.110, 0)):
        with spheres.World(bowl.vessel) as world:
            flight = (0.0, start, np.array([reach_m / fall_s, 0.0, 0.0]))
            assert bullet._catch(world, bowl.vessel, [flight]) == (0, True)
            assert len(world) == caught


def test_the_floor_stops_what_falls_from_a_third_of_a_metre(bowl):
    """However far above the floor the last step before the impact ends."""
    pot, rim_m = bowl.vessel, bowl.cavity.rim_m[:, 2].max()
    for start_m in np.linspace(0.0, 0.011, 8):
        with spheres.World(pot) as world:
            fall = (0.0, np.array([0.01, 0.0, rim_m + start_m]), np.array([0.0, 0.0, -2.4]))
            assert bullet._catch(world, pot, [fall]) == (0, True)
            assert len(world) == 1


def test_a_blow_up_is_recorded_as_failed(cup):
    lip = lip_alone(cup.cavity)
    result = bullet.pour(cup.vessel, 10, lip, np.array([0.0, 1.0, 0.0]), 400.0, 1)
    assert result.failed


def test_a_sphere_that_goes_through_the_wall_is_told_from_one_that_left_over_it(cup):
    """The audit itself, on a container whose wall is as fine as ever but which Bullet does not see."""
    pot = cup.vessel
    sieve = spheres.Pot(
        pot.cavity, pot.spacing_m, pot.radius_m, pot.vertices_m, pot.triangles[:4], pot.walls, pot.matter
    )
    lip = lip_alone(pot.cavity)
    result = bullet.pour(sieve, 20, lip, pour_axis(pot.cavity.opening_m, lip), 0.5, 1)
    assert result.n_retained < 20
    assert result.failed
    assert result.n_leaked > 0


def test_an_engine_is_chosen_by_name(tmp_path, monkeypatch):
    cup, output = prepare("cup", lathe(0.030, 0.060), tmp_path, 0.014), tmp_path / "trials.parquet"
    words = ["pouring", "--object", "cup", "--container", cup, "--trials-table", str(output), "--trials", "2"]
    for name, dense in (("bullet", False), ("bullet_fluid", True)):
        monkeypatch.setattr(sys, "argv", ["simulate", *words, "--engine", name])
        command_line.main()
        assert (artefacts.read_table(output, "trials").density_error.notna() == dense).all()
    monkeypatch.setattr(sys, "argv", ["simulate", *words, "--engine", "bulet"])
    with pytest.raises(PipelineError, match=r"bulet.*liquid bullet"):
        command_line.main()
