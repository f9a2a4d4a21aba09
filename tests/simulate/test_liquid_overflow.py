from functools import cache

import numpy as np
import pytest

from pipeline.geometry.cavity import lip_alone, pour_axis
from pipeline.simulate import liquid, rest
from pipeline.simulate.liquid import Vessel
from pipeline.simulate.particles import particles

pytestmark = pytest.mark.long

VESSELS = ("cylinder", "thin", "cone", "bowl")
ROOMS = (6, 10, 15, 20)
SEEDS = range(1, 25)


@cache
def taken_before_it_overflows(
    vessel: Vessel, room: int, seed: int, most: int = 40, wait_s: float = 0.1
) -> int:
    """Return how many particles can be set down one by one, without speed, on a trial's liquid with that free room."""
    n = rest.particles_for(vessel, vessel.cavity.capacity_m3) - room
    p, dt = particles(n + most, vessel.walls), rest.time_step_s(vessel)
    p.x[:n, :3], p.count[0] = liquid.settle(vessel, n, seed), n
    assert rest.rest(p, vessel.walls, dt, rest.ITERATIONS, int(rest.HOLD_S / dt), rest.SETTLE_DAMPING) == (
        0,
        True,
    )
    for k in range(most):
        rest._set_down(p, vessel, 1000 * seed + k)
        if rest.rest(p, vessel.walls, dt, rest.ITERATIONS, int(wait_s / dt), 0.0)[0]:
            return k
    return most


TOO_LITTLE = pytest.mark.xfail(reason="the lattice of the top layer takes some of what falls in")


# Where the bowl's vertices are a nanometre elsewhere, as with other roundings, three of four miss it at some free room, by 6 at
# most: a layer has 113 particles, the cylinder's 43. The next test holds for the bowl, too.
BY_CHANCE = pytest.mark.xfail(reason="all seeds begin from the same few states at the brim")


@pytest.mark.parametrize("room", ROOMS)
@pytest.mark.parametrize("name", ["cylinder", "thin", "cone", pytest.param("bowl", marks=BY_CHANCE)])
def test_filled_gently_it_overflows_when_its_free_room_is_taken(
    request: pytest.FixtureRequest, name: str, room: int
) -> None:
    vessel = request.getfixturevalue(name)
    taken = np.mean([taken_before_it_overflows(vessel, room, seed) for seed in SEEDS])
    assert taken == pytest.approx(room, abs=3)


@pytest.mark.parametrize("name", VESSELS)
def test_over_several_free_rooms_it_overflows_at_its_capacity(
    request: pytest.FixtureRequest, name: str
) -> None:
    vessel = request.getfixturevalue(name)
    excess = [
        np.mean([taken_before_it_overflows(vessel, room, seed) for seed in SEEDS]) - room for room in ROOMS
    ]
    assert abs(np.mean(excess)) < 0.01 * liquid.holds(vessel)
    assert np.abs(excess).max() < 0.02 * liquid.holds(vessel)


@pytest.mark.parametrize("name", VESSELS)
def test_filled_slowly_it_overflows_at_its_capacity(request: pytest.FixtureRequest, name: str) -> None:
    """The calibration is one of the mean, and of the particles at hand: other roundings order them otherwise near the brim."""
    vessel = request.getfixturevalue(name)
    excess = [
        np.mean([taken_before_it_overflows(vessel, room, seed, wait_s=0.25) for seed in SEEDS[:3]]) - room
        for room in ROOMS
    ]
    assert abs(np.mean(excess)) < 0.015 * liquid.holds(vessel)
    assert np.abs(excess).max() < 0.04 * liquid.holds(vessel)


@pytest.mark.parametrize(("room", "least", "most"), [pytest.param(0, 5, 30, marks=TOO_LITTLE), (40, 0, 0)])
def test_what_falls_from_a_cups_height_splashes_over_near_the_brim_alone(
    cylinder: Vessel, bowl: Vessel, room: int, least: int, most: int
) -> None:
    """Ten particles, a tilt to 120° in 1.0 s, the lip 30 mm above the opening: they arrive at about 1.2 m/s in 0.1 s."""
    lip = lip_alone(cylinder.cavity)
    T_world_held = np.eye(4)
    T_world_held[:3, 3] = bowl.cavity.opening_m + [-0.04, 0.0, 0.03] - lip
    axis = pour_axis(cylinder.cavity.opening_m, lip)
    n = min(rest.particles_for(bowl, bowl.cavity.capacity_m3) - room, liquid.holds(bowl))
    found = liquid.fill(cylinder, bowl, T_world_held, np.eye(4), lip, axis, np.radians(120.0), 10, n, 1)
    assert not found.spilled_while_settling
    assert found.n_leaked == 0
    assert least <= found.n_spilled <= most
