"""One virtual scan in every layout gives one surface; each common mistake has a sentence of its own."""

import json
from dataclasses import replace

import numpy as np
import open3d as o3d
import pytest
import trimesh
from fuse import scenes, writers
from PIL import Image

from pipeline.errors import PipelineError
from pipeline.fuse import agreement, layouts
from pipeline.fuse.fusion import fused
from pipeline.geometry import frames
from pipeline.geometry.surface import Surface
from pipeline.scan import camera, recording
from pipeline.scan.shapes import shape

OPTIONS = {"voxel_m": 0.002, "truncation_m": 0.004, "n_points": 5000, "seed": 2}


@pytest.fixture(scope="module")
def recorded():
    """Ten views of a cup that stands somewhere on the table."""
    body = shape("small_cup")
    T_world_object = recording.pose_on_table(recording.generator(1, "small_cup", 0))
    return recording.views(body, T_world_object, 10, 0.6, 1.0, 1)


@pytest.fixture(scope="module")
def reference(recorded, tmp_path_factory):
    """The result of the layout that scan writes."""
    folder = tmp_path_factory.mktemp("reference")
    writers.seven_scenes(folder, recorded)
    return fused(folder, **OPTIONS)


@pytest.mark.parametrize("layout", [name for name in writers.WRITERS if name != "7-scenes"])
def test_every_layout_gives_the_same_surface(recorded, reference, tmp_path, layout):
    writers.WRITERS[layout](tmp_path, recorded)
    result = fused(tmp_path, **OPTIONS)
    assert result.report["layout"] == ("7-scenes" if layout == "numbered" else layout)
    assert result.report["n_views"] == len(recorded)
    distance = Surface(*reference.mesh).distance(result.mesh[0])
    assert np.quantile(distance, 0.999) < 1e-4


def read(folder, recorded, layout: str):
    writers.WRITERS[layout](folder, recorded)
    return layouts.read(folder)


@pytest.mark.parametrize("layout", writers.WRITERS)
def test_every_layout_reads_the_same_views(recorded, tmp_path, layout):
    views = read(tmp_path, recorded, layout)
    for (depth, T), found, T_found in zip(recorded, views.depths_m, views.T_world_cameras, strict=True):
        np.testing.assert_allclose(T_found, T, atol=1e-9)
        height, width = found.shape
        np.testing.assert_allclose(found, depth[-height:, -width:] / 1000, atol=1e-6)
    centres = views.intrinsics[:, :2, 2] - [[d.shape[1], d.shape[0]] for d in views.depths_m]
    np.testing.assert_allclose(centres, np.tile([-320.5, -240.5], (len(recorded), 1)))


def by_open3d(folder, recorded) -> None:
    """Write Open3D's folder, the poses by Open3D itself."""
    writers.open3d(folder, recorded)
    (folder / "trajectory.log").unlink()
    trajectory = o3d.camera.PinholeCameraTrajectory()
    views = []
    for _, T in recorded:
        views.append(o3d.camera.PinholeCameraParameters())
        views[-1].extrinsic = np.linalg.inv(T)
    trajectory.parameters = views
    o3d.io.write_pinhole_camera_trajectory(str(folder / "trajectory.json"), trajectory)


def of_reconstruction(folder, recorded) -> None:
    """Write what Open3D's recorder and its reconstruction leave."""
    writers.open3d(folder, recorded)
    (folder / "scene").mkdir()
    (folder / "trajectory.log").rename(folder / "scene/trajectory.log")
    (folder / "camera_intrinsic.json").rename(folder / "intrinsic.json")


def scannet(folder, recorded) -> None:
    """Write a pose a view, and a camera of 4×4."""
    writers.open3d(folder, recorded)
    for name in ("trajectory.log", "camera_intrinsic.json"):
        (folder / name).unlink()
    for name in ("pose", "intrinsic"):
        (folder / name).mkdir()
    for i, (_, T) in enumerate(recorded):
        np.savetxt(folder / f"pose/{i:05d}.txt", T)
    K = np.eye(4)
    K[:3, :3] = camera.intrinsics()
    np.savetxt(folder / "intrinsic/intrinsic_depth.txt", K)


