"""The object on the table is found among other things; two objects are an error that shows both."""

import re
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from fuse import scenes, writers
from fuse.conftest import OPTIONS

from pipeline.errors import PipelineError
from pipeline.fuse import layouts, levelled, placement, posing, recorded, registration, table
from pipeline.fuse.fusion import fused
from pipeline.fuse.planes import planes
from pipeline.geometry import frames
from pipeline.scan import camera, recording
from pipeline.scan.shapes import shape

CUP = shape("small_cup")
T_WORLD_OBJECT = frames.transform(np.eye(3), np.array([0.02, -0.03, recording.TABLE_HEIGHT_M]))


def box(x: float, y: float, size=(0.06, 0.06, 0.08), bottom: float = recording.TABLE_HEIGHT_M):
    """Return a box that stands at (x, y)."""
    body = trimesh.creation.box(size)
    return body.vertices + [x, y, bottom + size[2] / 2], body.faces


def disc(diameter_m: float, thick_m: float, bottom: float = recording.TABLE_HEIGHT_M):
    """Return a round board under the cup."""
    body = trimesh.creation.cylinder(diameter_m / 2, thick_m, sections=64)
    return body.vertices + [0.02, -0.03, bottom + thick_m / 2], body.faces


ROOM = [
    box(0.0, 0.9, (4.0, 0.1, 3.0), 0.0),
    box(-0.9, 0.0, (0.1, 4.0, 3.0), 0.0),
    box(0, 0, (6.0, 6.0, 0.1), -0.1),
]


def found(folder, *others, hide=None, held=(), table: bool = True, n: int = 12, body=CUP):
    """Record the cup and others on the table, `held` in every second view; return the table and the placement that fuse finds."""
    cup = frames.apply(T_WORLD_OBJECT, body.vertices_m), body.triangles
    scene = camera.Scene([cup, *([recording.table()] if table else []), *others])
    other_scene = camera.Scene([cup, recording.table(), *others, *held]) if held else scene
    target = T_WORLD_OBJECT[:3, 3] + [0, 0, 0.03]
    images = []
    for i, T in enumerate(camera.turntable(n, target, 0.6)):
        shown = other_scene if i % 2 else scene
        depth = camera.depth_image(shown, T, camera.Noise(1.0), np.random.default_rng(i))
        images.append((depth if hide is None else hide(i, depth), T))
    writers.seven_scenes(folder, images)
    return placement.find(layouts.read(folder), str(folder), np.random.default_rng(3))


def check_cup(place, body=CUP) -> None:
    """The bounds are the cup's, with the margin, on the table."""
    T = place.T_object_world @ T_WORLD_OBJECT
    assert abs(T[2, 3]) < 0.0005
    assert np.linalg.norm(T[:2, 3]) < 0.002
    size = np.ptp(place.bounds_m, axis=0) - [
        2 * placement.MARGIN_M,
        2 * placement.MARGIN_M,
        placement.MARGIN_M,
    ]
    np.testing.assert_allclose(size, np.ptp(body.vertices_m, axis=0), atol=0.006)


def test_clutter_further_away_and_the_room_behind_are_cut_away(tmp_path):
    clutter = [box(0.30, 0.05), box(-0.25, 0.2, (0.1, 0.1, 0.2)), box(0.05, -0.33, (0.2, 0.05, 0.1))]
    _, place = found(tmp_path, *clutter, *ROOM)
    check_cup(place)


def test_a_hand_in_some_views_is_not_part_of_the_object(tmp_path):
    """A block of pixels nearer than the object hides part of it in every third view."""

    def hand(i: int, depth: np.ndarray) -> np.ndarray:
        if i % 3 == 0:
            depth = depth.copy()
            depth[280:480, 300 + 5 * i : 360 + 5 * i] = 480
        return depth

    _, place = found(tmp_path, hide=hand)
    check_cup(place)


def test_a_gripper_in_half_of_the_views_is_not_part_of_the_object(tmp_path):
    """Held above the cup: what is left of it made a turntable of the cup."""
    gripper = box(0.02, -0.03, (0.03, 0.03, 0.2), recording.TABLE_HEIGHT_M + 0.1)
    _, place = found(tmp_path, *ROOM, held=[gripper])
    check_cup(place)


