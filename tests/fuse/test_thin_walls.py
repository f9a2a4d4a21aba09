"""Walls of a millimetre or two, floors near the table, floors that nobody saw, and how much of what was seen."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from fuse import scenes

from pipeline.fuse import coverage, tsdf, walls
from pipeline.fuse.measuring import signed_distances
from pipeline.fuse.placement import find
from pipeline.fuse.raw import Views
from pipeline.geometry import frames
from pipeline.geometry.cavity import cavity
from pipeline.geometry.surface import Surface

VOXEL_M, TRUNCATION_M = 0.00125, 0.0025


def thin(foot_mm: float, lip_mm: float, height_mm: float, wall_mm: float, floor_mm: float) -> SimpleNamespace:
    """A cone-shaped cup or bowl with a round lip; a floor of 0: a ring without one."""
    r = wall_mm / 2
    z = np.linspace(0, height_mm - r, 13)
    side = foot_mm + (lip_mm - foot_mm) * z / z[-1]
    angle = np.linspace(0, np.pi, 9)[1:-1]
    lip = np.column_stack([lip_mm - r + r * np.cos(angle), z[-1] + r * np.sin(angle)])
    inner = np.column_stack([np.interp(np.maximum(z, floor_mm), z, side) - wall_mm, np.maximum(z, floor_mm)])
    rows = [np.column_stack([side, z]), lip, inner[::-1]]
    rows = [[[0, 0]], *rows, [[0, floor_mm]]] if floor_mm else [*rows, [[side[0], 0]]]
    mesh = trimesh.creation.revolve(np.concatenate(rows) * 1e-3, sections=128)
    mesh.fix_normals()
    return SimpleNamespace(
        name="thin",
        vertices_m=np.asarray(mesh.vertices),
        triangles=np.asarray(mesh.faces),
        height_m=height_mm * 1e-3,
    )


def fused(views: Views, truncation_m: float = TRUNCATION_M) -> tuple[tsdf.Surface, np.ndarray]:
    _, placement = find(views, "thin", np.random.default_rng(2))
    return tsdf.fuse(views, placement, VOXEL_M, truncation_m, "thin"), placement.T_object_world


def wall_mm(surface: Surface, middle: np.ndarray) -> np.ndarray:
    azimuth = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    out = np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth], axis=-1)
    return 1e3 * (0.3 - surface.hit(middle + 0.3 * out, -out) - surface.hit(np.tile(middle, (90, 1)), out))


@pytest.fixture(scope="module")
def bowl():
    body = thin(30, 75, 55, 1.5, 2.5)
    views, T_world_object = scenes.views(body)
    surface, T_object_world = fused(views)
    T = T_object_world @ T_world_object
    return SimpleNamespace(body=body, views=views, surface=surface, T_world_object=T_world_object, T=T)


def test_a_thin_bowl_keeps_capacity_radius_height_and_wall(bowl):
    cup = cavity(bowl.surface.vertices_m, bowl.surface.triangles, name="bowl")
    true = cavity(bowl.body.vertices_m, bowl.body.triangles, name="bowl")
    assert cup.capacity_m3 == pytest.approx(true.capacity_m3, rel=0.03)
    radius, true_radius = (np.hypot(*(c.rim_m - c.opening_m)[:, :2].T).mean() for c in (cup, true))
    assert radius == pytest.approx(true_radius, rel=0.01)
    assert bowl.surface.vertices_m[:, 2].max() == pytest.approx(bowl.body.height_m, rel=0.02)
    middle = bowl.T[:3, 3] + [0, 0, 0.03]
    found = wall_mm(Surface(bowl.surface.vertices_m, bowl.surface.triangles), middle)
    shape = Surface(frames.apply(bowl.T, bowl.body.vertices_m), bowl.body.triangles)
    assert abs(np.mean(found - wall_mm(shape, middle))) < 0.3


def test_the_inside_of_a_thin_bowl_is_seen_and_named(bowl):
    shares = coverage.shares_seen(bowl.surface)
    assert shares["floor"] > 0.98
    assert shares["inner_wall"] > 0.98
    assert coverage.complaints(shares) == []
    area = {name: part.sum() for name, part in coverage.parts(bowl.surface).items()}
    assert area["outer_wall"] > area["rim"]
    assert area["inner_wall"] + area["floor"] > area["rim"]


def test_a_truncation_of_ten_walls_changes_little(bowl):
    far, _ = fused(bowl.views, 0.015)
    cup, near = (cavity(s.vertices_m, s.triangles, name="bowl") for s in (far, bowl.surface))
    assert cup.capacity_m3 == pytest.approx(near.capacity_m3, rel=0.03)


def test_a_wall_too_thin_for_the_camera_is_closed_and_named():
    cup = thin(38, 40, 60, 0.8, 2.5)
    surface, _ = fused(scenes.views(cup)[0])
    found, true = (cavity(b.vertices_m, b.triangles, name="cup").capacity_m3 for b in (surface, cup))
    assert found == pytest.approx(true, rel=0.03)
    assert surface.thickened_share > coverage.MUCH_THICKENED
    told = coverage.complaints({}, surface.thickened_share)
    assert "too thin for this camera" in told[0]


def test_crossing_sides_are_parted():
    """Two sheets of triangles, the outer one 1 mm on the wrong side of the inner one."""
    grid = np.stack(np.meshgrid(np.arange(5.0), np.arange(5.0), indexing="ij"), axis=-1).reshape(-1, 2) * 1e-3
    quads = np.array([(i, i + 5, i + 6, i + 1) for i in range(19) if i % 5 < 4])
    up = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])
    places = np.concatenate([np.column_stack([grid, np.full(25, z)]) for z in (0.0, -0.001)])
    triangles = np.concatenate([up[:, ::-1], up + 25])
    outer = np.arange(50) >= 25
    vertices, share = walls.parted(places, triangles, ~outer, outer)
    assert share == 1.0
    np.testing.assert_allclose(vertices[outer, 2], walls.LEAST_WALL_M)
    np.testing.assert_array_equal(vertices[~outer], places[~outer])


def without_floor(views: Views, T_world_object: np.ndarray, radius_m: float) -> Views:
    """The same views, but nothing comes back from a disc in the middle of the floor."""
    depths = []
    K = views.intrinsics[0]
    for depth, T_world_camera in zip(views.depths_m, views.T_world_cameras, strict=True):
        v, u = np.mgrid[: depth.shape[0], : depth.shape[1]]
        rays = np.stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones(depth.shape)], axis=-1)
        T_object_camera = frames.inverse(T_world_object) @ T_world_camera
        places = frames.apply(T_object_camera, rays * depth[..., None])
        dark = (np.hypot(places[..., 0], places[..., 1]) < radius_m) & (places[..., 2] < 0.01)
        depths.append(np.where(dark, np.float32(0), depth))
    return replace(views, depths_m=depths)


def test_a_floor_that_nobody_saw_is_no_drain(bowl):
    """Black in the middle: what is unseen stays closed, and the share seen says so."""
    surface, _ = fused(without_floor(bowl.views, bowl.T_world_object, 0.012))
    cup = cavity(surface.vertices_m, surface.triangles, name="bowl")
    true = cavity(bowl.body.vertices_m, bowl.body.triangles, name="bowl")
    assert cup.capacity_m3 == pytest.approx(true.capacity_m3, rel=0.05)
    shares = coverage.shares_seen(surface)
    assert shares["floor"] < 0.9 < shares["inner_wall"]


def test_the_table_closes_a_ring_without_a_floor():
    ring = thin(35, 38, 50, 2.0, 0.0)
    surface, _ = fused(scenes.views(ring, 24)[0])
    assert surface.table_closed_m2 == pytest.approx(np.pi * 0.033**2, rel=0.15)
    cup = cavity(surface.vertices_m, surface.triangles, name="ring")
    assert cup.capacity_m3 == pytest.approx(
        np.pi / 3 * 0.05 * (0.033**2 + 0.033 * 0.036 + 0.036**2), rel=0.04
    )
    (told,) = coverage.complaints({}, table_closed_m2=surface.table_closed_m2)
    assert "as low as the table" in told


@pytest.mark.parametrize("slit_mm", [2, 10])
def test_a_foot_that_is_torn_at_the_table_is_closed_and_a_wall_that_is_open_further_up_is_told(slit_mm):
    """A camera by time of flight sees a cup's inside too deep, its floor in the table: it held nothing, and nothing was said."""
    tube = thin(35, 38, 50, 2.0, 0.0)
    tube.vertices_m = tube.vertices_m + [0, 0, slit_mm / 1e3]
    surface, _ = fused(scenes.views(tube, 16)[0])
    if slit_mm == 2:
        assert surface.open_below_m is None
        assert surface.table_closed_m2 == pytest.approx(np.pi * 0.033**2, rel=0.15)
        assert cavity(surface.vertices_m, surface.triangles, name="tube").capacity_m3 > 150e-6
        return
    assert surface.open_below_m == pytest.approx(slit_mm / 1e3, abs=0.003)
    (told,) = coverage.complaints({}, open_below_m=surface.open_below_m)
    assert "open to the side below 10 mm" in told