@pytest.mark.parametrize("write", [by_open3d, of_reconstruction, scannet])
def test_the_poses_of_a_folder_with_depth_are_found(recorded, tmp_path, write):
    write(tmp_path, recorded)
    views = layouts.read(tmp_path)
    np.testing.assert_allclose(views.T_world_cameras, [T for _, T in recorded], atol=1e-9)
    np.testing.assert_allclose(views.intrinsics, np.tile(camera.intrinsics(), (len(recorded), 1, 1)))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda found: found.pop("parameters"), ("the key parameters", "export it again")),
        (lambda found: found["parameters"].pop(), ("each of the 10 images", "found 9")),
        (lambda found: found["parameters"][3].pop("extrinsic"), ("an extrinsic",)),
        (lambda found: found["parameters"][3]["extrinsic"].pop(), ("parameters 3: extrinsic", "16 numbers")),
        (lambda found: found["parameters"][3]["extrinsic"].reverse(), ("parameters 3: extrinsic", "rigid")),
    ],
)
def test_a_wrong_trajectory_names_file_and_key(recorded, tmp_path, change, words):
    by_open3d(tmp_path, recorded)
    path = tmp_path / "trajectory.json"
    found = json.loads(path.read_text())
    change(found)
    path.write_text(json.dumps(found))
    with pytest.raises(PipelineError) as caught:
        layouts.read(tmp_path)
    assert all(word in str(caught.value) for word in (str(path), *words)), caught.value


@pytest.mark.parametrize("name", ["poses.txt", "Camera_Pose", "transforms.json", "cameras", "odometry.csv"])
def test_poses_that_are_not_read_are_named(recorded, tmp_path, name):
    writers.open3d(tmp_path, recorded)
    (tmp_path / "trajectory.log").rename(tmp_path / name)
    with pytest.raises(
        PipelineError, match=rf"expected poses in trajectory\.log, found {name}, which is not"
    ):
        layouts.read(tmp_path)
    (tmp_path / name).rename(tmp_path / "exposure.txt")
    assert layouts.read(tmp_path).T_world_cameras == []


def test_a_camera_of_images_of_another_size_is_named(recorded, tmp_path):
    writers.open3d(tmp_path, recorded)
    path = tmp_path / "camera_intrinsic.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"width": 1280, "height": 720}))
    with pytest.raises(
        PipelineError, match=r"camera_intrinsic\.json: .* 640×480 pixels, found one of 1280×720;"
    ):
        layouts.read(tmp_path)


def test_what_is_written_into_the_file_of_intrinsics_is_said(recorded, tmp_path):
    writers.open3d(tmp_path, recorded)
    (tmp_path / "camera_intrinsic.json").unlink()
    with pytest.raises(PipelineError, match="add it: fx 0 cx / 0 fy cy / 0 0 1 in pixels"):
        layouts.read(tmp_path)


def said(folder, recorded) -> str:
    writers.open3d(folder, recorded)
    with pytest.raises(PipelineError) as caught:
        agreement.checked(layouts.read(folder), str(folder), np.random.default_rng(1))
    assert str(folder) in str(caught.value)
    return str(caught.value)


def _moved(recorded, change):
    return [(depth, change(T)) for depth, T in recorded]


def _reordered(T):
    from scipy.spatial.transform import Rotation

    wrong = T.copy()
    wrong[:3, :3] = Rotation.from_quat(np.roll(Rotation.from_matrix(T[:3, :3]).as_quat(), 1)).as_matrix()
    return wrong


FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
MM = np.array([[1, 1, 1, 1000.0]] * 3 + [[1, 1, 1, 1]])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (np.linalg.inv, ("poses world→camera;", "inverses")),
        (lambda T: T * MM, ("translations in mm", "units: mm", "scan.yaml")),
        (lambda T: np.linalg.inv(T) * MM, ("world→camera in mm", "units: mm")),
        (lambda T: T @ FLIP, ("OpenGL", "y and z")),
        (lambda T: np.linalg.inv(T @ FLIP), ("poses world→camera of", "OpenGL")),
        (_reordered, ("w x y z",)),
    ],
)
def test_each_mistake_in_poses_is_named(recorded, tmp_path, change, words):
    message = said(tmp_path, _moved(recorded, change))
    assert all(word in message for word in words), message


