"""Which way an object stands and faces, and what is said where nothing tells."""

from dataclasses import replace

import numpy as np
import pytest
from warp.bodies import cloud, moved, turned

from pipeline.errors import PipelineError
from pipeline.geometry.frames import rotation_about
from pipeline.warp.alignment import part_frame
from pipeline.warp.clouds import ARRAYS, Cloud
from pipeline.warp.roll import outline

UP = [0.0, 0.0, 1.0]
ON_ITS_SIDE = rotation_about(np.array([1.0, 0.0, 0.0]), np.pi / 2)


def azimuth(axis: np.ndarray) -> float:
    return float(np.arctan2(axis[1], axis[0]))


def second_azimuth(body: Cloud) -> float:
    return azimuth(part_frame(body).T_object_part[:3, 1])


def angle_between(a: float, b: float, period: float = 2 * np.pi) -> float:
    return abs((a - b + period / 2) % period - period / 2)


def handle_azimuth(body: Cloud) -> float:
    offset = body.points_m[body.parts[:, 2]].mean(axis=0) - body.points_m[body.parts[:, 0]].mean(axis=0)
    return azimuth(offset)


def spout_of_the_jug() -> tuple[Cloud, np.ndarray]:
    """Return the jug, and which of its points stick out at its rim, across from the handle."""
    jug = cloud("jug")
    offset = jug.points_m[:, :2] - jug.points_m[jug.parts[:, 0], :2].mean(axis=0)
    handle = handle_azimuth(jug)
    away = angle_between_all(np.arctan2(offset[:, 1], offset[:, 0]), handle + np.pi) < 0.7
    return jug, away & (jug.points_m[:, 2] > 0.6 * jug.points_m[:, 2].max())


def angle_between_all(azimuths: np.ndarray, other: float) -> np.ndarray:
    return np.abs((azimuths - other + np.pi) % (2 * np.pi) - np.pi)


def test_part_frame_points_to_the_rim_and_to_the_handle():
    mug = cloud("mug")
    other = moved(mug, 0.7, 1.0, (0.02, -0.01, 0.0))
    frame, other = (part_frame(body) for body in (mug, other))
    np.testing.assert_allclose(other.T_object_part[:3, 0], [0.0, 0.0, 1.0])
    turn = np.arctan2(*other.T_object_part[1::-1, 1]) - np.arctan2(*frame.T_object_part[1::-1, 1])
    assert turn % (2 * np.pi) == pytest.approx(0.7, abs=0.01)
    assert frame.roll_observable
    assert np.linalg.det(frame.T_object_part[:3, :3]) == pytest.approx(1.0)


def test_a_round_cup_has_no_observable_roll():
    cup = cloud("short_cup")
    assert not part_frame(cup).roll_observable


def test_a_base_edge_taken_for_rim_does_not_flip_the_frame():
    cup = cloud("short_cup")
    parts = cup.parts.copy()
    parts[:, 1] |= (cup.points_m[:, 2] < 0.004) & (np.linalg.norm(cup.points_m[:, :2], axis=1) > 0.03)
    frame = part_frame(replace(cup, parts=parts))
    np.testing.assert_allclose(frame.T_object_part[:3, 0], [0.0, 0.0, 1.0])


def test_an_upside_down_cup_is_named():
    cup = cloud("short_cup")
    with pytest.raises(
        PipelineError,
        match=r"short_cup: expected an upright.*upside down: its rim lies 1[78][0-9]° from the top",
    ):
        part_frame(turned(cup, np.diag([1.0, -1.0, -1.0]), 1.0, np.zeros(3)))


@pytest.mark.parametrize("name", ["short_cup", "wide_bowl", "espresso_cup"])
def test_a_lying_object_is_named(name):
    with pytest.raises(
        PipelineError, match=rf"{name}: expected an upright.*lying on its side: .*[89][0-9]° from"
    ):
        part_frame(turned(cloud(name), ON_ITS_SIDE, 1.0, np.zeros(3)))


