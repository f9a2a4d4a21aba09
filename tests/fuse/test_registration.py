"""Views without poses: registered to within twice the errors of posed fusion; what no view can tell is said."""

import numpy as np
import pytest
from fuse import writers

from pipeline.errors import PipelineError
from pipeline.fuse import layouts, levelled, recorded
from pipeline.geometry import frames
from pipeline.scan import camera, recording
from pipeline.scan.shapes import shape

T_WORLD_OBJECT = frames.transform(np.eye(3), np.array([0.02, -0.03, recording.TABLE_HEIGHT_M]))
RINGS_DEG = ((25.0, 4), (52.0, 8))


def record(folder, name: str, options: str = "") -> np.ndarray:
    """Write views of an object on the table without their poses, and return these (N, 4, 4)."""
    body = shape(name)
    cup = frames.apply(T_WORLD_OBJECT, body.vertices_m), body.triangles
    scene = camera.Scene([cup, recording.table()])
    target, recorded = T_WORLD_OBJECT[:3, 3] + [0, 0, body.height_m / 2], []
    for elevation, count in RINGS_DEG:
        for k in range(count):
            a, e = 2 * np.pi * k / count, np.deg2rad(elevation)
            direction = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
            T = frames.look_at(target + 0.6 * direction, target)
            recorded.append(
                (camera.depth_image(scene, T, camera.Noise(1.0), np.random.default_rng(len(recorded))), T)
            )
    writers.seven_scenes(folder, recorded)
    for path in folder.glob("*.pose.txt"):
        path.unlink()
    if options:
        (folder / "scan.yaml").write_text(options)
    return np.stack([T for _, T in recorded])


def located(folder):
    """Return the views with the poses that were found, table and object."""
    return recorded.located(layouts.read(folder), str(folder), np.random.default_rng(1))


def test_a_view_is_stood_upright_by_its_table(tmp_path):
    poses = record(tmp_path, "espresso_cup")
    view = levelled.level(layouts.read(tmp_path), 6, "cup", np.random.default_rng(1))
    T_level_object = view.T_level_camera @ np.linalg.inv(poses[6]) @ T_WORLD_OBJECT
    np.testing.assert_allclose(T_level_object[:3, 2], [0, 0, 1], atol=0.002)
    assert abs(T_level_object[2, 3]) < 0.0005
    assert np.linalg.norm(T_level_object[:2, 3]) < 0.004


def test_a_handle_tells_the_turns_of_the_views(tmp_path):
    truth = record(tmp_path, "espresso_cup")
    scan = located(tmp_path)
    assert scan.registration["roll_observable"]
    first = truth[6] @ np.linalg.inv(scan.views.T_world_cameras[6])
    from_above = slice(
        RINGS_DEG[0][1], None
    )  # lower views, which the cup hides its handle from, have no turn
    for found, true in zip(scan.views.T_world_cameras[from_above], truth[from_above], strict=True):
        apart = np.linalg.inv(true) @ first @ found
        turn = np.degrees(np.arccos(np.clip((np.trace(apart[:3, :3]) - 1) / 2, -1, 1)))
        assert turn < 4.0  # its two sides are seen by different views
        assert abs(apart[2, 2] - 1) < 1e-2


def test_a_round_cup_is_said_to_be_round_and_seen_from_all_sides(tmp_path):
    record(tmp_path, "small_cup")
    scan = located(tmp_path)
    assert not scan.registration["roll_observable"]
    eyes = np.array([(scan.placement.T_object_world @ T)[:2, 3] for T in scan.views.T_world_cameras])
    gaps = np.diff(np.sort(np.arctan2(*eyes.T)))
    assert gaps.max() < np.deg2rad(75)


def test_too_few_views_without_poses_are_refused(tmp_path):
    record(tmp_path, "small_cup")
    for path in sorted(tmp_path.glob("*.depth.png"))[5:]:
        path.unlink()
    with pytest.raises(PipelineError, match="expected at least 6 views where there are no poses, found 5"):
        located(tmp_path)


def test_as_many_angles_as_views(tmp_path):
    record(tmp_path, "small_cup", "turntable_deg: [0, 90, 180]\n")
    with pytest.raises(
        PipelineError, match="turntable_deg: expected an angle for each of the 12 views, found 3"
    ):
        located(tmp_path)
