"""Fused surfaces of noisy scans against the true ones: both sides of the wall, rim, capacity, normals, frames."""

import shutil

import numpy as np
import open3d as o3d
import pandas as pd
import pytest
import trimesh

from pipeline import artefacts
from pipeline.errors import PipelineError
from pipeline.fuse.fusion import fused
from pipeline.geometry import frames
from pipeline.geometry.cavity import cavity
from pipeline.scan import truth
from pipeline.scan.shapes import RIM_M, lip_distance

MEASURED = ("mug", "wide_bowl", "jug")
OPTIONS = {"voxel_m": 0.00125, "truncation_m": 0.0025, "n_points": 6000, "seed": 2}


def scene_of(vertices: np.ndarray, triangles: np.ndarray) -> o3d.t.geometry.RaycastingScene:
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(vertices.astype(np.float32), triangles.astype(np.uint32))
    return scene


@pytest.fixture(scope="module", params=MEASURED)
def case(request, fusion):
    return fusion(request.param)


def errors_by_side(case) -> dict[str, np.ndarray]:
    """Return how far true points of each side are from the fused surface, in metres."""
    points = truth.cloud(case.shape, 20_000, np.random.default_rng(1))
    places = frames.apply(case.T_object_truth, artefacts.points(points)).astype(np.float32)
    error = scene_of(*case.result.mesh).compute_distance(places).numpy()
    handle, inner = points.handle.to_numpy(), points.inner.to_numpy()
    standing = (points.z_m < 0.001).to_numpy()
    sides = {
        "inner": inner,
        "outer": ~inner & ~standing & ~handle,
        "rim": points.rim.to_numpy(),
        "handle": handle,
    }
    return {name: error[side] for name, side in sides.items()}


def test_both_sides_of_the_wall_are_where_they_should_be(case):
    error = errors_by_side(case)
    for side, quantile_m in (("inner", 0.0005), ("outer", 0.0015), ("rim", 0.001)):
        assert error[side].mean() < 0.0004
        assert np.quantile(error[side], 0.95) < quantile_m
    if case.shape.has_handle:
        assert error["handle"].mean() < 0.0006


def test_the_outside_is_within_half_a_millimetre_where_it_can_be_seen(case):
    """Below the curved wall of a bowl hardly anything is."""
    limit_m = 0.0015 if case.shape.name == "wide_bowl" else 0.0005
    assert np.quantile(errors_by_side(case)["outer"], 0.95) < limit_m


def test_the_outside_is_within_a_millimetre(request, case):
    if case.shape.name == "wide_bowl":
        reason = "1.2 mm: below a bowl's curved wall hardly anything is seen; it was 0.8 mm with a plain mean over the views"
        request.applymarker(pytest.mark.xfail(reason=reason))
    assert np.quantile(errors_by_side(case)["outer"], 0.95) < 0.001


def test_walls_keep_their_thickness(case):
    """A wall too thin or too thick, by both sides shifted together or apart, shows in signed distances."""
    points = truth.cloud(case.shape, 20_000, np.random.default_rng(2))
    places = frames.apply(case.T_object_truth, artefacts.points(points)).astype(np.float32)
    signed = scene_of(*case.result.mesh).compute_signed_distance(places).numpy()
    wall = ((points.z_m > 0.02) & points.container & ~points.rim).to_numpy()
    inner = points.inner.to_numpy()
    assert abs(signed[wall & inner].mean() + signed[wall & ~inner].mean()) < 0.0005


def test_closed_upright_and_of_the_true_size(case):
    vertices, triangles = case.result.mesh
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    assert case.result.report["watertight"]
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    assert mesh.area_faces.min() > 0
    assert vertices[:, 2].min() == 0
    assert vertices[:, 2].max() == pytest.approx(case.shape.height_m, rel=0.015)
    cup = cavity(vertices, triangles, name=case.shape.name)
    assert cup.capacity_m3 == pytest.approx(case.shape.capacity_m3, rel=0.02)


