"""Point clouds that a user drops: meshed with both sides of the wall where they are, or refused with the reason."""

import numpy as np
import open3d as o3d
import pytest
import trimesh

from pipeline.errors import PipelineError
from pipeline.fuse import clouds, layouts
from pipeline.fuse.fusion import fused
from pipeline.geometry import frames
from pipeline.geometry.cavity import cavity
from pipeline.geometry.sampling import triangle_areas_and_normals, uniform_points
from pipeline.geometry.surface import Surface
from pipeline.scan.shapes import shape

OPTIONS = {"voxel_m": 0.001, "truncation_m": 0.002, "n_points": 5000, "seed": 2}
CUP = shape("espresso_cup")


def points(n: int = 9_000, noise_m: float = 0.0001) -> tuple[np.ndarray, np.ndarray]:
    """Return noisy points (M, 3) of the cup without its underside, and their true normals."""
    rng = np.random.default_rng(1)
    places, triangle = uniform_points(CUP.vertices_m, CUP.triangles, n, rng)
    normals = triangle_areas_and_normals(CUP.vertices_m, CUP.triangles)[1][triangle]
    seen = places[:, 2] > 0.0005
    return (places + normals * rng.normal(0, noise_m, (n, 1)))[seen], normals[seen]


def write(path, places: np.ndarray, normals: np.ndarray | None) -> None:
    path.parent.mkdir(exist_ok=True)
    if path.suffix == ".npz":
        np.savez(path, points=places, **({} if normals is None else {"normals": normals}))
        return
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(places))
    if normals is not None:
        cloud.normals = o3d.utility.Vector3dVector(normals)
    o3d.io.write_point_cloud(str(path), cloud)


def check(result) -> None:
    """The surface is the cup's, on both sides of the wall, closed, with its capacity."""
    mesh = trimesh.Trimesh(*result.mesh, process=False)
    assert mesh.is_watertight
    assert mesh.volume > 0
    T_world_object = frames.inverse(np.array(result.report["T_object_world"]))
    vertices = frames.apply(T_world_object, result.mesh[0])
    distance = Surface(vertices, result.mesh[1]).distance(points(noise_m=0.0)[0])
    assert distance.mean() < 0.0002
    assert np.quantile(distance, 0.99) < 0.001
    assert cavity(*result.mesh, name="cup").capacity_m3 == pytest.approx(CUP.capacity_m3, rel=0.03)


@pytest.mark.parametrize(
    ("file", "with_normals", "flip"),
    [("cup.ply", False, 1), ("cup.npz", True, -1)],
)
def test_a_cloud_becomes_the_surface(tmp_path, file, with_normals, flip):
    places, normals = points()
    write(tmp_path / "cup" / file, places, flip * normals if with_normals else None)
    result = fused(tmp_path / "cup", **OPTIONS)
    assert result.report["layout"] == "cloud"
    assert result.report["cloud"]["underside_closed"]
    check(result)


def test_a_pcd_file_is_read_like_the_others(tmp_path):
    places, normals = points(3000)
    write(tmp_path / "cup.pcd", places, normals)
    found, facing = clouds.read(tmp_path / "cup.pcd")
    order = np.lexsort(places.T[::-1])
    np.testing.assert_allclose(found, places[order], atol=1e-6)
    np.testing.assert_allclose(facing, normals[order], atol=1e-6)


def test_a_cloud_with_its_table_on_its_side(tmp_path):
    rng = np.random.default_rng(3)
    plane = np.column_stack([rng.uniform(-0.2, 0.2, (30_000, 2)), rng.normal(0, 0.0002, 30_000)])
    plane = plane[np.linalg.norm(plane[:, :2], axis=1) > 0.026]
    T = frames.transform(frames.rotation_about(np.array([0.6, 0.8, 0.0]), 1.9), np.array([0.3, 0.1, -0.2]))
    write(tmp_path / "cup/cup.npz", frames.apply(T, np.concatenate([points()[0], plane])), None)
    result = fused(tmp_path / "cup", **OPTIONS)
    assert result.report["table_cut_away"]
    up = np.array(result.report["T_object_world"]) @ T
    np.testing.assert_allclose(up[:3, 2], [0, 0, 1], atol=0.005)
    assert result.mesh[0][:, 2].max() == pytest.approx(CUP.height_m, abs=0.001)
    assert cavity(*result.mesh, name="cup").capacity_m3 == pytest.approx(CUP.capacity_m3, rel=0.03)


def refused(folder, *words: str) -> None:
    with pytest.raises(PipelineError) as caught:
        fused(folder, **OPTIONS)
    assert all(word in str(caught.value) for word in (str(folder), "expected", *words)), str(caught.value)


