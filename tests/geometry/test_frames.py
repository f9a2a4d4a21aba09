import numpy as np

from pipeline.geometry import frames


def test_inverse_undoes_a_pose():
    T = frames.transform(frames.rotation_about(np.array([0.6, 0.0, 0.8]), 1.1), np.array([0.1, -0.2, 0.3]))
    points = np.random.default_rng(0).normal(size=(5, 3))
    np.testing.assert_allclose(frames.apply(frames.inverse(T), frames.apply(T, points)), points, atol=1e-12)


def test_tilting_keeps_the_pivot_and_turns_by_the_right_hand_rule():
    pivot = np.array([0.1, 0.0, 0.2])
    T = frames.tilted(np.eye(4), pivot, np.array([0.0, 1.0, 0.0]), np.pi / 2)
    np.testing.assert_allclose(frames.apply(T, pivot), pivot, atol=1e-12)
    np.testing.assert_allclose(frames.rotate(T, np.array([0.0, 0.0, 1.0])), [1.0, 0.0, 0.0], atol=1e-12)


def test_camera_looks_at_its_target_with_y_down():
    T = frames.look_at(np.array([0.5, 0.0, 0.5]), np.zeros(3))
    target_camera = frames.apply(frames.inverse(T), np.zeros(3))
    np.testing.assert_allclose(target_camera, [0.0, 0.0, np.sqrt(0.5)], atol=1e-12)
    assert frames.rotate(T, np.array([0.0, 1.0, 0.0]))[2] < 0.0
    assert np.linalg.det(T[:3, :3]) > 0.0