def test_a_colander_is_told_to_have_holes():
    """It held two litres, and nothing was said."""
    bowl = thin(60, 80, 60, 2.5, 2.5)
    places = [(x, y, 0) for x in (-0.03, 0, 0.03) for y in (-0.03, 0, 0.03)]
    holes = [trimesh.creation.cylinder(0.004, 0.02).apply_translation(place) for place in places]
    mesh = trimesh.boolean.difference([trimesh.Trimesh(bowl.vertices_m, bowl.triangles), *holes])
    colander = SimpleNamespace(
        name="colander", vertices_m=mesh.vertices, triangles=mesh.faces, height_m=bowl.height_m
    )
    surface, _ = fused(scenes.views(colander, 24)[0])
    (told,) = coverage.complaints({}, table_closed_m2=surface.table_closed_m2)
    assert "colander" in told


def test_a_tall_tube_in_the_middle_of_a_tin_keeps_its_top():
    """Seen from above it is apart from the tin, whose height was its: what was higher was cut off."""
    tin = [
        (15, 0),
        (75, 0),
        (105, 75),
        (105, 78),
        (102, 78),
        (73, 3),
        (25, 3),
        (18.5, 105),
        (15, 105),
        (15, 0),
    ]
    mesh = trimesh.creation.revolve(1e-3 * np.array(tin), sections=96)
    body = SimpleNamespace(name="tin", vertices_m=mesh.vertices, triangles=mesh.faces, height_m=0.105)
    surface, _ = fused(scenes.views(body, 24)[0])
    assert surface.vertices_m[:, 2].max() == pytest.approx(0.105, abs=0.0015)