def test_a_table_smaller_than_the_floor(tmp_path):
    floor = box(0.0, 0.0, (6.0, 6.0, 0.1), 0.2)
    plane, place = found(tmp_path, floor)
    assert plane.offset_m == pytest.approx(-recording.TABLE_HEIGHT_M, abs=0.0005)
    check_cup(place)


def test_two_objects_are_an_error_that_shows_both(tmp_path):
    with pytest.raises(PipelineError, match="found two") as caught:
        found(tmp_path, box(0.16, 0.02))
    message = str(caught.value)
    assert str(tmp_path) in message
    T_camera_world = np.linalg.inv(np.loadtxt(tmp_path / "frame-000000.pose.txt"))
    for place in (
        [0.02, -0.03, recording.TABLE_HEIGHT_M + 0.03],
        [0.16, 0.02, recording.TABLE_HEIGHT_M + 0.04],
    ):
        x, y, z = camera.intrinsics() @ frames.apply(T_camera_world, np.array(place))
        shown = re.findall(r"pixel \((\d+), (\d+)\) of frame-000000.depth.png", message)
        assert min(np.hypot(x / z - int(u), y / z - int(v)) for u, v in shown) < 5


@pytest.mark.parametrize("turn_deg", [0, 45])
def test_how_far_a_long_thing_is_does_not_depend_on_the_frame(tmp_path, turn_deg):
    """A board on edge, 18 cm away: its box in a frame turned by 45° comes within 5 cm of the cup."""
    turn = frames.rotation_about(np.array([0.0, 0.0, 1.0]), np.radians(turn_deg))
    vertices, triangles = box(-0.22, 0.0, (0.02, 0.26, 0.08))
    middle = np.array([0.03, -0.02, 0.0])
    _, place = found(
        tmp_path, (frames.rotate(frames.transform(turn, np.zeros(3)), vertices) + middle, triangles)
    )
    check_cup(place)


def test_a_crumb_beside_the_object_is_none(tmp_path):
    _, place = found(tmp_path, box(0.09, 0.0, (0.012, 0.012, 0.012)))
    check_cup(place)


def test_an_object_on_a_turntable_stands_on_it(tmp_path):
    disc = trimesh.creation.cylinder(0.13, 0.02, sections=64)
    low = disc.vertices + [0.03, -0.02, recording.TABLE_HEIGHT_M - 0.01], disc.faces
    lower = box(0.0, 0.0, (0.8, 0.8, 0.02), recording.TABLE_HEIGHT_M - 0.04)
    plane, place = found(tmp_path, low, lower, table=False)
    assert plane.offset_m == pytest.approx(-recording.TABLE_HEIGHT_M, abs=0.0005)
    check_cup(place)


def test_views_without_poses_stand_on_the_turntable_that_most_of_them_show(tmp_path):
    """Those at 12° do not show its top: it was part of the object in them, which became 9 mm too tall. Steep ones show little but
    the object's rim, and tell it from the turntable."""
    lower = box(0.0, 0.0, (0.8, 0.8, 0.02), recording.TABLE_HEIGHT_M - 0.05)
    found(tmp_path, disc(0.16, 0.03, recording.TABLE_HEIGHT_M - 0.03), lower, table=False, n=10)
    views = layouts.read(tmp_path)
    steep = levelled.level(views, 7, str(tmp_path), np.random.default_rng(2))
    assert np.ptp(steep.points_m[:, :2], axis=0).max() < 0.065
    stood, left_out = registration.levelled_all(views, str(tmp_path), np.random.default_rng(2))
    assert len(left_out) <= 1
    assert max(np.ptp(view.points_m[:, :2], axis=0).max() for view in stood) < 0.065
    assert max(view.points_m[:, 2].max() for view in stood) < 0.065