def test_points_of_the_outside_alone_are_refused(tmp_path):
    places, _ = points()
    inside = (np.hypot(*places[:, :2].T) < 0.0235) & (places[:, 2] > 0.003)
    write(tmp_path / "cup/cup.npz", places[~inside], None)
    refused(tmp_path / "cup", "cup.npz", "the inside as well")


def test_points_too_wide_apart_for_the_wall_are_refused(tmp_path):
    tall = shape("tall_cup")
    places, _ = uniform_points(tall.vertices_m, tall.triangles, 2300, np.random.default_rng(2))
    write(tmp_path / "cup/cup.npz", places, None)
    refused(tmp_path / "cup", "cup.npz", "scan it more closely")


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"xyz": np.zeros((5000, 3))}, ("points", "xyz")),
        ({"points": np.zeros((5000, 2))}, ("N×3", "(5000, 2)")),
        ({"points": np.zeros((5000, 3))}, ("found 1;",)),
        ({"points": np.ones((5000, 3)), "normals": np.ones((4000, 3))}, ("as many normals",)),
        ({"points": np.array([{}])}, ("cannot be read",)),
    ],
)
def test_wrong_arrays(tmp_path, arrays, words):
    (tmp_path / "cup").mkdir()
    np.savez(tmp_path / "cup/cup.npz", **arrays)
    refused(tmp_path / "cup", "cup.npz", *words)


def test_points_that_mark_nothing_are_none(tmp_path):
    places, _ = points(4000)
    write(tmp_path / "cup.pcd", np.concatenate([places + [0.3, 0.0, 0.5], np.zeros((200, 3))]), None)
    assert clouds.read(tmp_path / "cup.pcd")[0].min(axis=0)[2] > 0.4


def test_normals_that_all_point_inwards_are_turned_round(monkeypatch):
    places, normals = points()
    faced, meshing = [], clouds._poisson
    monkeypatch.setattr(
        clouds, "_poisson", lambda where, facing: faced.append(facing) or meshing(where, facing)
    )
    for sign in (1.0, -1.0):
        wrong = sign * (1.0 - 2.0 * (np.arange(20_000) % 25 == 0))[:, None]  # as on curved walls
        monkeypatch.setattr(
            clouds,
            "_outwards",  # right where the table closes it
            lambda where, axes, _, wrong=wrong: np.where(where[:, 2:] == 0, 1.0, wrong[: len(axes)]) * axes,
        )
        clouds.meshed(places, sign * normals, "cup.ply")
    np.testing.assert_array_equal(*faced)


def test_a_surface_that_balloons_beyond_the_points_is_refused():
    places, _ = points()
    vertices = CUP.vertices_m.copy()
    vertices[vertices[:, 2].argmax(), 2] += 0.007
    with pytest.raises(PipelineError, match="reaches 7 mm beyond them"):
        clouds.check_bulge(vertices, places, 0.0015, "cup.ply")


def test_a_gap_in_the_floor_is_said(tmp_path):
    places, normals = points(20_000)
    radius, height = np.hypot(*places[:, :2].T), places[:, 2]
    told = []
    for name, gap in (("whole", 0.0), ("gap", 0.018)):
        kept = (radius > gap) | (height > 0.02)
        write(tmp_path / name / "cup.ply", places[kept], normals[kept])
        told.append(fused(tmp_path / name, **OPTIONS).complaints)
    assert told[0] == ()
    assert "the capacity is a guess" in told[1][0]


def test_another_thing_in_the_cloud_is_refused(tmp_path):
    places, normals = points()
    ball = trimesh.creation.icosphere(4, 0.02)
    other = np.concatenate([places, ball.vertices + [0.15, 0.0, 0.02]])
    write(tmp_path / "cup" / "cup.ply", other, np.concatenate([normals, ball.vertex_normals]))
    with pytest.raises(PipelineError, match="apart from it"):
        fused(tmp_path / "cup", **OPTIONS)


def test_a_cloud_as_text_is_read(tmp_path):
    places, _ = points()
    write(tmp_path / "cup.xyz", places, None)
    found, normals = clouds.read(layouts.read(tmp_path).path)
    np.testing.assert_allclose(found, np.unique(places, axis=0), atol=1e-9)
    assert normals is None


def test_room_for_normals_is_no_normals(tmp_path):
    places, _ = points()
    write(tmp_path / "cup.pcd", places, np.zeros_like(places))
    found, normals = clouds.read(tmp_path / "cup.pcd")
    assert len(found) == len(places)
    assert normals is None
