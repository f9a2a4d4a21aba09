"""Points on meshes: uniform by area, evenly spaced, the same for the same seed."""

import numpy as np
from scipy.spatial import cKDTree

from pipeline.geometry.sampling import even_points, triangle_areas_and_normals, uniform_points


def two_triangles() -> tuple[np.ndarray, np.ndarray]:
    """Right triangles of areas 0.5 (z = 0) and 2.0 (z = 1)."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [2, 0, 1], [0, 2, 1.0]])
    return vertices, np.array([[0, 1, 2], [3, 4, 5]])


def test_areas_and_normals():
    area, normal = triangle_areas_and_normals(*two_triangles())
    np.testing.assert_allclose(area, [0.5, 2.0])
    np.testing.assert_allclose(normal, [[0, 0, 1], [0, 0, 1]])


def test_uniform_points_follow_area_and_lie_on_their_triangles():
    points, triangle = uniform_points(*two_triangles(), 10_000, np.random.default_rng(1))
    assert abs(np.mean(triangle == 1) - 0.8) < 0.001
    np.testing.assert_allclose(points[:, 2], triangle)
    small = points[triangle == 0]
    assert (small[:, :2].sum(axis=1) <= 1 + 1e-12).all()
    np.testing.assert_allclose(small[:, :2].mean(axis=0), [1 / 3, 1 / 3], atol=0.02)


def test_even_points_keep_apart():
    vertices, triangles = (
        np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]),
        np.array([[0, 1, 2], [0, 2, 3]]),
    )
    points, _ = even_points(vertices, triangles, 800, np.random.default_rng(2))
    closest = cKDTree(points).query(points, k=2)[0][:, 1]
    densest = np.sqrt(2 / (np.sqrt(3) * 800))  # spacing of a hexagonal lattice
    assert len(points) == 800
    assert closest.min() > 0.55 * densest
    quarter = np.count_nonzero((points[:, :2] < 0.5).all(axis=1))
    assert abs(quarter - 200) < 12


def test_even_points_treat_both_sides_of_a_thin_wall_alone():
    side = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    vertices = np.concatenate([side, side - [0, 0, 1e-4]])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [6, 5, 4], [7, 6, 4]])
    points, triangle = even_points(vertices, triangles, 1000, np.random.default_rng(3))
    top = points[triangle < 2]
    assert abs(len(top) - 500) < 25
    assert cKDTree(top).query(top, k=2)[0][:, 1].min() > 0.5 * np.sqrt(2 / (np.sqrt(3) * 500))


def test_same_seed_same_points():
    first, second = (even_points(*two_triangles(), 500, np.random.default_rng(4))[0] for _ in range(2))
    np.testing.assert_array_equal(first, second)