def test_views_that_show_nothing_lower_than_the_board_stand_on_it_as_well(tmp_path):
    """Three of nine show the cup on the board alone: they were stood higher by its thickness once more."""

    def close(i: int, depth: np.ndarray) -> np.ndarray:
        v, u = np.ogrid[: depth.shape[0], : depth.shape[1]]
        near = (np.abs(v - depth.shape[0] / 2) < 100) & (np.abs(u - depth.shape[1] / 2) < 100)
        return np.where(near | (i not in (5, 6, 7)), depth, 0).astype(depth.dtype)

    board = box(0.02, -0.03, (0.4, 0.4, 0.012), recording.TABLE_HEIGHT_M - 0.012)
    lower = box(0.0, 0.0, (0.9, 0.9, 0.02), recording.TABLE_HEIGHT_M - 0.032)
    found(tmp_path, board, lower, table=False, n=9, hide=close)
    views = layouts.read(tmp_path)
    stood, left_out = registration.levelled_all(views, str(tmp_path), np.random.default_rng(2))
    # The steepest shows too little of the table for a board that large.
    assert left_out in ([], ["frame-000008.depth.png"])
    tops_m = [view.points_m[:, 2].max() for view in stood]
    assert 0.057 < min(tops_m) <= max(tops_m) < 0.066, tops_m


@pytest.mark.parametrize("world_m", [0.0, 3.0])
def test_a_table_that_a_camera_bends_is_no_board_wherever_the_world_is(tmp_path, world_m):
    def bent(_: int, depth: np.ndarray) -> np.ndarray:
        v, u = np.ogrid[: depth.shape[0], : depth.shape[1]]
        off = np.hypot(v - depth.shape[0] / 2, u - depth.shape[1] / 2) / 400
        return np.round(depth * (1 + 0.01 * off**2)).astype(depth.dtype)

    found(tmp_path, hide=bent, n=6)
    views = layouts.read(tmp_path)
    shift = frames.transform(np.eye(3), np.array([world_m, 0.0, 0.0]))
    views = replace(views, T_world_cameras=[shift @ T for T in views.T_world_cameras])
    _, place = placement.find(views, "cup", np.random.default_rng(3))
    assert place.raised_m == 0.0


@pytest.mark.parametrize("width_m", [0.2, 0.09])
def test_an_object_on_a_board_of_markers_stands_on_it(tmp_path, width_m):
    """A board of 5 mm is lower than what counts as an object, and is none of it; beside a narrow one more of the table is seen."""
    board = box(0.02, -0.03, (0.28, width_m, 0.005), recording.TABLE_HEIGHT_M - 0.005)
    lower = box(0.0, 0.0, (0.9, 0.9, 0.02), recording.TABLE_HEIGHT_M - 0.025)
    plane, place = found(tmp_path, board, lower, table=False)
    assert plane.offset_m == pytest.approx(-recording.TABLE_HEIGHT_M, abs=0.0007)
    assert place.raised_m == pytest.approx(0.005, abs=0.001)
    check_cup(place)
    views = layouts.read(tmp_path)
    assert posing.off_m(views, place) < posing.OFF_M
    on_board = recorded.Located(views, plane, place, planes(views, place), [], {})
    assert on_board.spread_m < 0.0015


@pytest.mark.parametrize(
    ("name", "board"),
    [
        ("small_cup", box(0.02, -0.03, (0.085, 0.085, 0.006), recording.TABLE_HEIGHT_M - 0.006)),
        ("wide_bowl", disc(0.19, 0.01, recording.TABLE_HEIGHT_M - 0.01)),
        ("small_cup", disc(0.16, 0.03, recording.TABLE_HEIGHT_M - 0.03)),
    ],
)
def test_an_object_on_a_board_that_is_little_wider_stands_on_it(tmp_path, name, board):
    """They were part of the object: one that is lower than an object is, one of less than twice its area, one whose side shows."""
    lower = box(0.0, 0.0, (0.9, 0.9, 0.02), recording.TABLE_HEIGHT_M - np.ptp(board[0][:, 2]) - 0.02)
    plane, place = found(tmp_path, board, lower, table=False, body=shape(name))
    assert plane.offset_m == pytest.approx(-recording.TABLE_HEIGHT_M, abs=0.0007)
    check_cup(place, shape(name))


