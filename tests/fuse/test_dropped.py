"""Meshes that a user drops: oriented, repaired, upright, in metres."""

import re

import numpy as np
import pandas as pd
import pytest
import trimesh

from pipeline import artefacts
from pipeline.errors import PipelineError
from pipeline.fuse.fusion import fused
from pipeline.geometry import frames
from pipeline.geometry.cavity import cavity
from pipeline.scan.shapes import shape

OPTIONS = {"voxel_m": 0.001, "truncation_m": 0.002, "n_points": 5000, "seed": 2}


def drop(folder, vertices: np.ndarray, triangles: np.ndarray, file: str = "cup.ply"):
    folder.mkdir(exist_ok=True)
    trimesh.Trimesh(vertices, triangles, process=False).export(folder / file)
    return fused(folder, **OPTIONS)


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".stl", ".glb", ".off"])
def test_every_format(tmp_path, suffix):
    cup = shape("small_cup")
    result = drop(tmp_path / "cup", cup.vertices_m + [1, 2, 3], cup.triangles, f"cup{suffix}")
    vertices, triangles = result.mesh
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    assert result.report["layout"] == "mesh"
    assert mesh.is_watertight
    np.testing.assert_allclose(mesh.bounds, [[-0.0275, -0.0275, 0], [0.0275, 0.0275, 0.06]], atol=2e-6)
    assert mesh.volume == pytest.approx(trimesh.Trimesh(cup.vertices_m, cup.triangles).volume, rel=1e-4)


def test_the_files_beside_a_gltf_belong_to_it(tmp_path):
    cup = shape("small_cup")
    scene = trimesh.Scene(trimesh.Trimesh(cup.vertices_m, cup.triangles))
    for name, data in trimesh.exchange.gltf.export_gltf(scene).items():
        (tmp_path / name).write_bytes(data)
    vertices, _ = fused(tmp_path, **OPTIONS).mesh
    np.testing.assert_allclose(np.ptp(vertices, axis=0), [0.055, 0.055, 0.06], atol=1e-5)
    (tmp_path / "gltf_buffer_0.bin").unlink()
    with pytest.raises(PipelineError, match=r"cannot be read: gltf_buffer_0\.bin; put that file beside it"):
        fused(tmp_path, **OPTIONS)


RINGS = [(i, (i + 1) % 4) for i in range(4)]
SQUARE_CUP = [
    (3, 2, 1, 0),
    (12, 13, 14, 15),
    *((k + i, k + j, k + 4 + j, k + 4 + i) for k in (0, 4, 8) for i, j in RINGS),
]


def polygons(path, faces: list[tuple[int, ...]]) -> None:
    """Write a square cup as a binary file of polygons, whose texture is elsewhere."""
    rings = [(0.04, 0.0), (0.04, 0.09), (0.037, 0.09), (0.037, 0.004)]
    corners = [(r * x, r * y, z) for r, z in rings for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    header = f"ply\nformat binary_little_endian 1.0\ncomment TextureFile cup.png\nelement vertex 16\n{axes}"
    header += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    indices = b"".join(np.uint8(len(face)).tobytes() + np.array(face, "<i4").tobytes() for face in faces)
    path.write_bytes(header.encode() + np.array(corners, "<f4").tobytes() + indices)


def test_faces_of_four_corners_are_read_and_a_missing_texture_is_no_traceback(tmp_path, caplog):
    polygons(tmp_path / "cup.ply", SQUARE_CUP)
    vertices, triangles = fused(tmp_path, **OPTIONS).mesh
    capacity_m3 = cavity(vertices, triangles, name="cup").capacity_m3
    assert capacity_m3 == pytest.approx(0.074**2 * 0.086, rel=0.01)
    assert caplog.records == []


def test_faces_of_three_and_of_four_corners_are_asked_for_as_triangles(tmp_path):
    polygons(tmp_path / "cup.ply", [*SQUARE_CUP[1:], (3, 2, 1), (3, 1, 0)])
    with pytest.raises(
        PipelineError, match=r"cup\.ply: .* cannot be read: .*; export it again, with triangles alone"
    ):
        fused(tmp_path, **OPTIONS)


@pytest.mark.parametrize(
    ("up", "T_file_object"),
    [
        ("y", [[1, 0, 0], [0, 0, 1], [0, -1, 0]]),
        ("x", [[0, 0, 1], [1, 0, 0], [0, 1, 0]]),
        ("-z", np.diag([1, -1, -1])),
    ],
)
def test_the_named_axis_points_up(tmp_path, up, T_file_object):
    mug = shape("mug")
    (tmp_path / "mug").mkdir()
    (tmp_path / "mug" / "scan.yaml").write_text(f"up: {up}\n")
    T_file_object = frames.transform(np.array(T_file_object, float), np.array([0.3, 0.2, 0.1]))
    result = drop(tmp_path / "mug", frames.apply(T_file_object, mug.vertices_m), mug.triangles)
    T = np.array(result.report["T_object_world"]) @ T_file_object
    np.testing.assert_allclose(T[:3, 2], [0, 0, 1], atol=1e-12)
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1)
    np.testing.assert_allclose(np.sort(result.mesh[0][:, 2]), np.sort(mug.vertices_m[:, 2]), atol=1e-6)


