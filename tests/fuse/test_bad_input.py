"""Each thing that a user can get wrong in a raw folder ends in one sentence with the file's name and what to do."""

import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
import trimesh
from PIL import Image

from pipeline.errors import PipelineError
from pipeline.fuse.fusion import fused
from pipeline.scan.shapes import shape

OPTIONS = {"voxel_m": 0.002, "truncation_m": 0.004, "n_points": 5000, "seed": 2}


@pytest.fixture
def folder(scan, tmp_path):
    """A good recording to spoil."""
    return shutil.copytree(scan("small_cup", views=10).folder, tmp_path / "cup")


def refused(folder, *words: str) -> str:
    """Fuse, expect the sentence to name all the words, and return it."""
    with pytest.raises(PipelineError) as caught:
        fused(folder, **OPTIONS)
    message = str(caught.value)
    for word in (str(folder), "expected", *words):
        assert word in message
    return message


def box(path, size_m: float = 0.1) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    trimesh.creation.box([size_m] * 3).export(path)


def test_the_good_one_is_good(folder):
    assert fused(folder, **OPTIONS).report["n_views"] == 10


def test_empty_or_missing_folder(tmp_path):
    (tmp_path / "empty").mkdir()
    refused(tmp_path / "empty", "found nothing", "camera-intrinsics.txt", ".obj")
    refused(tmp_path / "missing", "found nothing")


def test_something_else(tmp_path):
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "readme.doc").touch()
    refused(tmp_path / "notes", "readme.doc")
    box(tmp_path / "two" / "a.ply")
    box(tmp_path / "two" / "b.ply")
    refused(tmp_path / "two", "a.ply and b.ply", "one scan a folder")


def test_no_intrinsics(folder):
    (folder / "camera-intrinsics.txt").unlink()
    refused(folder, "camera-intrinsics.txt", "no such file")


@pytest.mark.parametrize("text", ["1 2 3", "0 0 320\n0 0 240\n0 0 1", "a b c\nd e f\ng h i"])
def test_wrong_intrinsics(folder, text):
    (folder / "camera-intrinsics.txt").write_text(text)
    refused(folder, "camera-intrinsics.txt")


def test_truncated_png(folder):
    path = folder / "frame-000004.depth.png"
    path.write_bytes(path.read_bytes()[:2000])
    refused(folder, path.name, "cannot be read")


def test_eight_bit_png(folder):
    path = folder / "frame-000004.depth.png"
    Image.fromarray(np.full((480, 640), 60, np.uint8)).save(path)
    refused(folder, path.name, "16-bit")


def test_missing_pose(folder):
    (folder / "frame-000003.pose.txt").unlink()
    refused(folder, "frame-000003.pose.txt", "no such file")


def test_pose_that_is_not_rigid(folder):
    path = folder / "frame-000003.pose.txt"
    np.savetxt(path, np.loadtxt(path) @ np.diag([1, 1, 1.1, 1]))
    refused(folder, path.name, "rigid", "camera→world")
    np.savetxt(path, np.diag([1, 1, -1.0, 1]))
    refused(folder, path.name, "determinant -1")


def test_nan_pose(folder):
    path = folder / "frame-000003.pose.txt"
    pose = np.loadtxt(path)
    pose[0, 3] = np.nan
    np.savetxt(path, pose)
    refused(folder, path.name, "1 not finite")


def test_images_without_depth(folder):
    for path in folder.glob("*.depth.png"):
        Image.fromarray(np.zeros((480, 640), np.uint16)).save(path)
    refused(folder, "zeros in all 10")


def test_poses_the_wrong_way_round(folder):
    for path in folder.glob("*.pose.txt"):
        np.savetxt(path, np.linalg.inv(np.loadtxt(path)))
    refused(folder, "camera→world")


@pytest.mark.parametrize("scale", [200, 1100, 5000])
def test_depth_in_another_unit(folder, scale):
    (folder / "scan.yaml").write_text(f"depth_scale: {scale}\n")
    refused(folder, "depth_scale")


def test_nothing_on_the_table(folder):
    Image.fromarray(np.full((480, 640), 600, np.uint16)).save(folder / "frame-000000.depth.png")
    np.savetxt(folder / "frame-000000.pose.txt", np.diag([1, -1, -1, 1.0]))
    for i in range(1, 10):
        (folder / f"frame-{i:06d}.depth.png").unlink()
    refused(folder, "an object on the table", "found 0 points")


def test_mesh_without_faces(tmp_path):
    (tmp_path / "dots").mkdir()
    trimesh.PointCloud(np.random.default_rng(1).random((50, 3))).export(tmp_path / "dots" / "dots.ply")
    refused(tmp_path / "dots", "dots.ply", "found 50")