def test_a_board_as_wide_as_the_object_is_fused_with_it_and_told(tmp_path):
    coaster = disc(0.068, 0.01, recording.TABLE_HEIGHT_M - 0.01)
    lower = box(0.0, 0.0, (0.9, 0.9, 0.02), recording.TABLE_HEIGHT_M - 0.03)
    found(tmp_path, coaster, lower, table=False, n=8)
    told = fused(tmp_path, **OPTIONS).complaints
    assert any("something level, 10 mm above the table" in sentence for sentence in told), told


def test_a_saucer_under_the_cup_is_no_table(tmp_path):
    """It rises to its rim, at whose height the cup was cut off."""
    profile_m = [[0, 0], [0.03, 0], [0.032, 0.003], [0.07, 0.016], [0.07, 0.018], [0.03, 0.006], [0, 0.005]]
    saucer = trimesh.creation.revolve(np.array(profile_m), sections=64)
    placed = saucer.vertices + [0.02, -0.03, recording.TABLE_HEIGHT_M - 0.005], saucer.faces
    lower = box(0.0, 0.0, (0.9, 0.9, 0.02), recording.TABLE_HEIGHT_M - 0.025)
    plane, place = found(tmp_path, placed, lower, table=False, n=8)
    assert plane.offset_m == pytest.approx(0.005 - recording.TABLE_HEIGHT_M, abs=0.0007)
    assert np.ptp(place.bounds_m, axis=0)[0] == pytest.approx(0.14 + 2 * placement.MARGIN_M, abs=0.006)


def test_a_book_beside_the_object_does_not_carry_it(tmp_path):
    book = box(0.14, -0.03, (0.14, 0.2, 0.006))
    plane, place = found(tmp_path, book)
    assert plane.offset_m == pytest.approx(-recording.TABLE_HEIGHT_M, abs=0.0005)
    check_cup(place)


def test_a_lid_is_no_turntable(tmp_path):
    """A pot with a flat lid and a knob is one object, knob and all."""
    pot = trimesh.creation.cylinder(0.045, 0.1, sections=64)
    pot.apply_translation([0.0, 0.0, 0.05])
    knob = trimesh.creation.cylinder(0.01, 0.015, sections=32)
    knob.apply_translation([0.0, 0.0, 0.1075])
    body = trimesh.util.concatenate([pot, knob])
    lidded = body.vertices + [0.03, -0.02, recording.TABLE_HEIGHT_M], body.faces
    _, place = found(tmp_path, lidded)
    assert place.bounds_m[1, 2] == pytest.approx(0.115 + placement.MARGIN_M, abs=0.003)


@pytest.mark.parametrize(("n", "distance_m", "stride"), [(36, 0.6, 3), (12, 1.2, 2), (12, 1.6, 1)])
def test_an_object_that_is_far_away_is_one(monkeypatch, n, distance_m, stride):
    """Twelve views from 1.4 m saw a mug as two halves."""
    monkeypatch.setattr(scenes, "DISTANCE_M", distance_m)
    views, _ = scenes.views(shape("mug"), n)
    assert placement.stride(views, table.focus(views)) == stride
    place = placement.find(views, "mug", np.random.default_rng(2))[1]
    assert place.bounds_m[1, 2] == pytest.approx(shape("mug").height_m + placement.MARGIN_M, abs=0.01)


def test_points_near_a_place_are_those_of_all_that_are_near_to_it():
    views, _ = scenes.views(shape("mug"), 10)
    middle = table.focus(views)
    everything, near = (table.world_points(views, table.STRIDE, middle, reach_m) for reach_m in (np.inf, 0.1))
    is_near = np.sum((everything.places_m - middle) ** 2, axis=1) < 0.1**2
    assert 0 < is_near.sum() < len(is_near) / 2
    np.testing.assert_array_equal(near.places_m, everything.places_m[is_near])
    np.testing.assert_array_equal(near.view, everything.view[is_near])