def test_flipped_and_doubled_faces_are_mended(tmp_path):
    cup = shape("small_cup")
    rng = np.random.default_rng(1)
    triangles = np.where(rng.random((len(cup.triangles), 1)) < 0.3, cup.triangles[:, ::-1], cup.triangles)
    empty = np.repeat(triangles[:5, :1], 3, axis=1)
    result = drop(tmp_path / "cup", cup.vertices_m, np.concatenate([triangles, triangles[:100], empty]))
    mesh = trimesh.Trimesh(*result.mesh, process=False)
    assert len(mesh.faces) == len(cup.triangles)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    cloud = pd.DataFrame(result.cloud)
    inside = np.hypot(cloud.x_m, cloud.y_m) < 0.02
    floor = cloud[inside & (cloud.z_m < 0.02)]
    upper = floor.z_m > 0.001
    assert (floor.nz[upper] > 0).all()
    assert (floor.nz[~upper] < 0).all()


def turned(*profile_mm: tuple[float, float]) -> trimesh.Trimesh:
    return trimesh.creation.revolve(np.array(profile_mm) / 1e3, sections=64)


def thin_cup(radius_mm: float, height_mm: float, wall_mm: float) -> trimesh.Trimesh:
    """A cup, cut in its wall at half its height."""
    half, inner = height_mm / 2, radius_mm - wall_mm
    outside = [(0, 0), (radius_mm, 0), (radius_mm, half), (radius_mm, height_mm)]
    return turned(*outside, (inner, height_mm), (inner, half), (inner, wall_mm), (0, wall_mm))


def dropped(folder, *pieces: trimesh.Trimesh):
    whole = trimesh.util.concatenate(pieces)
    return drop(folder, whole.vertices, whole.faces)


def capacity_ml(result) -> float:
    return 1e6 * cavity(*result.mesh, name="cup").capacity_m3


def on_ground(size_m: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """A straight cup, whose wall's triangles reach from the ground to the rim, on the two triangles of a ground."""
    cup = trimesh.creation.revolve(
        [[0, 0], [0.04, 0], [0.04, 0.09], [0.037, 0.09], [0.037, 0.004], [0, 0.004]], sections=64
    )
    ground = trimesh.Trimesh(
        size_m / 2 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), [[0, 1, 2], [0, 2, 3]]
    )
    both = trimesh.util.concatenate([cup, ground])
    return np.asarray(both.vertices), np.asarray(both.faces)


def test_a_ground_in_the_mesh_is_named(tmp_path):
    with pytest.raises(PipelineError, match="on_table: true"):
        drop(tmp_path / "cup", *on_ground())


@pytest.mark.parametrize("size_m", [0.5, 1.5])
def test_a_ground_in_the_mesh_is_cut_away_and_long_walls_with_it_are_not(tmp_path, size_m):
    (tmp_path / "cup").mkdir()
    (tmp_path / "cup" / "scan.yaml").write_text("on_table: true\n")
    vertices, triangles = drop(tmp_path / "cup", *on_ground(size_m)).mesh
    np.testing.assert_allclose(np.ptp(vertices, axis=0), [0.08, 0.08, 0.09], atol=2e-4)
    capacity_m3 = cavity(vertices, triangles, name="cup").capacity_m3
    assert capacity_m3 == pytest.approx(np.pi * 0.037**2 * 0.086, rel=0.01)


