"""The demonstration objects against what is known about them without their code."""

import numpy as np
import pytest
import trimesh

from pipeline.errors import PipelineError
from pipeline.geometry.sampling import uniform_points
from pipeline.scan.shapes import NAMES, shape, volume_below
from pipeline.scan.truth import cloud, radius_m


@pytest.fixture(scope="module", params=NAMES)
def body(request):
    return shape(request.param)


def mesh_of(body) -> trimesh.Trimesh:
    return trimesh.Trimesh(body.vertices_m, body.triangles, process=False)


def test_closed_oriented_and_standing_on_the_table(body):
    mesh = mesh_of(body)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    assert mesh.body_count == 1
    assert abs(mesh.bounds[0, 2]) < 1e-12
    assert body.height_m == pytest.approx(body.lip_edge_m[:, 2].max(), abs=1e-6)


def test_walls_are_as_thick_as_stated(body):
    """Rays from the inner side into the wall leave it after one wall, handle and floor's corner apart."""
    mesh = mesh_of(body)
    rng = np.random.default_rng(1)
    points, triangle = uniform_points(body.vertices_m, body.triangles, 3000, rng)
    chosen = body.inner[triangle] & (points[:, 2] < body.height_m - 0.006)
    points, normals = points[chosen], mesh.face_normals[triangle[chosen]]
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(body.vertices_m.astype(np.float32), body.triangles.astype(np.uint32))
    rays = np.hstack([points - 1e-5 * normals, -normals]).astype(np.float32)
    thickness = scene.cast_rays(rays)["t_hit"].numpy() + 1e-5
    assert np.quantile(thickness, [0.02, 0.5]) == pytest.approx(body.wall_m, rel=0.03)
    assert 0.0025 <= body.wall_m <= 0.005


def test_inner_side_faces_the_cavity(body):
    """From the inner side upwards or across there is air; the handle never enters the cavity."""
    np.testing.assert_allclose(
        volume_below(body.vertices_m, body.triangles[body.inner], body.lip_edge_m[:, 2].min()),
        body.capacity_m3,
        rtol=1e-6,
    )
    assert not (body.inner & body.handle).any()
    assert body.has_handle == (body.name in ("mug", "espresso_cup", "jug"))


def test_capacity_of_a_straight_cup():
    """Its cavity is a cylinder with a filleted corner, closed by the rounded lip."""
    cup = shape("mug")
    cylinder = np.pi * 0.0365**2 * (0.095 - 0.0035)
    assert 0.97 * cylinder < cup.capacity_m3 < 1.005 * cylinder
    np.testing.assert_allclose(np.linalg.norm(cup.lip_edge_m[:, :2], axis=1), 0.03825, rtol=1e-6)
    assert radius_m(cup.lip_edge_m) == pytest.approx(0.03825, rel=1e-4)


def test_volume_below_cuts_triangles_exactly():
    cone = trimesh.creation.cone(radius=0.05, height=0.1, sections=360)
    cone.apply_transform(np.diag([1.0, -1.0, -1.0, 1.0]))  # apex down, at z = -0.1
    sides = cone.faces[np.abs(cone.face_normals[:, 2]) < 0.99][:, ::-1]
    for level in (-0.03, -0.0517, -0.08):
        polygon = 360 / 2 * np.sin(2 * np.pi / 360) * (0.05 * (level + 0.1) / 0.1) ** 2
        assert volume_below(cone.vertices, sides, level) == pytest.approx(
            polygon * (level + 0.1) / 3, rel=1e-9
        )


def test_parts_of_the_true_cloud(body):
    points = cloud(body, 4000, np.random.default_rng(2))
    assert not (points.rim & ~points.container).any()
    assert not (points.handle & points.container).any()
    assert (points.handle | points.container).all()
    rim = points[points.rim]
    assert (rim.z_m > body.lip_edge_m[:, 2].min() - 0.0041).all()
    assert 0.3 < rim.inner.mean() < 0.7
    if body.has_handle:
        assert (points.x_m[points.handle] < 0).all()


def test_the_spout_dips_and_bulges():
    lip = shape("jug").lip_edge_m
    front = lip[np.argmax(lip[:, 0])]
    assert lip[:, 2].max() - front[2] == pytest.approx(0.003, abs=3e-4)
    assert front[0] - np.abs(lip[:, 1]).max() > 0.008


def test_unknown_name_is_refused():
    with pytest.raises(PipelineError, match=r"mugg: expected a demonstration object, one of mug"):
        shape("mugg")
