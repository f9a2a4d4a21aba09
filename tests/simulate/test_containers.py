"""Bullet's answers about containers, against overlaps and gaps that are known."""

import numpy as np
import pytest
import trimesh

from pipeline.geometry import frames
from pipeline.simulate.containers import Containers, wall_pieces

CUP = {"radius": 0.040, "height": 0.090, "wall": 0.003}
BOWL = {"radius": 0.080, "height": 0.060, "wall": 0.003}
UP = np.array([0.0, 0.0, 1.0])


def lathe(radius, height, wall):
    profile = [
        (0, 0),
        (radius, 0),
        (radius, height),
        (radius - wall, height),
        (radius - wall, wall),
        (0, wall),
    ]
    mesh = trimesh.creation.revolve(profile, sections=180)
    return np.array(mesh.vertices), np.array(mesh.faces)


def at(x=0.0, y=0.0, z=0.0):
    return frames.transform(np.eye(3), np.array([x, y, z]))


@pytest.fixture(scope="module")
def scene():
    with Containers() as world:
        held = world.add_held(wall_pieces(*lathe(**CUP), np.array([0.0, 0.0, CUP["height"]])))
        second = world.add_second(*lathe(**BOWL))
        yield world, held, second


@pytest.mark.parametrize("gap_mm", [-2.0, 2.0, 10.0])
@pytest.mark.parametrize("azimuth", [0.0, 0.6, 2.0])
def test_gap_between_outer_walls(scene, gap_mm, azimuth):
    world, held, second = scene
    away = CUP["radius"] + BOWL["radius"] + gap_mm * 1e-3
    world.move(second, np.eye(4))
    world.move(held, at(away * np.cos(azimuth), away * np.sin(azimuth), 0.01))
    assert world.gap_m(held, second, 0.03) == pytest.approx(gap_mm * 1e-3, abs=0.7e-3)


@pytest.mark.parametrize("gap_mm", [-2.0, 2.0, 5.0])
def test_a_cup_inside_a_bowl_is_free_until_it_meets_the_wall_or_the_floor(scene, gap_mm):
    world, held, second = scene
    world.move(second, at(z=-0.02))
    inside = BOWL["radius"] - BOWL["wall"] - CUP["radius"]
    world.move(held, at(x=inside - gap_mm * 1e-3, z=0.0))
    assert world.gap_m(held, second) == pytest.approx(gap_mm * 1e-3, abs=0.7e-3)
    world.move(held, at(z=BOWL["wall"] - 0.02 + gap_mm * 1e-3))
    assert world.gap_m(held, second) == pytest.approx(gap_mm * 1e-3, abs=0.7e-3)


def test_the_rim_of_the_second_may_stand_in_the_held_cups_cavity():
    with Containers() as world:
        held = world.add_held(wall_pieces(*lathe(**BOWL), np.array([0.0, 0.0, BOWL["height"]])))
        second = world.add_second(*lathe(**CUP))
        upside_down = frames.transform(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, CUP["height"] + 0.01]))
        world.move(second, np.eye(4))
        world.move(held, upside_down)
        assert world.gap_m(held, second) == pytest.approx(0.01 - BOWL["wall"], abs=0.7e-3)


def test_the_hole_of_a_handle_stays_open():
    vertices, triangles = lathe(**CUP)
    ring = trimesh.creation.torus(
        0.018, 0.004, transform=trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0])
    )
    ring.apply_translation([0.057, 0, 0.045])
    both = trimesh.util.concatenate([trimesh.Trimesh(vertices, triangles), ring])
    with Containers() as world:
        held = world.add_held(wall_pieces(np.array(both.vertices), np.array(both.faces), np.zeros(3)))
        finger = trimesh.creation.box([0.004, 0.2, 0.004])
        second = world.add_second(np.array(finger.vertices), np.array(finger.faces))
        world.move(held, np.eye(4))
        world.move(second, at(0.056, 0.0, 0.045))
        assert world.gap_m(held, second) > 0.001
        world.move(second, at(0.073, 0.0, 0.045))
        assert world.gap_m(held, second) < 0.0


def test_pieces_cover_the_wall_and_leave_the_cavity_free():
    from scipy.spatial import ConvexHull

    vertices, triangles = lathe(**CUP)
    hulls = [ConvexHull(points) for points in wall_pieces(vertices, triangles, np.zeros(3))]
    assert len(hulls) <= 120
    volume = sum(hull.volume for hull in hulls)
    solid = np.pi * (CUP["radius"] ** 2 * CUP["height"] - 0.037**2 * 0.087)
    corner = np.pi * 0.037**2 * 0.009  # the pieces of the floor may fill the corner above it
    assert solid * 0.95 < volume < (solid + corner) * 1.25


def way(world, held, second, dx, dz, tilt_deg=120.0):
    """Put the held cup's lip at (dx, 0, dz) from the bowl's opening, pouring along +x."""
    lip_world = np.array([dx, 0.0, BOWL["height"] + dz])
    T_world_held = at(*(lip_world - [CUP["radius"], 0.0, CUP["height"]]))
    axis = np.array([0.0, 1.0, 0.0])
    return world.touch_on_the_way(
        held, second, T_world_held, np.eye(4), lip_world, axis, np.radians(tilt_deg)
    )


def test_contact_at_the_start_on_the_way_or_never(scene):
    assert way(*scene, dx=0.0, dz=0.05), "its side stands in the bowl's wall"
    assert not way(*scene, dx=-0.085, dz=0.05), "it stands beside the bowl"
    assert not way(*scene, dx=0.0, dz=0.10), "it hangs above the bowl"
    # Standing inside the bowl it is free, and at 120° it is above; between, its base swings into the wall.
    assert not way(*scene, dx=0.035, dz=0.04, tilt_deg=0.0)
    assert way(*scene, dx=0.035, dz=0.04)


def test_no_contact_is_jumped_over(scene):
    world, held, second = scene
    rng = np.random.default_rng(0)
    axis, tilts = np.array([0.0, 1.0, 0.0]), np.radians(np.arange(0.0, 120.5, 0.5))
    answers = []
    for _ in range(25):
        lip_world = np.array([*rng.uniform(-0.12, 0.12, 2), BOWL["height"] + rng.uniform(0.01, 0.09)])
        T_world_held = at(*(lip_world - [CUP["radius"], 0.0, CUP["height"]]))
        answer = world.touch_on_the_way(held, second, T_world_held, np.eye(4), lip_world, axis, tilts[-1])
        gaps = []
        for tilt in tilts if not answer else []:
            world.move(held, frames.tilted(T_world_held, lip_world, axis, tilt))
            gaps.append(world.gap_m(held, second, 0.0))
        assert answer or min(gaps) > -0.5e-3
        answers.append(answer)
    assert 3 < sum(answers) < 22


def test_the_same_question_has_the_same_answer(scene):
    world, held, second = scene
    world.move(second, np.eye(4))
    world.move(held, at(0.117, 0.01, 0.005))
    before = world.gap_m(held, second)
    way(world, held, second, dx=-0.085, dz=0.05)
    world.move(held, at(0.117, 0.01, 0.005))
    assert world.gap_m(held, second) == before