@pytest.mark.parametrize("slab_m", [0.002, 0.01])
@pytest.mark.parametrize("merged", [False, True])
def test_a_floor_thinner_than_the_table_is_rough_stays_and_a_slab_is_its_top(tmp_path, slab_m, merged):
    cup, slab = thin_cup(40, 90, 1), trimesh.creation.box((0.5, 0.5, slab_m))
    slab.apply_translation([0, 0, 1e-4 - slab_m / 2])
    (tmp_path / "cup").mkdir()
    (tmp_path / "cup" / "scan.yaml").write_text("on_table: true\n")
    both = [trimesh.boolean.union([cup, slab], engine="manifold")] if merged else [cup, slab]
    result = dropped(tmp_path / "cup", *both)
    assert np.ptp(result.mesh[0][:, 2]) == pytest.approx(0.09, abs=2e-4)
    assert capacity_ml(result) == pytest.approx(np.pi * 39**2 * 89 / 1e3, rel=0.01)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_thick_slab_leaves_no_brim(tmp_path, seed):
    """Its mean height is nearly that of the points: its top was found by chance."""
    slab = trimesh.creation.box((0.4, 0.4, 0.02)).apply_translation([0, 0, -0.01])
    slab = trimesh.Trimesh(*trimesh.remesh.subdivide_to_size(slab.vertices, slab.faces, 0.008))
    (tmp_path / "cup").mkdir()
    (tmp_path / "cup" / "scan.yaml").write_text("on_table: true\n")
    trimesh.util.concatenate([thin_cup(40, 90, 3), slab]).export(tmp_path / "cup" / "cup.ply")
    vertices, _ = fused(tmp_path / "cup", **OPTIONS | {"seed": seed}).mesh
    np.testing.assert_allclose(np.ptp(vertices, axis=0), [0.08, 0.08, 0.09], atol=3e-4)


def test_same_mesh_same_cloud(tmp_path):
    cup = shape("small_cup")
    first, second = (drop(tmp_path / name, cup.vertices_m, cup.triangles).cloud for name in ("a", "b"))
    np.testing.assert_array_equal(artefacts.points(first), artefacts.points(second))


def ball(radius_m: float, *centre_m: float) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(1, radius_m).apply_translation(centre_m)


def with_pieces(folder, *pieces: trimesh.Trimesh):
    cup = shape("small_cup")
    whole = trimesh.util.concatenate([trimesh.Trimesh(cup.vertices_m, cup.triangles), *pieces])
    return drop(folder, whole.vertices, whole.faces)


def test_crumbs_of_a_scan_in_the_air_go(tmp_path):
    result = with_pieces(
        tmp_path, ball(0.002, 0.05, 0, 0.12), ball(0.001, 0, 0, 0.05), ball(0.003, 0.1, 0, -0.02)
    )
    assert result.report["mended"]["crumbs_dropped"] == 3
    np.testing.assert_allclose(np.ptp(result.mesh[0], axis=0), [0.055, 0.055, 0.06], atol=1e-4)


def test_small_pieces_that_reach_the_rest_stay(tmp_path):
    beads = [ball(0.003, 0.0295 + 0.0055 * k, 0, 0.04) for k in range(4)]
    result = with_pieces(tmp_path, *beads)
    assert result.report["mended"]["crumbs_dropped"] == 0
    assert np.ptp(result.mesh[0][:, 0]) == pytest.approx(0.0275 + 0.0295 + 3 * 0.0055 + 0.003, abs=1e-3)


def test_a_small_piece_that_sticks_in_the_wall_stays(tmp_path):
    """None of its corners is near the wall that it passes through."""
    lug = trimesh.creation.box((0.012, 0.008, 0.006)).apply_translation((0.0275, 0, 0.03))
    assert with_pieces(tmp_path, lug).report["mended"]["crumbs_dropped"] == 0


def test_another_thing_in_the_mesh_is_refused(tmp_path):
    with pytest.raises(PipelineError, match=r"found something \d+ mm wide apart from it at \(.*remove it"):
        with_pieces(tmp_path, ball(0.02, 0.1, 0, 0.02))


def test_another_thing_beside_a_sheet_is_refused(tmp_path):
    cup = trimesh.creation.revolve([[0.0, 0.0], [0.03, 0.0], [0.03, 0.06]], sections=48)
    both = trimesh.util.concatenate([cup, ball(0.015, 0.09, 0, 0.03)])
    (tmp_path / "cup").mkdir()
    (tmp_path / "cup" / "scan.yaml").write_text("wall_mm: 3\n")
    with pytest.raises(PipelineError, match="apart from it"):
        drop(tmp_path / "cup", both.vertices, both.faces)


def test_a_handle_that_sticks_in_a_thin_wall_is_joined_exactly(tmp_path):
    cup = thin_cup(38, 240, 0.5)
    handle = trimesh.creation.torus(0.03, 0.004).apply_translation([0.067, 0, 0])
    turn = trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0], [0.067, 0, 0])
    handle.apply_transform(turn).apply_translation([0, 0, 0.1])
    result = dropped(tmp_path / "thermos", cup, handle)
    union = trimesh.boolean.union([cup, handle], engine="manifold")
    assert trimesh.Trimesh(*result.mesh).volume == pytest.approx(union.volume, rel=1e-6)
    assert result.report["watertight"]
    assert not result.report["mended"]["remeshed"]
    assert capacity_ml(result) == pytest.approx(np.pi * 37.5**2 * 239.5 / 1e3, rel=0.01)