def test_what_was_not_seen_at_all_is_named():
    told = coverage.complaints({"floor": None, "inner_wall": 0.3, "rim": 1.0, "outer_wall": 0.9})
    assert len(told) == 2
    assert "floor was not seen at all" in told[0]
    assert "inner wall was poorly seen, 30%" in told[1]
    assert "look from more sides" in told[1]


def test_an_object_without_an_inside_is_named_in_one_sentence():
    """A closed box: each of its parts that is not there was told to be dark or shiny."""
    box = SimpleNamespace(name="box", height_m=0.08, **block((0.08, 0.06, 0.08)))
    surface, _ = fused(scenes.views(box, 12)[0])
    told = coverage.complaints(coverage.shares_seen(surface))
    assert len(told) == 1
    assert "no inside that is open upwards" in told[0]
    assert "lid" in told[0]


def test_a_ragged_patch_of_the_inner_wall_is_no_rim():
    """A leaning vase's unseen wall had edges between inside and outside halfway up: a rim that was poorly seen."""
    up = np.linspace(0.003, 0.1, 98)
    profile = [(0, 0), (0.04, 0), (0.04, 0.1), *((0.037, z) for z in up[::-1]), (0, 0.003)]
    cup = trimesh.creation.revolve(np.array(profile), sections=96)
    x, y, z = cup.vertices.T
    inner = (np.hypot(x, y) < 0.038) & (z > 0.002)
    inner &= ~((x > 0.02) & (z > 0.04) & (z < 0.06))
    surface = tsdf.Surface(np.array(cup.vertices), np.array(cup.faces), np.ones(len(inner), bool), inner)
    rim = coverage.parts(surface)["rim"]
    assert z[rim].min() > 0.09
    assert rim.any()


