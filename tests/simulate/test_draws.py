"""The drawn trials keep to the protocol: ranges, halves, lips, axes, poses."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from pipeline.geometry import frames
from pipeline.geometry.cavity import cavity, lip_alone
from pipeline.simulate import draws

POURING = draws.Pouring(fill_min=0.05, fill_max=1.0, tilt_max_rad=np.radians(120.0), threshold=1)
FILLING = draws.Filling(10, np.radians(120.0), 1.5, 0.1, 1.0, 20)
PARTICLE_M3 = 1e-6
HEIGHT_M = 0.060
N = 600


def lathe(radius, height, wall=0.003, stretch=1.0):
    profile = [
        (0, 0),
        (radius, 0),
        (radius, height),
        (radius - wall, height),
        (radius - wall, wall),
        (0, wall),
    ]
    mesh = trimesh.creation.revolve(profile, sections=128)
    return np.array(mesh.vertices) * [stretch, 1.0, 1.0], np.array(mesh.faces)


@pytest.fixture(scope="module")
def oval():
    return cavity(*lathe(0.027, HEIGHT_M, stretch=1.3), name="oval")


@pytest.fixture(scope="module")
def bowl():
    return cavity(*lathe(0.055, 0.045), name="bowl")


@pytest.fixture(scope="module")
def pourings(oval):
    return [draws.draw_pouring(oval, POURING, draws.stream(1, k)) for k in range(N)]


@pytest.fixture(scope="module")
def fillings(oval, bowl):
    return [
        draws.draw_filling(oval, HEIGHT_M, bowl, PARTICLE_M3, FILLING, k, draws.stream(1, k))
        for k in range(N)
    ]


def assert_uniform(values, low, high):
    values = np.asarray(values)
    assert low <= values.min()
    assert values.max() <= high
    counts = np.histogram(values, bins=6, range=(low, high))[0]
    expected = len(values) / 6
    assert (
        np.sum((counts - expected) ** 2 / expected) < 20.5
    )  # chi-square with 5 degrees of freedom, p = 0.001


def test_seeds_tell_trials_objects_experiments_and_runs_apart():
    seeds = {
        draws.trial_seed(seed, experiment, name, trial)
        for seed in (1, 2)
        for experiment in ("pouring", "filling")
        for name in ("mug", "jug")
        for trial in range(100)
    }
    assert len(seeds) == 800
    assert all(0 <= seed < 2**63 for seed in seeds)
    assert draws.trial_seed(1, "pouring", "mug", 3) == draws.trial_seed(1, "pouring", "mug", 3)


def test_attempts_have_streams_of_their_own():
    first, second = draws.stream(5, 0).uniform(size=100), draws.stream(5, 1).uniform(size=100)
    assert not np.isin(first, second).any()
    np.testing.assert_array_equal(first, draws.stream(5, 0).uniform(size=100))


def test_pourings_are_uniform_in_fill_and_tilt(oval, pourings):
    assert_uniform([d.fill_m3 / oval.capacity_m3 for d in pourings], 0.05, 1.0)
    assert_uniform(np.degrees([d.tilt_rad for d in pourings]), 0.0, 120.0)


def test_a_cup_alone_pours_over_its_own_lip_downwards(oval, pourings):
    draw = pourings[0]
    np.testing.assert_array_equal(draw.lip_m, lip_alone(oval))
    out = draw.lip_m[:2] - oval.opening_m[:2]
    assert draw.axis[2] == 0.0
    assert draw.axis[:2] @ out == pytest.approx(0.0, abs=1e-12)
    T_tilted = frames.tilted(np.eye(4), draw.lip_m, draw.axis, np.radians(30.0))
    np.testing.assert_allclose(frames.apply(T_tilted, draw.lip_m), draw.lip_m, atol=1e-12)
    assert frames.apply(T_tilted, oval.opening_m)[2] > oval.opening_m[2] + 0.01


def test_fillings_are_uniform_in_offset_height_and_yaw(bowl, fillings):
    radius = bowl.opening_radius_m
    assert 0.0515 < radius < 0.0555  # between the wall's two edges
    assert_uniform([d.dx_m / radius for d in fillings], -1.5, 1.5)
    assert_uniform([d.dy_m / radius for d in fillings], -1.5, 1.5)
    assert_uniform([d.dz_m / HEIGHT_M for d in fillings], 0.1, 1.0)
    yaws = [np.arctan2(d.T_world_held[1, 0], d.T_world_held[0, 0]) for d in fillings]
    assert_uniform(yaws, -np.pi, np.pi)


def test_both_halves_of_the_second_fill(bowl, fillings):
    capacity = bowl.capacity_m3
    assert [d.half for d in fillings] == ["relative", "free_room"] * (N // 2)
    assert_uniform([d.second_fill_m3 / capacity for d in fillings[::2]], 0.0, 1.0)
    assert_uniform([(capacity - d.second_fill_m3) / PARTICLE_M3 for d in fillings[1::2]], 0.0, 20.0)


def test_a_second_smaller_than_the_free_room_is_empty_at_worst(oval, bowl):
    drawn = [
        draws.draw_filling(oval, HEIGHT_M, bowl, bowl.capacity_m3 / 5, FILLING, 1, draws.stream(1, k))
        for k in range(50)
    ]
    assert min(d.second_fill_m3 for d in drawn) == 0.0


def test_poses_are_upright_and_the_lip_is_where_it_was_drawn(bowl, fillings):
    for draw in fillings[:100]:
        R = draw.T_world_held[:3, :3]
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(R[:, 2], [0, 0, 1], atol=1e-12)
        offset = draw.lip_world - frames.apply(draw.T_world_second, bowl.opening_m)
        along = np.cross(draw.axis_world, [0, 0, 1])
        np.testing.assert_allclose(
            [offset @ along, offset @ draw.axis_world, offset[2]],
            [draw.dx_m, draw.dy_m, draw.dz_m],
            atol=1e-12,
        )


def test_the_pour_goes_from_the_held_opening_over_the_lip(oval, fillings):
    for draw in fillings[:100]:
        out = draw.lip_world - frames.apply(draw.T_world_held, oval.opening_m)
        along = np.cross(draw.axis_world, [0, 0, 1])
        assert draw.axis_world[2] == 0.0
        assert out @ draw.axis_world == pytest.approx(0.0, abs=1e-12)
        assert out @ along > 0.02
        T_tilted = frames.tilted(draw.T_world_held, draw.lip_world, draw.axis_world, np.radians(30.0))
        np.testing.assert_allclose(frames.apply(T_tilted, draw.lip_m), draw.lip_world, atol=1e-12)
        assert frames.apply(T_tilted, oval.opening_m)[2] > draw.lip_world[2] + 0.01


def test_the_lip_is_the_rim_point_nearest_to_the_second_on_approach(oval, bowl, fillings):
    rim = oval.rim_m
    for draw in fillings[:100]:
        along = np.cross(draw.axis_world, [0, 0, 1])
        back = draw.T_world_held.copy()
        wanted = bowl.opening_m - 1.5 * bowl.opening_radius_m * along + [0, 0, draw.dz_m]
        back[:3, 3] += wanted - draw.lip_world
        distances = np.linalg.norm(frames.apply(back, rim) - bowl.opening_m, axis=1)
        lip = np.linalg.norm(frames.apply(back, draw.lip_m) - bowl.opening_m)
        # An oval's nearest point moves a little as the cup is shifted sideways onto the line through its lip.
        assert lip - distances.min() < 0.004
        assert lip < np.quantile(distances, 0.2)


def test_absolute_ranges_are_those_of_one_cup_and_end_where_the_object_is_full(oval, bowl):
    pouring, filling = replace(POURING, ranges="absolute"), replace(FILLING, ranges="absolute")
    for cup in (oval, bowl):
        fills = [draws.draw_pouring(cup, pouring, np.random.default_rng(i)).fill_m3 for i in range(N)]
        most = min(draws.CUP_M3, cup.capacity_m3)
        assert 0.95 * most < max(fills) <= most
    drawn = [
        draws.draw_filling(oval, HEIGHT_M, bowl, PARTICLE_M3, filling, i, np.random.default_rng(i))
        for i in range(N)
    ]
    assert 0.97 * 1.5 * draws.CUP_RADIUS_M < max(abs(draw.dx_m) for draw in drawn) <= 1.5 * draws.CUP_RADIUS_M
    heights = [draw.dz_m for draw in drawn]
    assert min(heights) >= draws.CUP_HEIGHT_M * 0.1
    assert 0.97 * draws.CUP_HEIGHT_M < max(heights) <= draws.CUP_HEIGHT_M
