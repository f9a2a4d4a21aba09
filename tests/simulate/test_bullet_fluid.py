"""Bullet's fluid mode against what is known of liquids: density, level, hydrostatics, the reference pour; and its forces."""

import numpy as np
import pytest
from simulate.test_trials import lathe

from pipeline.geometry.cavity import cavity, lip_alone, pour_axis
from pipeline.simulate import bullet, fluid, forces, packing, spheres
from pipeline.simulate.whereabouts import places

SPACING_M = 0.010
RADIUS_M, DEPTH_M, WALL_M = 0.037, 0.097, 0.003
# Share kept, by SPlisHSPlasH (DFSPH, 1240 particles of 5 mm): benchmarks/liquid.py.
REFERENCE = {65: 0.936, 75: 0.683, 90: 0.236}
N = 155


@pytest.fixture(scope="module")
def pot():
    mesh = lathe(RADIUS_M, DEPTH_M, WALL_M)
    return fluid.prepare(cavity(*mesh, name="cup"), *mesh, SPACING_M)


@pytest.fixture(scope="module")
def at_rest(pot):
    """Positions, velocities, density error and how many are left after half a second upright, undamped."""
    with spheres.World(pot) as world:
        world.add(packing.settle(pot, N, (1, 0))[0])
        leaked = packing.stand(world, pot, 0.5)
        return *world.state(), world.density_error, leaked


def test_a_half_full_cup_at_rest_is_as_dense_and_as_high_as_liquid(pot, at_rest):
    x, v, error, leaked = at_rest
    assert (len(x), leaked) == (N, 0)
    assert np.sqrt((v**2).sum(axis=1).mean()) < 0.02
    density = forces.response(pot.walls, x, v).density
    assert error < 0.03
    assert density.max() < 1.10
    top = np.sort(x[:, 2])[-26:].mean() + SPACING_M / 2 - WALL_M
    assert top == pytest.approx(N * SPACING_M**3 / (np.pi * RADIUS_M**2), abs=SPACING_M / 4)


def test_pressure_grows_with_depth_as_hydrostatics_says(pot):
    """Pressure over density, c² (density − 1), grows by g a metre; between the layers at the floor and at the surface."""
    with spheres.World(pot) as world:
        world.add(packing.settle(pot, 350, (1, 0))[0])
        packing.stand(world, pot, 0.2)
        x, v = world.state()
    z, density = x[:, 2], forces.response(pot.walls, x, v).density
    inner = (z > z.min() + 0.5 * SPACING_M) & (z < z.max() - 0.5 * SPACING_M)
    slope, _ = np.polyfit(z[inner], forces.SOUND_M_S**2 * (density[inner] - 1.0), 1)
    assert slope == pytest.approx(-9.81, rel=0.2)


def test_tilted_it_empties_as_the_reference_curve_says(pot):
    lip = lip_alone(pot.cavity)
    axis = pour_axis(pot.cavity.opening_m, lip)
    kept = []
    for tilt_deg in REFERENCE:
        result = bullet.pour(pot, N, lip, axis, np.radians(tilt_deg), 1, wait_s=0.3, patient=True)
        assert not result.failed
        assert result.n_leaked == 0
        kept.append(result.n_retained / N)
    assert np.sqrt(np.mean((np.array(kept) - list(REFERENCE.values())) ** 2)) < 0.03