def test_a_step_all_round_is_a_step_unless_no_inside_was_found():
    surface = on_a_disc(0.03, 0.004)
    assert coverage.step_m(surface) == pytest.approx(0.004)
    assert coverage.step_m(replace(surface, inner=np.zeros(len(surface.inner), bool))) is None


def test_a_block_under_a_cup_is_a_step_and_a_goblets_foot_is_none():
    assert coverage.step_m(on_a_disc(0.03, 0.045)) == pytest.approx(0.045)
    assert coverage.step_m(on_a_disc(0.006, 0.004)) is None


def on_a_disc(foot_m: float, disc_m: float) -> tsdf.Surface:
    """Return a cup whose foot has a radius of `foot_m`, on a disc of a radius of 44 mm, `disc_m` thick, as one surface."""
    rim = disc_m + 0.056
    outside = [(0, 0), (0.044, 0), *((r / 1000, disc_m) for r in range(44, 29, -1)), (foot_m, disc_m)]
    outside += [*((foot_m, disc_m + h / 1000) for h in range(1, 20)), (0.03, disc_m + 0.021), (0.03, rim)]
    profile = [*outside, (0.027, rim), (0.027, disc_m + 0.025), (0, disc_m + 0.025)]
    cup = trimesh.creation.revolve(np.array(profile), sections=96)
    inner = (np.hypot(*cup.vertices[:, :2].T) < 0.028) & (cup.vertices[:, 2] > disc_m + 0.024)
    return tsdf.Surface(np.array(cup.vertices), np.array(cup.faces), np.ones(len(inner), bool), inner)


def test_a_depth_that_no_view_saw_is_a_guess():
    told = coverage.complaints({"floor": 0.1, "inner_wall": 0.9, "rim": 1.0, "outer_wall": 0.9})
    assert len(told) == 2
    assert "capacity is a guess" in told[1]


def test_what_stands_on_nothing_that_was_seen_is_said():
    """A tray on a stand of glass: all round the table is seen through below it."""
    tray = SimpleNamespace(name="tray", height_m=0.09, **block((0.1, 0.1, 0.03)))
    tray.vertices_m = tray.vertices_m + [0.0, 0.0, 0.06]
    surface, _ = fused(scenes.views(tray, 24)[0])
    lowest_m = surface.vertices_m[:, 2].min()
    assert 0.02 < lowest_m < 0.061  # what no view saw below it is solid
    assert f"between the table and {1e3 * lowest_m:.0f} mm" in coverage.complaints({}, 0.0, lowest_m)[0]
    assert coverage.complaints({}, 0.0, 0.001) == []


def block(size_m: tuple[float, float, float]) -> dict[str, np.ndarray]:
    mesh = trimesh.creation.box(size_m)
    return {"vertices_m": mesh.vertices + [0, 0, size_m[2] / 2], "triangles": mesh.faces}


def test_a_saucer_lacks_no_wall():
    assert coverage.complaints({"floor": 0.9, "inner_wall": None, "rim": 1.0, "outer_wall": 1.0}) == []
    told = coverage.complaints({"floor": None, "inner_wall": None, "rim": 1.0, "outer_wall": 1.0})
    assert told == [coverage.NO_INSIDE]


def test_two_sides_of_a_sheet_are_told_apart():
    """Two views of a sheet 1 mm thick, from either side: free on both sides, solid only between them."""
    plane = np.array([[1, 0, 0, 0.001, 1], [-1, 0, 0, 0, 1]], np.float32)
    view = np.array([[0, 1, 1], [1, 1, 1]])
    projection = np.zeros((2, 3, 4))
    projection[:, 2, 3] = 1.0
    near = np.ones((9, 1, 1), bool)
    lowest = np.array([-3, 0, 0])
    value, weight = signed_distances(
        lowest, 0.0005, np.argwhere(near[:, :, 0]), near[0, 0], near, plane, view, projection, 0.01
    )
    x_m = (lowest[0] + np.arange(9)) * 0.0005
    expected = np.maximum(x_m - 0.001, -x_m)
    np.testing.assert_allclose(value[:, 0, 0] * 0.01, expected, atol=1e-7)
    assert (weight == 2).all()
