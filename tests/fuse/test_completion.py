"""Views from one side alone: what they do not show of the inner wall is as far from the outer one as where both are seen."""

import numpy as np
import pytest
import trimesh
from fuse import scenes
from scipy import ndimage

from pipeline.fuse import completion, tsdf, walls
from pipeline.fuse.placement import find
from pipeline.geometry.cavity import cavity
from pipeline.geometry.surface import is_closed
from pipeline.scan.shapes import shape

VOXEL_M, TRUNCATION_M = 0.00125, 0.0025


def fused(views) -> tsdf.Surface:
    """Return the surface of the views."""
    _, place = find(views, "scan", np.random.default_rng(1))
    return tsdf.fuse(views, place, VOXEL_M, TRUNCATION_M, "scan")


@pytest.mark.parametrize(("name", "towards_deg", "arc_deg"), [("mug", 0, 120), ("tall_cup", 90, 120)])
def test_what_is_not_seen_of_a_wall_is_no_thicker_than_the_rest(name, towards_deg, arc_deg):
    surface = fused(scenes.of_one_side(name, towards_deg, arc_deg))
    room = cavity(surface.vertices_m, surface.triangles, name=name)
    assert room.capacity_m3 == pytest.approx(shape(name).capacity_m3, rel=0.02)
    assert is_closed(surface.triangles)
    solid_m3, true_m3 = (
        trimesh.Trimesh(*mesh).volume
        for mesh in (
            (surface.vertices_m, surface.triangles),
            (shape(name).vertices_m, shape(name).triangles),
        )
    )
    assert solid_m3 == pytest.approx(true_m3, rel=0.05)


def test_a_handle_is_not_hollowed_where_the_wall_behind_it_was_not_seen():
    """A level of a cup, 4 voxels thick, half of it seen; in the other half the cavity is 8 too narrow, and there is a handle."""
    x, y = np.meshgrid(np.arange(120) - 59.5, np.arange(120) - 59.5, indexing="ij")
    r = np.hypot(x, y)
    handle = (x > 0) & (x < 55) & (np.abs(y) < 7) & (r > 30)
    room = r <= np.where(x < 0, 30, 22)
    value = np.where(room | ((r > 34) & ~handle), 1.0, -1.0)
    skin = ndimage.binary_dilation(value > 0, iterations=2) & ~((x >= 0) & (r < 32))
    seen = skin | (value > 0)
    beyond = completion._beyond_wall_inside(value, seen, room, VOXEL_M)
    wider = completion._opened(value, seen, beyond, room, TRUNCATION_M / VOXEL_M) > 0
    assert wider[r < 29].all()
    assert not wider[(r > 31) & (r < 33) & ~handle].any()
    assert not wider[handle & (r > 33)].any()  # its root, between the corners, is no part of the wall


def test_what_was_seen_all_round_stays_as_it_is():
    value = np.full((40, 40, 12), 1.0)
    r = np.hypot(*np.meshgrid(np.arange(40) - 19.5, np.arange(40) - 19.5, indexing="ij"))
    value[(r > 10) & (r < 14)] = -1.0
    inside = np.repeat((r <= 10)[..., None], 12, axis=2)
    everything = np.ones(value.shape, bool)
    assert completion.completed(value, everything, inside, VOXEL_M, TRUNCATION_M) is None


def test_a_pocket_in_noise_is_no_cavity():
    value, seen, pocket = -np.ones((60, 60, 8)), np.zeros((60, 60, 8), bool), np.zeros((60, 60, 8), bool)
    value[..., 7], pocket[20:30, 20:30, 5:7] = 1.0, True
    value[pocket] = 1.0
    assert pocket.sum() * VOXEL_M**3 < completion.LEAST_M3
    assert completion.completed(value, seen, pocket, VOXEL_M, TRUNCATION_M) is None