@pytest.mark.parametrize("name", [*MEASURED, "espresso_cup"])
def test_cloud_is_uniform_and_its_normals_are_true(fusion, name):
    case = fusion(name)
    cloud = pd.DataFrame(case.result.cloud)
    assert len(cloud) == OPTIONS["n_points"]
    places, normals = artefacts.points(cloud), artefacts.normals(cloud)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, rtol=1e-9)
    area = trimesh.Trimesh(case.vertices_m, case.shape.triangles, process=False).area
    assert cloud.area_m2.sum() == pytest.approx(area, rel=0.03)
    closest = scene_of(case.vertices_m, case.shape.triangles).compute_closest_points(
        places.astype(np.float32)
    )
    cosine = np.einsum("ij,ij->i", closest["primitive_normals"].numpy(), normals)[cloud.seen]
    assert np.mean(cosine > np.cos(np.deg2rad(10))) > 0.95
    assert np.mean(cosine < 0) < 0.002


def test_radius_of_the_rim(case):
    places = artefacts.points(case.result.cloud)
    rim = lip_distance(frames.apply(case.T_object_truth, case.shape.lip_edge_m), places) < RIM_M
    true = truth.cloud(case.shape, 20_000, np.random.default_rng(3))
    assert truth.radius_m(places[rim]) == pytest.approx(
        truth.radius_m(artefacts.points(true[true.rim])), rel=0.01
    )


def test_the_unseen_underside_says_so(case):
    cloud = pd.DataFrame(case.result.cloud)
    assert not cloud.seen[cloud.z_m < 1e-6].any()
    assert cloud.seen[cloud.z_m > 0.3 * case.shape.height_m].mean() > 0.97
    assert case.result.report["share_seen"] == pytest.approx(cloud.seen.mean())


def test_the_report_takes_the_world_to_the_object(case):
    """Upright, on the table, over its centre: the true axis and underside where they belong."""
    T = case.T_object_truth
    np.testing.assert_allclose(T[:3, 2], [0, 0, 1], atol=0.002)
    assert abs(T[2, 3]) < 0.0003
    assert np.linalg.norm(case.result.report["table_plane_world"][:3]) == pytest.approx(1)
    middle = (case.vertices_m.min(axis=0) + case.vertices_m.max(axis=0)) / 2
    assert np.abs(middle[:2]).max() < 0.003


def test_same_bytes_twice(scan, tmp_path):
    folder = scan("small_cup", views=16).folder
    for name in ("a", "b"):
        result = fused(folder, **OPTIONS)
        artefacts.write_mesh(tmp_path / f"{name}.ply", result.mesh)
        artefacts.write_table(tmp_path / f"{name}.parquet", result.cloud, "cloud")
        artefacts.write_json(tmp_path / f"{name}.json", result.report)
    for suffix in (".ply", ".parquet", ".json"):
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_any_world_frame_gives_the_same_object(scan, tmp_path):
    """Up comes from the table: a world that lies on its side changes the yaw at most."""
    good = scan("small_cup", views=16)
    folder = shutil.copytree(good.folder, tmp_path / "small_cup")
    R_side_world = frames.rotation_about(np.array([0.6, 0.8, 0.0]), 1.9)
    T_side_world = frames.transform(R_side_world, np.array([1.0, -2.0, 0.5]))
    for path in folder.glob("*.pose.txt"):
        np.savetxt(path, T_side_world @ np.loadtxt(path))
    result = fused(folder, **OPTIONS)
    T_object_truth = np.array(result.report["T_object_world"]) @ T_side_world @ good.T_world_object
    np.testing.assert_allclose(T_object_truth[:3, 2], [0, 0, 1], atol=0.002)
    points = truth.cloud(good.shape, 10_000, np.random.default_rng(4))
    places = frames.apply(T_object_truth, artefacts.points(points[points.inner])).astype(np.float32)
    assert scene_of(*result.mesh).compute_distance(places).numpy().mean() < 0.0004


@pytest.mark.parametrize(
    ("changed", "named"),
    [({"n_points": 100}, "fuse.points"), ({"truncation_m": 0.001}, "fuse.truncation_m")],
)
def test_options_that_cannot_work_are_refused(scan, changed, named):
    with pytest.raises(PipelineError, match=named):
        fused(scan("small_cup", views=16).folder, **(OPTIONS | changed))