def test_a_leaning_object_is_named():
    leaning = rotation_about(np.array([1.0, 0.0, 0.0]), np.radians(45.0))
    with pytest.raises(PipelineError, match="leaning"):
        part_frame(turned(cloud("tall_cup"), leaning, 1.0, np.zeros(3)))


def test_an_object_without_any_rim_is_named():
    cup = cloud("short_cup")
    parts = cup.parts & [True, False, True]
    with pytest.raises(PipelineError, match="short_cup: expected a rim around an opening"):
        part_frame(replace(cup, parts=parts))


def test_an_upside_down_object_whose_base_edge_passes_for_a_rim_is_named():
    cup = turned(cloud("short_cup"), np.diag([1.0, -1.0, -1.0]), 1.0, np.zeros(3))
    parts = cup.parts.copy()
    parts[:, 1] |= cup.points_m[:, 2] > cup.points_m[:, 2].max() - 0.004
    with pytest.raises(PipelineError, match="upside down"):
        part_frame(replace(cup, parts=parts))


@pytest.mark.parametrize("name", ["mug", "espresso_cup", "jug"])
def test_a_handle_tells_the_roll(name):
    body = cloud(name)
    frame = part_frame(body)
    assert (frame.handles, frame.roll_symmetry, frame.roll_observable) == (1, 1, True)
    assert angle_between(second_azimuth(body), handle_azimuth(body)) < np.radians(2.0)


def in_two_and_more(body: Cloud, handle: np.ndarray, radial: np.ndarray) -> np.ndarray:
    """Return which points are taken for handle: both ends of it, and a band of the wall that is as large."""
    height = body.points_m[:, 2]
    low, high = np.quantile(height[handle], [0.3, 0.7])
    ends = handle & ((height < low) | (height > high))
    return ends | (~handle & (radial > 0.0) & (height < np.quantile(height[radial > 0.0], 0.2)))


def half_of_the_body(body: Cloud, handle: np.ndarray, radial: np.ndarray) -> np.ndarray:
    """Return which points are taken for handle: it, and half of the outer wall, joined to it."""
    return handle | ((radial > 0.0) & (body.points_m[:, 2] < 0.7 * body.points_m[:, 2].max()))


@pytest.mark.parametrize("taken", [in_two_and_more, half_of_the_body])
@pytest.mark.parametrize("name", ["mug", "espresso_cup", "jug"])
def test_a_handle_tells_the_roll_where_its_labels_have_gaps_or_run_over_the_wall(name, taken):
    body = cloud(name)
    handle = body.parts[:, 2]
    middle_m = body.points_m[body.parts[:, 0]].mean(axis=0)
    radial = np.einsum("nc,nc->n", (body.points_m - middle_m)[:, :2], body.normals[:, :2])
    parts = body.parts.copy()
    parts[:, 2] = taken(body, handle, radial)
    assert (parts[:, 2] & ~handle).sum() > 0.5 * handle.sum()
    frame = part_frame(replace(body, parts=parts))
    assert frame.handles == 1
    assert angle_between(azimuth(frame.T_object_part[:3, 1]), handle_azimuth(body)) < np.radians(6.0)


def test_of_two_handles_one_is_taken_and_both_are_counted():
    mug = cloud("mug")
    other = moved(mug, np.pi / 2, 1.0, (0.0, 0.0, 0.0))
    handle = other.parts[:, 2]
    both = Cloud("mug", *(np.concatenate([getattr(mug, a), getattr(other, a)[handle]]) for a in ARRAYS))
    frame = part_frame(both)
    assert frame.handles == 2
    towards = second_azimuth(both)
    ends = [handle_azimuth(mug), handle_azimuth(mug) + np.pi / 2]
    assert min(angle_between(towards, end) for end in ends) < np.radians(5.0)
    # Of handles that are alike the same one, whatever the order of the points and however they are turned.
    backwards = Cloud("mug", *(getattr(both, a)[::-1] for a in ARRAYS))
    assert second_azimuth(backwards) == pytest.approx(towards, abs=1e-6)
    for yaw_rad in (0.8, 2.0, -2.9):
        turned_both = moved(both, yaw_rad, 1.0, (0.0, 0.1, 0.0))
        assert angle_between(second_azimuth(turned_both), towards + yaw_rad) < 1e-6


