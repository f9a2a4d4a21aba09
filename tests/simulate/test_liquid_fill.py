import numpy as np
import pytest

from pipeline.geometry.cavity import lip_alone, pour_axis
from pipeline.geometry.frames import apply, rotation_about, transform
from pipeline.simulate import filling, kernels, liquid, rest
from pipeline.simulate.liquid import Filling, Vessel
from pipeline.simulate.particles import particles
from pipeline.simulate.rest import GRAVITY

UP = np.array([0.0, 0.0, 1.0])


def fill(
    held: Vessel,
    second: Vessel,
    offset_m: tuple[float, float, float],
    n_second: int,
    yaw: float = 0.0,
    seed: int = 1,
    n_held: int = 10,
) -> Filling:
    """Pour n_held particles with the lip `offset_m` (along the pour, across, up) from the centre of the second's opening."""
    T_world_second = transform(rotation_about(UP, 0.3), np.array([0.2, -0.1, 0.0]))
    T_world_held = transform(rotation_about(UP, yaw), np.zeros(3))
    lip = lip_alone(held.cavity)
    along = apply(T_world_held, lip) - apply(T_world_held, held.cavity.opening_m)
    along = np.array([along[0], along[1], 0.0]) / np.hypot(along[0], along[1])
    centre = apply(T_world_second, second.cavity.opening_m)
    goal = centre + offset_m[0] * along + offset_m[1] * np.cross(UP, along) + offset_m[2] * UP
    T_world_held[:3, 3] = goal - apply(T_world_held, lip)
    axis = pour_axis(apply(T_world_held, held.cavity.opening_m), goal)
    return liquid.fill(
        held, second, T_world_held, T_world_second, lip, axis, np.radians(120.0), n_held, n_second, seed
    )


@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_a_stream_into_a_wide_bowl_is_caught(cylinder: Vessel, bowl: Vessel, yaw: float) -> None:
    result = fill(cylinder, bowl, (-0.03, 0.0, 0.03), 150, yaw)
    assert (result.n_retained, result.n_in_second, result.n_spilled, result.n_leaked) == (0, 160, 0, 0)
    assert not result.failed
    assert not result.spilled_while_settling


def test_a_stream_beside_the_second_is_spilled(cylinder: Vessel, bowl: Vessel) -> None:
    result = fill(cylinder, bowl, (0.1, 0.0, 0.03), 150)
    assert (result.n_in_second, result.n_spilled) == (150, 10)


def test_a_brimful_second_overflows_by_about_what_falls_in(cylinder: Vessel, bowl: Vessel) -> None:
    held = liquid.holds(bowl)
    assert fill(cylinder, bowl, (-0.03, 0.0, 0.02), held - 60).n_spilled == 0
    over = fill(cylinder, bowl, (-0.03, 0.0, 0.02), held, n_held=60)
    assert 30 <= over.n_spilled <= 120  # what falls in, and what its splash takes along
    assert over.n_in_second + over.n_spilled == over.n_particles == held + 60
    assert over.n_leaked == 0


def test_more_than_it_holds_is_spilled_while_settling(cylinder: Vessel, bowl: Vessel) -> None:
    assert fill(cylinder, bowl, (0.0, 0.0, 0.02), liquid.holds(bowl) + 5).spilled_while_settling


def test_more_than_ever_lay_in_it_is_spilled_while_settling(cylinder: Vessel, bowl: Vessel) -> None:
    most = max(len(state) for state in rest._topped(bowl))
    assert fill(cylinder, bowl, (0.0, 0.0, 0.02), most + 5).spilled_while_settling


def test_every_particle_is_somewhere(thin: Vessel, cone: Vessel) -> None:
    rng = np.random.default_rng(9)
    for seed in range(12):
        offset = (*rng.uniform(-0.06, 0.06, 2), rng.uniform(0.01, 0.09))
        n_second = int(rng.uniform(0, 0.9) * liquid.holds(cone))
        result = fill(thin, cone, offset, n_second, rng.uniform(0, 6), seed)
        assert not result.failed
        assert result.n_leaked == 0
        assert (
            result.n_retained + result.n_in_second + result.n_spilled == result.n_particles == n_second + 10
        )


def test_the_same_arguments_give_the_same_bits(cylinder: Vessel, bowl: Vessel) -> None:
    assert fill(cylinder, bowl, (0.02, 0.01, 0.04), 100) == fill(cylinder, bowl, (0.02, 0.01, 0.04), 100)


def test_a_thrown_particle_flies_as_ballistics_says(bowl: Vessel) -> None:
    """From above the contour into the bowl: where and how fast it joins."""
    dt, start, speed = 0.005, np.array([-0.09, 0.01, 0.20]), np.array([0.45, 0.0, 0.3])
    q, flight = particles(1, bowl.walls), np.zeros((2, 1, 3))
    flight[0, 0], flight[1, 0] = start, speed
    reach, flying, steps = 2 * bowl.spacing_m, 1, 0
    while flying:
        flying, joined = filling.fly(q, bowl.walls, flight, flying, np.eye(4), dt, reach)
        steps += 1
    assert joined == 1
    t = steps * dt
    assert q.x[0, :3] == pytest.approx(start + t * speed - 0.5 * GRAVITY * t**2 * UP, abs=1e-4)
    assert q.v[0, :3] == pytest.approx(speed - GRAVITY * t * UP, abs=1e-3)
    # It joined at the first step that brought it within reach of the rim.
    rim = bowl.cavity.rim_m[:, 2].mean()
    before = start + (t - dt) * speed - 0.5 * GRAVITY * (t - dt) ** 2 * UP
    assert q.x[0, 2] < rim + reach <= before[2]


def test_what_comes_down_outside_the_contour_stays_outside(bowl: Vessel) -> None:
    q, flight = particles(1, bowl.walls), np.zeros((2, 1, 3))
    flight[0, 0], flight[1, 0] = (
        (-0.075, 0.0, 0.10),
        (0.05, 0.0, 0.0),
    )  # on its way in, but below the rim before it is there
    flying = 1
    while flying:
        flying, joined = filling.fly(q, bowl.walls, flight, flying, np.eye(4), 0.005, 2 * bowl.spacing_m)
        assert joined == 0
    assert q.count[0] == 0


def test_a_particle_keeps_its_momentum_when_it_leaves_the_turning_cup(cylinder: Vessel) -> None:
    """At rest in the cup's frame, it has in the world the velocity of the cup there."""
    p, flight = particles(1, cylinder.walls), np.zeros((2, 1, 3))
    lip, lip_world, axis = np.array([0.037, 0.0, 0.1]), np.array([0.5, 0.2, 0.4]), np.array([0.0, 1.0, 0.0])
    p.gone_x[0], p.gone_how[0], p.count[1] = lip + [0.0, 0.0, 0.02], kernels.LEFT, 1
    flying, leaked = filling._take_off(
        p, cylinder.walls, flight, 0, np.eye(4), lip_world, lip, axis, np.pi / 2, 2.0
    )
    assert (flying, leaked) == (1, 0)
    # 20 mm above the lip, after a quarter turn about +y: 20 mm beyond it, moving down at 2 rad/s × 20 mm.
    assert flight[0, 0] == pytest.approx(lip_world + [0.02, 0.0, 0.0], abs=1e-6)
    assert flight[1, 0] == pytest.approx([0.0, 0.0, -0.04], abs=1e-6)