@pytest.mark.parametrize("factor", [0.95, 1.03])
def test_a_unit_of_depth_that_is_a_little_off_is_named(recorded, tmp_path, factor):
    message = said(tmp_path, [(np.round(depth * factor), T) for depth, T in recorded])
    assert float(message.split("depth_scale: ")[1].split("`")[0]) == pytest.approx(1000 * factor, rel=0.005)


def test_a_unit_of_depth_that_is_a_little_off_is_named_though_neighbours_in_a_sequence_agree(
    recorded, tmp_path
):
    views = read(tmp_path, recorded, "open3d")
    slow = np.repeat(np.arange(len(recorded)), 8)
    views = replace(
        views,
        depths_m=[views.depths_m[i] * np.float32(0.97) for i in slow],
        T_world_cameras=[views.T_world_cameras[i] for i in slow],
        intrinsics=views.intrinsics[slow],
        names=[f"{number:06d}" for number in range(len(slow))],
    )
    with pytest.raises(PipelineError) as caught:
        agreement.checked(views, "cup", np.random.default_rng(1))
    assert float(str(caught.value).split("depth_scale: ")[1].split("`")[0]) == pytest.approx(970, rel=0.005)


@pytest.mark.parametrize("factor", [0.9, 1.05])
def test_another_focal_length_is_named(recorded, tmp_path, factor):
    views = read(tmp_path, recorded, "open3d")
    wrong = replace(views, intrinsics=views.intrinsics * [[factor, 1, 1], [1, factor, 1], [1, 1, 1]])
    with pytest.raises(
        PipelineError, match=r"focal length of about \d+ pixels .* correct the intrinsics"
    ) as caught:
        agreement.checked(wrong, "cup", np.random.default_rng(1))
    focal = float(str(caught.value).split("about ")[1].split()[0])
    assert focal == pytest.approx(camera.FOCAL_PX, rel=0.005)


def test_poses_that_are_a_little_off_are_not_taken_for_another_scale(recorded, tmp_path):
    views = read(tmp_path, recorded, "open3d")
    behind = [T @ frames.transform(np.eye(3), np.array([0, 0, -0.01])) for T in views.T_world_cameras]
    for off in (scenes.shaken(views, 0.003, 0.5), replace(views, T_world_cameras=behind)):
        assert agreement.checked(off, "cup", np.random.default_rng(1))[1] == []


@pytest.mark.parametrize(("factor", "scale"), [(5, "5000"), (10, "1e+04"), (0.25, "250")])
def test_another_unit_of_depth_is_named(recorded, tmp_path, factor, scale):
    message = said(tmp_path, [(depth * factor, T) for depth, T in recorded])
    assert "depth_scale" in message
    found = float(message.split("depth_scale: ")[1].split("`")[0])
    assert found == pytest.approx(float(scale), rel=0.04)


def test_the_order_of_images_and_poses_matters(recorded, tmp_path):
    poses = [T for _, T in recorded]
    message = said(
        tmp_path, [(depth, T) for (depth, _), T in zip(recorded, [*poses[3:], *poses[:3]], strict=True)]
    )
    assert "the order of images and poses" in message


def test_a_view_with_a_wrong_pose_is_left_out_and_named(recorded, tmp_path):
    wrong = [*recorded[:4], (recorded[4][0], recorded[0][1]), *recorded[5:]]
    views = read(tmp_path, wrong, "open3d")
    kept, left_out = agreement.checked(views, "cup", np.random.default_rng(1))
    assert left_out == ["depth/00004.png"]
    assert len(kept.depths_m) == len(kept.T_world_cameras) == len(kept.intrinsics) == 9


def test_two_scans_in_a_folder_are_refused(recorded, tmp_path):
    writers.bop(tmp_path, recorded[:1])
    trimesh.creation.box([0.1] * 3).export(tmp_path / "cup.ply")
    with pytest.raises(PipelineError, match=r"found images \(bop\) and cup.ply: more than one scan"):
        layouts.read(tmp_path)


