"""One virtual scan in every layout gives one surface; each common mistake has a sentence of its own."""

import numpy as np
import pytest
import trimesh
from fuse import writers

from pipeline.errors import PipelineError
from pipeline.fuse import agreement, layouts
from pipeline.fuse.fusion import fused
from pipeline.geometry.surface import Surface
from pipeline.scan import recording
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