def test_forces_between_spheres_are_equal_and_opposite(pot):
    """Far from the wall there is nothing else: the momentum of the fluid stays."""
    rng = np.random.default_rng(3)
    grid = np.stack(np.meshgrid(*[np.arange(3) * 0.009] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    x = grid + rng.normal(0.0, 5e-4, grid.shape) + [-0.009, -0.009, 0.035]
    answer = forces.response(pot.walls, x, rng.normal(0.0, 0.1, x.shape))
    assert np.abs(answer.acceleration).max() > 1.0
    assert np.abs(answer.acceleration.sum(axis=0)).max() < 1e-9 * np.abs(answer.acceleration).max()


def test_dense_spheres_are_pushed_apart_and_parting_ones_held_back(pot):
    two = np.array([[0.0, 0.0, 0.05], [0.004, 0.0, 0.05]])
    parting = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]])
    alone = forces.response(pot.walls, two, np.zeros((2, 3)))
    assert (alone.density < 1.0).all()
    assert (alone.acceleration == 0.0).all()
    held = forces.response(pot.walls, two, parting).acceleration
    assert held[0, 0] > 0 > held[1, 0]
    assert not forces.response(pot.walls, two, parting).inside.any()
    crowd = np.vstack([two, two + [0.0, 0.004, 0.0], two + [0.0, 0.0, 0.004]])
    pushed = forces.response(pot.walls, crowd, np.zeros_like(crowd))
    assert pushed.density.max() > 1.0
    out = ((crowd - crowd.mean(axis=0)) * pushed.acceleration).sum(axis=1)
    assert (out >= 0.0).all()


def test_spheres_touch_the_container_and_not_each_other(pot):
    """Two at the same place fall through each other and stop on the floor."""
    with spheres.World(pot) as world:
        world.add(np.array([[0.0, 0.0, 0.020], [0.001, 0.0, 0.024]]))
        for _ in range(200):
            packing.still(world)
        x, _ = world.state()
    assert np.abs(x[:, 2] - WALL_M - pot.radius_m).max() < 5e-4
    assert np.linalg.norm(x[1] - x[0]) < pot.radius_m


def test_the_rim_is_lower_and_nothing_else_changes(pot):
    vertices, triangles = lathe(RADIUS_M, DEPTH_M, WALL_M)
    room = pot.cavity
    low, faces = fluid.lowered(room, vertices, triangles, 0.0075)
    assert low[:, 2].max() == pytest.approx(room.rim_m[:, 2].mean() - 0.0075, abs=2e-4)
    assert np.array_equal(low[:, :2], vertices[:, :2])
    assert np.array_equal(low[vertices[:, 2] < 0.05], vertices[vertices[:, 2] < 0.05])
    assert 0 < len(faces) <= len(triangles)


def test_places_are_told_by_the_rim_and_the_wall(pot):
    top, out = WALL_M + DEPTH_M, RADIUS_M + 0.004
    x = np.array(
        [
            [0.0, 0.0, 0.05],
            [out, 0.0, top + 0.002],
            [out, 0.0, 0.05],
            [0.0, 0.0, top + 0.1],
            [0.0, 0.0, -0.01],
        ]
    )
    where = places(pot, x)
    assert where.over.tolist() == [False, True, False, True, False]
    assert where.through.tolist() == [False, False, True, False, True]
    assert where.under.tolist() == [True, False, True, False, True]


def test_nothing_goes_through_a_wall_of_one_and_a_half_millimetres():
    mesh = lathe(0.030, 0.060, wall=0.0015)
    thin = fluid.prepare(cavity(*mesh, name="thin"), *mesh, SPACING_M)
    lip = lip_alone(thin.cavity)
    axis, rng = pour_axis(thin.cavity.opening_m, lip), np.random.default_rng(5)
    for seed in range(6):
        n = bullet.particles_for(thin, rng.uniform(0.05, 1.0) * thin.cavity.capacity_m3)
        result = bullet.pour(thin, n, lip, axis, rng.uniform(0.0, 2.1), seed)
        assert not result.failed
        assert result.n_leaked == 0
        assert result.n_left + result.n_retained == n


def test_a_brimful_cup_keeps_its_capacity(pot):
    """What runs over while it settles and stands is less than half a layer."""
    n = bullet.particles_for(pot, pot.cavity.capacity_m3)
    result = bullet.pour(pot, n, lip_alone(pot.cavity), np.array([0.0, 1.0, 0.0]), 0.0, 1, wait_s=0.0)
    assert result.n_leaked == 0
    assert result.n_left < 0.5 * np.pi * RADIUS_M**2 / SPACING_M**2