def test_a_foot_wider_than_the_wall_above_it_is_not_in_its_shadow():
    """A goblet: one half is seen, the floor is at the third level, and the foot below is wider than the cup."""
    x, y = np.meshgrid(np.arange(100) - 49.5, np.arange(100) - 49.5, indexing="ij")
    r, z = np.hypot(x, y)[..., None], np.arange(9)
    room = (r <= 20) & (z > 2)
    solid = ((r <= 24) & (z > 2) & ~room) | ((r <= np.where(z < 2, 34, 24)) & (z < 3))
    skin = ndimage.binary_dilation(~solid, iterations=2) & (x < 8)[..., None]
    value = np.where(solid, -1.0, 1.0)
    found = completion.completed(value, skin | ~solid, room, VOXEL_M, TRUNCATION_M)
    assert found is not value
    np.testing.assert_array_equal(found[..., :2] > 0, value[..., :2] > 0)


def test_the_outside_in_shadow_is_cut_where_all_of_the_inside_was_seen():
    """A cup, one half of whose outside is solid as all that is unseen, with a speck of noise in it: on the table, and higher up."""
    x, y = np.meshgrid(np.arange(100) - 49.5, np.arange(100) - 49.5, indexing="ij")
    r, z = np.hypot(x, y)[..., None], np.arange(12)
    room = (r <= 20) & (z > 2) & (z < 11)
    solid = (r <= np.where(x < 0, 24, 34)[..., None]) & ~room & (z < 11)
    seen = ~solid | (r <= 22) & (z > 0) | (ndimage.binary_dilation(~solid, iterations=2) & (x < 0)[..., None])
    seen[78:80, 50, [0, 6]] = True
    value = np.where(solid, -1.0, 1.0)
    found = completion.completed(value, seen, room, VOXEL_M, TRUNCATION_M)
    cut = found > 0
    assert cut[(r > 27) & ~(seen & solid) & (z < 11)].all()
    np.testing.assert_array_equal(
        cut[np.broadcast_to(r < 23, cut.shape)], ~solid[np.broadcast_to(r < 23, cut.shape)]
    )


def test_a_low_bowl_from_one_side_is_cut_to_its_wall():
    """All but 2 % of its inside is seen, and 30 % of its outside is not: it was 39 % too much."""
    surface = fused(scenes.of_one_side("wide_bowl", 0, 180, n=32))
    truth = shape("wide_bowl")
    solid_m3, true_m3 = (
        trimesh.Trimesh(mesh.vertices_m, mesh.triangles, process=False).volume for mesh in (surface, truth)
    )
    assert solid_m3 == pytest.approx(true_m3, rel=0.12)
    room = cavity(surface.vertices_m, surface.triangles, name="wide_bowl")
    assert room.capacity_m3 == pytest.approx(truth.capacity_m3, rel=0.01)


def test_an_outside_that_was_not_seen_is_as_far_from_the_inside_as_one_that_was():
    """A tube with a wall of 3.5 mm, in whose unseen half it is 0.6 mm thinner; a bump of 5 mm there is something else."""
    heights_mm = np.arange(0.0, 60.0, 1.25)
    profile = [(40, z) for z in heights_mm] + [(36.5, z) for z in heights_mm[::-1]] + [(40, 0)]
    tube = trimesh.creation.revolve(np.array(profile) / 1000, sections=200)
    vertices, radius_m = np.array(tube.vertices), np.hypot(*tube.vertices[:, :2].T)
    side = (vertices[:, 2] > 0) & (vertices[:, 2] < heights_mm[-1] / 1000)
    inner, outer = side & (radius_m < 0.037), side & (radius_m > 0.039)
    seen = ~outer | (vertices[:, 0] < 0)
    bump = outer & ~seen & (np.hypot(vertices[:, 1], vertices[:, 2] - 0.03) < 0.012)
    lacking_m = np.where(outer & ~seen, 0.0006, 0.0)
    lacking_m[bump] = -0.005
    vertices[:, :2] *= (1 - lacking_m / radius_m)[:, None]
    found = walls.evened(vertices, tube.faces, inner, outer, seen)
    np.testing.assert_array_equal(found[seen], vertices[seen])
    far = outer & ~seen & (vertices[:, 0] > 0.01) & (np.abs(vertices[:, 2] - 0.03) < 0.02)
    far &= np.hypot(vertices[:, 1], vertices[:, 2] - 0.03) > 0.025
    assert np.abs(np.hypot(*found[far, :2].T) - 0.04).max() < 0.0002
    assert np.hypot(*found[bump, :2].T).max() > 0.0445