def test_a_speck_taken_for_a_handle_is_none():
    cup = cloud("short_cup")
    parts = cup.parts.copy()
    parts[:60, 2] = True
    parts[:, 2] |= (cup.points_m[:, 2] < 0.02) & (cup.points_m[:, 0] > 0.02)
    frame = part_frame(replace(cup, parts=parts))
    assert (frame.handles, frame.roll_symmetry) == (0, 0)


def test_a_spout_taken_for_a_handle_does_not_turn_the_frame():
    jug, spout = spout_of_the_jug()
    assert spout.sum() > jug.parts[:, 2].sum()
    parts = jug.parts.copy()
    parts[spout, 2] = True
    frame = part_frame(replace(jug, parts=parts))
    assert frame.handles == 1
    assert angle_between(azimuth(frame.T_object_part[:3, 1]), handle_azimuth(jug)) < np.radians(2.0)


def test_without_a_handle_a_spout_tells_the_roll():
    jug, spout = spout_of_the_jug()
    parts = jug.parts & [True, True, False]
    for taken in (np.zeros(len(spout), dtype=bool), spout):
        parts[:, 2] = taken
        frame = part_frame(replace(jug, parts=parts))
        assert (frame.handles, frame.roll_symmetry) == (0, 1)
        # The second axis points to where a handle would be.
        assert angle_between(azimuth(frame.T_object_part[:3, 1]), handle_azimuth(jug)) < np.radians(6.0)


@pytest.mark.parametrize("yaw_rad", [0.3, 0.8, 2.0, -2.9])
def test_a_square_bowl_has_four_rolls_and_of_them_always_the_same_is_taken(yaw_rad):
    bowl = cloud("square_bowl")
    turned_bowl = moved(bowl, yaw_rad, 1.3, (0.05, 0.02, 0.0))
    frame = part_frame(turned_bowl)
    assert (frame.roll_symmetry, frame.roll_observable) == (4, False)
    assert angle_between(second_azimuth(turned_bowl), second_azimuth(bowl) + yaw_rad) < np.radians(0.01)
    # At any yaw one of its corners, which lie on the diagonals.
    assert angle_between(second_azimuth(bowl), np.pi / 4, period=np.pi / 2) < np.radians(3.0)


@pytest.mark.parametrize("name", ["short_cup", "tall_cup", "small_cup", "tumbler", "wide_bowl", "big_bowl"])
@pytest.mark.parametrize("yaw_rad", [1.0, -2.9])
def test_a_round_object_may_be_turned_anyhow_and_its_frame_turns_with_it(name, yaw_rad):
    turned_body = moved(cloud(name), yaw_rad, 0.7, (0.1, -0.2, 0.0))
    frame = part_frame(turned_body)
    assert (frame.roll_symmetry, frame.roll_observable) == (0, False)
    assert angle_between(second_azimuth(turned_body), second_azimuth(cloud(name)) + yaw_rad) < 1e-6


def test_an_oval_has_two_rolls_along_its_length():
    angle = np.linspace(0, 2 * np.pi, 500, endpoint=False)
    ring = np.column_stack([0.06 * np.cos(angle), 0.04 * np.sin(angle), np.zeros(500)])
    R = rotation_about(np.array(UP), 0.6)
    for skew_rad, nearest_rad in ((0.3, 0.6), (3.0, 0.6 + np.pi)):
        turn, symmetry = outline(ring @ R.T, skew_rad)
        assert symmetry == 2
        assert angle_between(turn, nearest_rad) < 0.01
