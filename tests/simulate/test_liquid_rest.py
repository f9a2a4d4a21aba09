from collections.abc import Callable

import numpy as np
import pytest

from pipeline.simulate import kernels, liquid, rest
from pipeline.simulate.fields import precompute
from pipeline.simulate.lookup import wall_reach
from pipeline.simulate.particles import Particles, particles


def at_rest(vessel: liquid.Vessel, n: int, seconds: float = 0.5) -> Particles:
    """Return n particles after some time without any damping."""
    p = particles(n, vessel.walls)
    p.x[:n, :3], p.count[0] = liquid.settle(vessel, n, 1), n
    dt = rest.time_step_s(vessel)
    left, well = rest.rest(p, vessel.walls, dt, rest.ITERATIONS, int(seconds / dt), 0.0)
    assert well
    assert left == 0
    return p


def cylinder_level(volume: float) -> tuple[float, float]:
    return volume / (np.pi * 0.037**2), 0.037


def cone_level(volume: float) -> tuple[float, float]:
    levels = np.linspace(0, 0.08, 2001)
    top = 0.025 + 0.25 * levels
    z = float(np.interp(volume, np.pi * levels * (0.025**2 + 0.025 * top + top**2) / 3, levels))
    return z, 0.025 + 0.25 * z


def bowl_level(volume: float) -> tuple[float, float]:
    levels = np.linspace(0, 0.06, 2001)
    z = float(np.interp(volume, np.pi * levels**2 * (0.06 - levels / 3), levels))
    return z, float(np.sqrt(z * (0.12 - z)))


CASES = [("cylinder", cylinder_level), ("cone", cone_level), ("bowl", bowl_level)]


@pytest.mark.parametrize(("name", "level"), CASES, ids=[name for name, _ in CASES])
@pytest.mark.parametrize("n", [120, 220])
def test_at_rest_the_liquid_is_dense_level_and_calm(
    request: pytest.FixtureRequest, name: str, level: Callable[[float], tuple[float, float]], n: int
) -> None:
    vessel = request.getfixturevalue(name)
    p = at_rest(vessel, n)
    total, count = kernels.density_error(p, vessel.walls)
    assert count > n / 8
    assert total / count < 0.03
    assert np.sqrt((p.v[:n] ** 2).sum(axis=1).mean()) < 0.05
    true_level, radius = level(n * vessel.spacing_m**3)
    top = np.sort(p.x[:n, 2])[-int(0.6 * np.pi * radius**2 / vessel.spacing_m**2) :]
    surface = top.mean() + 0.5 * vessel.spacing_m - 0.003
    assert surface == pytest.approx(true_level, abs=0.5 * vessel.spacing_m)


@pytest.mark.parametrize("name", ["cylinder", "thin", "cone", "bowl"])
def test_overfilled_a_vessel_keeps_its_capacity(request: pytest.FixtureRequest, name: str) -> None:
    vessel = request.getfixturevalue(name)
    kept_m3 = liquid.holds(vessel) * vessel.spacing_m**3
    assert kept_m3 == pytest.approx(vessel.cavity.capacity_m3, rel=0.05)
    at_rest(vessel, liquid.holds(vessel), 1.0)  # and goes on keeping it


def test_settled_states_do_not_depend_on_what_was_asked_before(cylinder: liquid.Vessel) -> None:
    first, second = (precompute(cylinder.cavity, cylinder.spacing_m, cylinder.lowered) for _ in range(2))
    forwards = [liquid.settle(first, n, 3) for n in (40, 150, 400)]
    backwards = [liquid.settle(second, n, 3) for n in (400, 150, 40)][::-1]
    for a, b in zip(forwards, backwards, strict=True):
        assert a.tobytes() == b.tobytes()
    assert not np.array_equal(forwards[0], liquid.settle(first, 40, 4))


def test_the_walls_share_of_the_kernel_on_a_plane(cylinder: liquid.Vessel) -> None:
    w, s = cylinder.walls, np.float32(cylinder.spacing_m)
    share = [
        wall_reach(w.reach, w.shape, w.origin, w.cell, np.float32(0), np.float32(0), np.float32(z))
        for z in (0.003, 0.003 + s, 0.003 + 2.1 * s)
    ]
    assert share[0][0] == pytest.approx(0.5, abs=0.02)
    # Spherical cap of the cubic spline, half its support away from the wall.
    q = np.linspace(0, 1, 4001)
    spline = np.where(q <= 0.5, 6 * q**3 - 6 * q**2 + 1, 2 * (1 - q) ** 3)
    cap = 8 / np.pi * np.trapezoid(np.where(q > 0.5, 2 * np.pi * q * (q - 0.5) * spline, 0.0), q)
    assert share[1][0] == pytest.approx(cap, abs=0.01)
    assert share[2][0] == pytest.approx(0.0, abs=0.003)
    assert share[0][3] < 0  # the wall is below


def test_the_wall_is_as_solid_when_it_is_thin(cylinder: liquid.Vessel, thin: liquid.Vessel) -> None:
    """What is behind it, air or other liquid, has no part in the sums: 1.5 mm of wall act as 3 mm do."""
    rng, depths = np.random.default_rng(2), (0.003, 0.0015)
    for _ in range(40):
        turn, out, up = rng.uniform(0.0, 2 * np.pi), rng.uniform(0.0, 0.0345), rng.uniform(0.0025, 0.08)
        near, nearer = (
            wall_reach(
                w.reach,
                w.shape,
                w.origin,
                w.cell,
                *np.float32([out * np.cos(turn), out * np.sin(turn), up + z]),
            )
            for w, z in zip((cylinder.walls, thin.walls), depths, strict=True)
        )
        assert nearer[0] == pytest.approx(near[0], abs=0.03)
        assert np.subtract(nearer[1:], near[1:]) == pytest.approx(0.0, abs=8.0)


def test_a_particle_too_fast_stops_the_trial(cylinder: liquid.Vessel) -> None:
    p = particles(1, cylinder.walls)
    p.x[0, :3], p.v[0, :3], p.count[0] = (0.0, 0.0, 0.05), (0.0, 0.0, 20.0), 1
    assert rest.rest(p, cylinder.walls, 0.005, 2, 1, 0.0) == (0, False)