def test_mesh_that_is_none(tmp_path):
    (tmp_path / "text").mkdir()
    (tmp_path / "text" / "cup.ply").write_text("no mesh at all")
    refused(tmp_path / "text", "cup.ply", "cannot be read")


def test_mesh_in_millimetres_and_the_cure(tmp_path):
    folder = tmp_path / "mm"
    box(folder / "cup.stl", 80.0)
    message = refused(folder, "80 m", "looks like millimetres")
    assert re.search(r"write `units: mm` into .*mm/scan.yaml", message)
    (folder / "scan.yaml").write_text("units: mm\n")
    np.testing.assert_allclose(np.ptp(fused(folder, **OPTIONS).mesh[0], axis=0), 0.08, rtol=1e-6)


def test_mesh_in_inches_is_not_told_to_be_in_millimetres(tmp_path):
    box(tmp_path / "inch" / "cup.stl", 3.5)
    message = refused(tmp_path / "inch", "3.5 m", "centimetres or inches")
    assert "units: mm" not in message


def test_mesh_of_unit_size_and_the_cure(tmp_path):
    folder = tmp_path / "unit"
    box(folder / "cup.obj", 1.0)
    refused(folder, "1 m", "true size", "units: m")
    (folder / "scan.yaml").write_text("units: cm\n")
    np.testing.assert_allclose(np.ptp(fused(folder, **OPTIONS).mesh[0], axis=0), 0.01, rtol=1e-6)


def test_wrong_units_are_not_told_to_be_written_once_more(tmp_path):
    box(tmp_path / "cm" / "cup.stl", 250.0)
    (tmp_path / "cm" / "scan.yaml").write_text("units: cm\n")
    assert "write `units" not in refused(tmp_path / "cm", "2.5 m", "correct `units`")


def test_a_frame_without_its_pose(folder):
    (folder / "frame-000004.pose.txt").unlink()
    refused(folder, "frame-000004.pose.txt", "add it or remove the frame")


def test_tiny_mesh(tmp_path):
    box(tmp_path / "tiny" / "cup.obj", 0.001)
    refused(tmp_path / "tiny", "cup.obj", "1 mm", "units")


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("unit: mm", "unit"),
        ("units: inch", "inch"),
        ("up: w", "up"),
        ("depth_scale: -1", "depth_scale"),
        ("[1", "YAML"),
    ],
)
def test_wrong_scan_yaml(tmp_path, text, named):
    box(tmp_path / "cup" / "cup.ply")
    (tmp_path / "cup" / "scan.yaml").write_text(text)
    refused(tmp_path / "cup", "scan.yaml", named)


@pytest.mark.parametrize("key", ["up: y", "wall_mm: 3", "turntable_deg: [0, 10]"])
def test_keys_without_effect_on_views_are_refused(folder, key):
    (folder / "scan.yaml").write_text(f"{key}\n")
    refused(folder, "scan.yaml", f"no `{key.split(':')[0]}` for", "remove it")


@pytest.mark.parametrize("key", ["depth_scale: 1000", "turntable_deg: [0]"])
def test_keys_without_effect_on_meshes_are_refused(tmp_path, key):
    box(tmp_path / "cup" / "cup.ply")
    (tmp_path / "cup" / "scan.yaml").write_text(f"{key}\n")
    refused(tmp_path / "cup", "scan.yaml", f"no `{key.split(':')[0]}` for a mesh", "remove it")


def test_a_wall_is_only_given_to_what_has_none(tmp_path):
    (tmp_path / "cup").mkdir()
    cup = shape("small_cup")
    trimesh.Trimesh(cup.vertices_m, cup.triangles, process=False).export(tmp_path / "cup" / "cup.ply")
    (tmp_path / "cup" / "scan.yaml").write_text("wall_mm: 3\n")
    refused(tmp_path / "cup", "found a wall with two sides", "remove `wall_mm`")
    np.savez(tmp_path / "cup" / "cup.npz", points=cup.vertices_m)
    (tmp_path / "cup" / "cup.ply").unlink()
    refused(tmp_path / "cup", "scan.yaml", "no `wall_mm` for a point cloud")


def test_the_command_says_one_sentence_and_writes_nothing(tmp_path):
    (tmp_path / "empty").mkdir()
    outputs = [tmp_path / "out" / name for name in ("mesh.ply", "cloud.parquet", "fusion.json")]
    options = [
        "--raw",
        tmp_path / "empty",
        "--mesh",
        outputs[0],
        "--cloud",
        outputs[1],
        "--report",
        outputs[2],
    ]
    done = subprocess.run(
        [sys.executable, "-m", "pipeline.fuse", *map(str, options)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()