def test_images_count_as_their_numbers_do(recorded, tmp_path):
    writers.open3d(tmp_path, recorded * 2)
    for path in (tmp_path / "depth").glob("*.png"):
        path.rename(path.with_name(f"{int(path.stem)}.PNG"))
    views = layouts.read(tmp_path)
    assert views.names == [f"depth/{i}.PNG" for i in range(2 * len(recorded))]


def test_text_from_windows_is_read(recorded, tmp_path):
    writers.tum(tmp_path, recorded)
    for path in (*tmp_path.glob("*.txt"), *tmp_path.glob("*.json")):
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert len(layouts.read(tmp_path).T_world_cameras) == len(recorded)


def test_a_scan_one_folder_too_deep_is_found(recorded, tmp_path):
    writers.seven_scenes(tmp_path / "cup" / "Cup 1", recorded)
    (tmp_path / "cup" / "__MACOSX").mkdir()
    with pytest.raises(PipelineError, match="move what is in Cup 1/ one folder up"):
        layouts.read(tmp_path / "cup")


def test_images_of_another_format_are_shown(recorded, tmp_path):
    writers.open3d(tmp_path, recorded)
    for path in (tmp_path / "depth").glob("*.png"):
        path.rename(path.with_suffix(".tif"))
    with pytest.raises(PipelineError, match=r"found 00000\.tif; export them again"):
        layouts.read(tmp_path)


@pytest.mark.parametrize(("size", "used"), [((640, 480), True), ((1280, 720), False)])
def test_colours_of_another_size_are_not_used_and_that_is_known(recorded, tmp_path, size, used):
    writers.seven_scenes(tmp_path / "cup", recorded)
    for pose in (tmp_path / "cup").glob("*.pose.txt"):
        Image.new("RGB", size).save(pose.with_name(pose.name.replace("pose.txt", "color.png")))
        pose.unlink()
    views = layouts.read(tmp_path / "cup")
    assert (len(views.colours) == len(recorded), views.colours_differ) == (used, not used)


def test_a_camera_of_open3d_without_a_size_is_one_of_any(recorded, tmp_path):
    writers.open3d(tmp_path / "cup", recorded)
    own = o3d.camera.PinholeCameraIntrinsic()
    own.intrinsic_matrix = camera.intrinsics()
    o3d.io.write_pinhole_camera_intrinsic(str(tmp_path / "cup" / "camera_intrinsic.json"), own)
    assert len(layouts.read(tmp_path / "cup").names) == len(recorded)


@pytest.mark.parametrize(
    ("name", "holds_poses"),
    [
        ("poses.txt", True),
        ("camera_poses", True),
        ("KeyFrameTrajectory.txt", True),
        ("odometry.csv", True),
        ("transforms.json", True),
        ("cameras", True),
        ("pose.jpg", False),
        ("pose_guide.md", False),
        ("trajectory_plan.png", False),
        ("odometer.jpg", False),
        ("cameras.txt", False),
        ("purpose.txt", False),
    ],
)
def test_names_of_files_that_hold_poses(name, holds_poses):
    assert bool(layouts._POSES.fullmatch(name)) == holds_poses


@pytest.mark.parametrize(
    ("n", "shape", "taken"), [(60, (480, 640), 60), (300, (480, 640), 200), (90, (720, 1280), 66)]
)
def test_of_a_long_sequence_as_many_views_are_taken_as_are_enough(tmp_path, n, shape, taken):
    Image.fromarray(np.full(shape, 700, np.uint16)).save(tmp_path / "first.png")
    for number in range(n):
        (tmp_path / f"frame-{number:06d}.depth.png").hardlink_to(tmp_path / "first.png")
        np.savetxt(tmp_path / f"frame-{number:06d}.pose.txt", np.eye(4))
    (tmp_path / "first.png").unlink()
    np.savetxt(
        tmp_path / "camera-intrinsics.txt", [[600, 0, shape[1] / 2], [0, 600, shape[0] / 2], [0, 0, 1]]
    )
    views = layouts.read(tmp_path)
    assert (len(views.names), views.n_found) == (taken, n)
    assert views.names[0].startswith("frame-000000")
    assert views.names[-1].startswith(f"frame-{n - 1:06d}")
