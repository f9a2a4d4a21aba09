"""The virtual camera: geometry, steps and noise as published."""

import numpy as np
import pytest

from pipeline.errors import PipelineError
from pipeline.geometry import frames
from pipeline.scan import camera, recording
from pipeline.scan.shapes import shape

DOWN = frames.look_at(np.array([0.0, 0.0, 0.6]), np.zeros(3))


def plane(height_m: float) -> camera.Scene:
    corners = np.array([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0.0]]) + [0, 0, height_m]
    return camera.Scene([(corners, np.array([[0, 1, 2], [0, 2, 3]]))])


def test_depth_is_along_the_axis_and_in_disparity_steps():
    depth = camera.depth_image(plane(0.0), DOWN, camera.Noise(0.0), np.random.default_rng(1))
    assert depth.dtype == np.uint16
    step = 0.6**2 / (camera.FOCAL_PX * camera.BASELINE_M) * camera.DISPARITY_STEP_PX
    assert np.unique(depth).size == 1
    assert abs(int(depth[0, 0]) - 600) <= 1000 * step


def test_noise_grows_with_distance_as_published():
    found = []
    for height in (0.0, -0.9):
        depth = camera.depth_image(plane(height), DOWN, camera.Noise(1.0), np.random.default_rng(2))
        found.append(depth[depth > 0].std())
    step = np.array([0.6, 1.5]) ** 2 / (camera.FOCAL_PX * camera.BASELINE_M) * camera.DISPARITY_STEP_PX * 1000
    published = 1.2 + 1.9 * (np.array([0.6, 1.5]) - 0.4) ** 2
    np.testing.assert_allclose(found, np.hypot(published, step / np.sqrt(12)), rtol=0.05)


def test_grazing_pixels_are_lost():
    low = frames.look_at(np.array([-0.6, 0.0, 0.06]), np.array([0.0, 0.0, 0.06]))
    depth = camera.depth_image(plane(0.0), low, camera.Noise(0.0), np.random.default_rng(3))
    assert not depth[: camera.HEIGHT // 2 + 60].any()  # up to about 6° below the horizon
    assert depth[-1].any()


def test_views_look_at_the_object_from_all_sides():
    target = np.array([0.1, -0.2, 0.75])
    poses = camera.turntable(36, target, 0.6)
    assert len(poses) == 36
    for T in poses:
        np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(frames.apply(frames.inverse(T), target), [0, 0, 0.6], atol=1e-12)
        assert T[2, 3] > target[2]
    steep = np.arcsin([(T[2, 3] - target[2]) / 0.6 for T in poses]) > np.deg2rad(59)
    assert steep.sum() >= 10


def test_a_recording_depends_on_seed_and_name_alone(tmp_path):
    cup = shape("small_cup")
    T = recording.pose_on_table(recording.generator(1, cup.name, 0))
    for name, seed in (("first", 1), ("again", 1), ("other", 2)):
        recording.write(tmp_path / name, recording.views(cup, T, 10, 0.6, 1.0, seed))
    files = sorted(p.name for p in (tmp_path / "first").iterdir())
    assert len(files) == 21
    assert all((tmp_path / "first" / f).read_bytes() == (tmp_path / "again" / f).read_bytes() for f in files)
    image = "frame-000003.depth.png"
    assert (tmp_path / "first" / image).read_bytes() != (tmp_path / "other" / image).read_bytes()


def test_a_shorter_recording_leaves_no_old_frames(tmp_path):
    empty = np.zeros((4, 4), np.uint16)
    recording.write(tmp_path, [(empty, np.eye(4))] * 3)
    recording.write(tmp_path, [(empty, np.eye(4))] * 2)
    assert len(list(tmp_path.glob("frame-*.depth.png"))) == 2


@pytest.mark.parametrize(
    ("views", "distance", "named"), [(3, 0.6, "scan.views"), (36, 0.1, "scan.distance_m")]
)
def test_impossible_recordings_are_refused(views, distance, named):
    with pytest.raises(PipelineError, match=named):
        recording.views(shape("small_cup"), np.eye(4), views, distance, 1.0, 1)
