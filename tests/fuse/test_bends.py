"""Normals of points where a surface bends: hollow corners that were made round, tubes with noise."""

import numpy as np
import pytest
import trimesh

from pipeline.artefacts import normals, points
from pipeline.fuse.cloud import cloud
from pipeline.fuse.smoothing import neighbours, smoothed
from pipeline.fuse.wrapping import Field

CELL_M = 0.00125
TEN_DEG = np.cos(np.radians(10))


def box_m(places_m: np.ndarray, low_m: np.ndarray, high_m: np.ndarray) -> np.ndarray:
    """Return how deep places (..., 3) are in a box; negative outside."""
    return np.minimum(places_m - low_m, high_m - places_m).min(axis=-1)


@pytest.fixture(scope="module")
def tray() -> tuple[np.ndarray, np.ndarray]:
    """An open tray, walls of 5 mm, whose sharp edges and corners were smoothed to a radius of about 2 mm."""
    axes = [np.arange(-0.01, high, CELL_M) for high in (0.07, 0.07, 0.04)]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    solid = box_m(places, np.array([0, 0, 0]), np.array([0.06, 0.06, 0.03]))
    room = box_m(places, np.array([0.005, 0.005, 0.005]), np.array([0.055, 0.055, 0.05]))
    vertices, triangles = Field(np.minimum(solid, -room), places[0, 0, 0], CELL_M).surface()
    near = neighbours(triangles, len(vertices))
    move = np.ones_like(vertices)
    return smoothed(vertices, near.indptr, near.indices, move, 30, (0.6, -0.62)), triangles


def test_in_a_hollow_corner_a_point_faces_as_the_floor_or_as_the_wall(tray):
    table = cloud(*tray, np.ones(len(tray[0]), bool), 12_000, True, np.random.default_rng(1))
    places, facing = points(table), normals(table)
    np.testing.assert_allclose(np.linalg.norm(facing, axis=1), 1, rtol=1e-9)
    x, y, z = (places - [0.03, 0.03, 0.005]).T
    to_floor, to_wall = z, 0.025 - np.maximum(np.abs(x), np.abs(y))
    along = np.minimum(np.abs(x), np.abs(y)) < 0.02  # not where three sides meet
    corner = along & (np.maximum(to_floor, to_wall) < 0.003) & (to_floor > -0.002) & (to_wall > -0.002)
    assert np.count_nonzero(corner) > 300
    level = facing[corner, 2]
    wall = np.abs(facing[corner, :2]).max(axis=1)
    assert np.mean(np.maximum(level, wall) > TEN_DEG) > 0.98
    sure = np.abs(to_floor - to_wall)[corner] > 0.0005
    nearer_floor = (to_floor < to_wall)[corner]
    assert np.mean((level > wall) == nearer_floor, where=sure) > 0.95


def test_the_sides_of_a_hollow_corner_hold_as_much_as_if_it_were_sharp(tray):
    """Across: ∮ (x, y, 0)·n/2, and upwards: ∮ (z − level) n_z, over the room's side below a level, n into the room."""
    table = cloud(*tray, np.ones(len(tray[0]), bool), 12_000, True, np.random.default_rng(1))
    places, facing, area = points(table) - [0.03, 0.03, 0.005], normals(table), table["area_m2"]
    level_m, true_m3 = 0.018, 0.05 * 0.05 * 0.018
    room = (np.abs(places[:, :2]).max(axis=1) < 0.0265) & (places[:, 2] > -0.0015) & (places[:, 2] < level_m)
    across = -0.5 * np.sum((places * facing)[room, :2] * area[room, None])
    upwards = np.sum((level_m - places[room, 2]) * facing[room, 2] * area[room])
    assert across == pytest.approx(true_m3, rel=0.01)
    assert upwards == pytest.approx(true_m3, rel=0.01)


def test_a_fold_does_not_face_away_from_the_sheet():
    """A sheet that for two cells runs back over itself, and there faces downwards; in the creases it is upright."""
    n = 30
    steps = np.ones(n - 1)
    steps[n // 2 : n // 2 + 2] = -1
    x, y = np.meshgrid(np.cumsum([0, *steps]), np.arange(n), indexing="ij")
    z = np.cumsum([0, *(steps < 0) * 0.1])[:, None] + np.zeros_like(x)
    vertices = CELL_M * np.stack([x, y, z], axis=-1).reshape(-1, 3)
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    halves = [(corner, corner + n, corner + 1), (corner + n, corner + n + 1, corner + 1)]
    triangles = np.vstack([np.column_stack(half) for half in halves])
    table = cloud(vertices, triangles, np.ones(len(vertices), bool), 6000, True, np.random.default_rng(3))
    assert (normals(table)[:, 2] > -0.001).all()
    assert np.mean(normals(table)[:, 2] > 0.99) > 0.95


def test_the_noise_of_a_tube_is_averaged():
    """A torus as thick as a handle, its vertices displaced by 0.4 mm."""
    ring = trimesh.creation.torus(0.03, 0.004, major_sections=150, minor_sections=20)
    rng = np.random.default_rng(2)
    vertices = ring.vertices + 0.0004 * rng.standard_normal((len(ring.vertices), 1)) * ring.vertex_normals
    table = cloud(vertices, np.asarray(ring.faces), np.ones(len(vertices), bool), 6000, True, rng)
    places = points(table)
    around = places * [1, 1, 0]
    true = places - 0.03 * around / np.linalg.norm(around, axis=1, keepdims=True)
    true /= np.linalg.norm(true, axis=1, keepdims=True)
    cosine = np.einsum("ij,ij->i", normals(table), true)
    assert np.mean(cosine > TEN_DEG) > 0.95