def test_a_thin_wall_is_not_lost_between_cells(tmp_path):
    within = turned((14.5, 20), (15, 20))  # triangles within the wall, so that more than two meet at an edge
    result = dropped(tmp_path / "cup", thin_cup(15, 40, 0.5), within)
    assert result.report["mended"]["remeshed"]
    assert capacity_ml(result) == pytest.approx(np.pi * 14.5**2 * 39.5 / 1e3, rel=0.015)


def test_a_wall_too_thin_to_be_closed_is_named(tmp_path):
    within = turned((149.7, 30), (150, 30))
    with pytest.raises(
        PipelineError, match=r"wall of at least 1\.9 mm, found open parts with a wall of 0\.3 mm"
    ):
        dropped(tmp_path / "pan", thin_cup(150, 60, 0.3), within)


@pytest.mark.parametrize("radius_mm", [36.5, 37.5])  # not quite as wide as the inside, and into the wall
def test_liquid_in_a_mesh_is_told(tmp_path, radius_mm):
    liquid = turned((0, 3), (radius_mm, 3), (radius_mm, 60), (0, 60))
    result = dropped(tmp_path / "mug", thin_cup(40, 90, 3), liquid)
    (told,) = result.complaints
    assert "level top 60 mm above the base is taken for the floor" in told
    assert re.search(r"without it 37\d ml go in instead of 12\d: if it is liquid, remove it", told)


def test_a_sheet_of_liquid_in_a_mesh_is_named(tmp_path):
    with pytest.raises(
        PipelineError, match="part with a level top in it, as of liquid, 60 mm above its base; remove it"
    ):
        dropped(tmp_path / "mug", thin_cup(40, 90, 3), turned((0, 60), (36.9, 60)))


def test_holes_that_were_closed_are_told(tmp_path):
    """A flower pot's hole was closed as a gap of its scan, and nothing was said."""
    pot = turned((0, 0), (40, 0), (45, 80), (42, 80), (37, 3), (0, 3))
    hole = trimesh.creation.cylinder(0.003, 0.02)
    (told,) = dropped(tmp_path, pot.difference(hole)).complaints
    assert "a hole through which liquid would leave" in told


def test_a_floor_made_for_itself_is_no_liquid(tmp_path):
    tube = turned((40, 0), (40, 90), (37, 90), (37, 0), (40, 0))
    result = dropped(tmp_path / "mug", tube, turned((0, 0), (37.5, 0), (37.5, 4), (0, 4)))
    assert result.complaints == ()
    assert capacity_ml(result) == pytest.approx(np.pi * 37**2 * 86 / 1e3, rel=0.01)


@pytest.mark.parametrize("top", [(30, 61.5), (15, 62)])  # a meniscus's edge, foam's middle
def test_liquid_whose_top_is_not_flat_is_told(tmp_path, top):
    meniscus = [(37.5, 63), (33, 61), (25, 60), (0, 60)] if top == (30, 61.5) else [(37.5, 60), top, (0, 64)]
    result = dropped(tmp_path / "mug", thin_cup(40, 90, 3), turned((0, 2), (37.5, 2), *meniscus))
    (told,) = result.complaints
    assert re.search(r"without it 37\d ml go in instead of 1[12]\d: if it is liquid, remove it", told)


def test_a_spoon_in_a_cup_is_named(tmp_path):
    spoon = turned((0, -5), (4, -5), (4, 130), (0, 130)).apply_translation([0, 0, 0.006])
    with pytest.raises(
        PipelineError,
        match=r"alone, found something 135 mm wide in it or over its opening at \(0, 0, 69\) mm .*; remove it where",
    ):
        dropped(tmp_path / "mug", thin_cup(40, 90, 3), spoon)


def test_a_lid_is_named(tmp_path):
    lid = turned((0, 0), (40, 0), (40, 3), (0, 3)).apply_translation([0, 0, 0.0895])
    with pytest.raises(
        PipelineError,
        match=r"80 mm wide in it or over its opening at \(-?0, -?0, 91\) mm .*; remove it where",
    ):
        dropped(tmp_path / "mug", thin_cup(40, 90, 3), lid)


def test_a_sheet_on_the_wall_is_no_hole(tmp_path):
    picture = turned((20.1, 12), (20.1, 24))
    result = dropped(tmp_path / "mug", thin_cup(20, 30, 3), picture)
    assert capacity_ml(result) == pytest.approx(np.pi * 17**2 * 27 / 1e3, rel=0.01)


def test_a_wide_hole_beside_a_sheet_on_the_wall_is_one(tmp_path):
    cup, picture = thin_cup(30, 40, 3), turned((30.1, 12), (30.1, 30))
    cup.update_faces((cup.triangles_center[:, 0] < 0.029) | (cup.triangles_center[:, 2] < 0.02))
    with pytest.raises(PipelineError, match="expected a closed surface, found a hole"):
        dropped(tmp_path / "mug", cup, picture)
