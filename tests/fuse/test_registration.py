"""Views without poses: registered to within twice the errors of posed fusion; what no view can tell is said."""

from functools import cache

import numpy as np
import pytest
from fuse import writers
from PIL import Image

from pipeline.errors import PipelineError
from pipeline.fuse import agreement, layouts, levelled, recorded, registration
from pipeline.geometry import frames
from pipeline.scan import camera, recording
from pipeline.scan.shapes import shape

T_WORLD_OBJECT = frames.transform(np.eye(3), np.array([0.02, -0.03, recording.TABLE_HEIGHT_M]))
RINGS_DEG = ((25.0, 4), (52.0, 8))


def record(folder, name: str, options: str = "", colour=None, lug=()) -> np.ndarray:
    """Write views of an object on the table without their poses, perhaps with colours, and return the poses (N, 4, 4)."""
    recorded = seen(name, lug)
    writers.seven_scenes(folder, recorded)
    for path in folder.glob("*.pose.txt"):
        path.unlink()
    for i, (depth, T) in enumerate(recorded if colour else []):
        Image.fromarray(colour(depth, T)).save(folder / f"frame-{i:06d}.color.png")
    if options:
        (folder / "scan.yaml").write_text(options)
    return np.stack([T for _, T in recorded])


@cache
def seen(name: str, lug: tuple) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return depths (H, W) in mm and T_world_camera of views from two rings, perhaps with a `box` at the object."""
    body = shape(name)
    cup = frames.apply(T_WORLD_OBJECT, body.vertices_m), body.triangles
    scene = camera.Scene([cup, recording.table(), *([box(*lug)] if lug else [])])
    target, recorded = T_WORLD_OBJECT[:3, 3] + [0, 0, body.height_m / 2], []
    for elevation, count in RINGS_DEG:
        for k in range(count):
            a, e = 2 * np.pi * k / count, np.deg2rad(elevation)
            direction = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
            T = frames.look_at(target + 0.6 * direction, target)
            recorded.append(
                (camera.depth_image(scene, T, camera.Noise(1.0), np.random.default_rng(len(recorded))), T)
            )
    return recorded


def paint(depth_mm: np.ndarray, T_world_camera: np.ndarray) -> np.ndarray:
    """Return grey sectors (H, W, 3) all round an object, in a light that stays with the camera."""
    v, u = np.mgrid[: depth_mm.shape[0], : depth_mm.shape[1]]
    points = agreement.unprojected(u, v, depth_mm / 1000, camera.intrinsics())
    x, y, _ = np.moveaxis(frames.apply(frames.inverse(T_WORLD_OBJECT) @ T_world_camera, points), -1, 0)
    sectors = np.digitize(np.degrees(np.arctan2(y, x)) % 360, [80, 150, 270])
    grey = np.array([50, 120, 200, 90])[sectors] * (0.7 + 0.3 * v / v.max())
    return np.repeat(grey[..., None], 3, axis=2).astype(np.uint8)


def shade(depth_mm: np.ndarray, T_world_camera: np.ndarray) -> np.ndarray:
    """Return what a camera with noise of its own sees (H, W, 3) of an object without paint, in light from a window."""
    v, u = np.mgrid[: depth_mm.shape[0], : depth_mm.shape[1]]
    points = agreement.unprojected(u, v, depth_mm / 1000, camera.intrinsics())
    around = np.cross(np.gradient(points, axis=1), np.gradient(points, axis=0)) @ T_world_camera[:3, :3].T
    lit = np.abs(around @ [0.3, 0.5, 0.81]) / np.maximum(np.linalg.norm(around, axis=2), 1e-12)
    noise = np.random.default_rng(int(depth_mm.sum()) % 1000).normal(size=lit.shape)
    grey = np.clip(180 * (0.75 + 0.25 * lit) + 4 * noise, 0, 255)
    return np.repeat(grey[..., None], 3, axis=2).astype(np.uint8)


def turns_deg(scan, truth: np.ndarray, views: range) -> np.ndarray:
    """Return by how much each of the views is turned against the last of them, beyond what is true."""
    first = truth[views[-1]] @ np.linalg.inv(scan.views.T_world_cameras[views[-1]])
    apart = np.stack([np.linalg.inv(truth[i]) @ first @ scan.views.T_world_cameras[i] for i in views])
    return np.degrees(np.arccos(np.clip((np.trace(apart[:, :3, :3], axis1=1, axis2=2) - 1) / 2, -1, 1)))


def shifts_m(scan, truth: np.ndarray) -> np.ndarray:
    """Return how far (N,) from the middle of all each view shows the object."""
    found = np.stack(scan.views.T_world_cameras) @ np.linalg.inv(truth) @ T_WORLD_OBJECT
    return np.linalg.norm(found[:, :2, 3] - np.median(found[:, :2, 3], axis=0), axis=1)


@pytest.mark.long
def test_paint_tells_the_turns_of_a_round_cup(tmp_path):
    truth = record(tmp_path, "small_cup", colour=paint)
    scan = located(tmp_path)
    assert scan.registration["roll_observable"]
    turns = turns_deg(scan, truth, range(len(truth)))
    assert np.median(turns) < 10.0  # six times the width of a pixel on its side
    assert turns.max() < 25.0


def test_the_shade_of_a_plain_cup_tells_no_turns(tmp_path):
    record(tmp_path, "small_cup", colour=shade)
    assert not located(tmp_path).registration["roll_observable"]


def located(folder):
    """Return the views with the poses that were found, table and object."""
    return recorded.located(layouts.read(folder), str(folder), np.random.default_rng(1))


def test_a_view_is_stood_upright_by_its_table(tmp_path):
    poses = record(tmp_path, "espresso_cup")
    view = levelled.level(layouts.read(tmp_path), 6, "cup", np.random.default_rng(1))
    T_level_object = view.T_level_camera @ np.linalg.inv(poses[6]) @ T_WORLD_OBJECT
    np.testing.assert_allclose(T_level_object[:3, 2], [0, 0, 1], atol=0.002)
    assert abs(T_level_object[2, 3]) < 0.0005
    assert np.linalg.norm(T_level_object[:2, 3]) < 0.004


def test_a_handle_tells_the_turns_of_the_views(tmp_path):
    truth = record(tmp_path, "espresso_cup")
    scan = located(tmp_path)
    assert scan.registration["roll_observable"]
    # Lower views, which the cup hides its handle from, have no turn; its two sides are seen by different views.
    assert turns_deg(scan, truth, range(RINGS_DEG[0][1], len(truth))).max() < 4.0
    # Shifts towards the cameras would make the wall thicker or thinner by twice as much.
    assert np.median(shifts_m(scan, truth)) < 0.00022


def test_a_round_cup_is_said_to_be_round_and_seen_from_all_sides(tmp_path):
    record(tmp_path, "small_cup")
    scan = located(tmp_path)
    assert not scan.registration["roll_observable"]
    eyes = np.array([(scan.placement.T_object_world @ T)[:2, 3] for T in scan.views.T_world_cameras])
    gaps = np.diff(np.sort(np.arctan2(*eyes.T)))
    assert gaps.max() < np.deg2rad(75)


def box(width_m: float, wide_m: float, high_m: float, at: tuple[float, float, float]):
    """Return vertices and triangles of a box on the table, its middle at a place of the object's frame."""
    import trimesh

    mesh = trimesh.creation.box([width_m, wide_m, high_m])
    return frames.apply(T_WORLD_OBJECT, np.asarray(mesh.vertices) + at), np.asarray(mesh.faces)


def test_a_lug_that_tells_no_turns_is_not_lost(tmp_path):
    record(tmp_path, "small_cup", lug=(0.015, 0.010, 0.005, (0.034, 0.0, 0.05)))
    with pytest.raises(
        PipelineError,
        match="more than 5 mm off one, as a small handle is, or views that do not fit; add poses",
    ):
        located(tmp_path)


def test_too_few_views_without_poses_are_refused(tmp_path):
    record(tmp_path, "small_cup")
    for path in sorted(tmp_path.glob("*.depth.png"))[5:]:
        path.unlink()
    with pytest.raises(PipelineError, match="expected at least 6 views where there are no poses, found 5"):
        located(tmp_path)


def test_as_many_angles_as_views(tmp_path):
    record(tmp_path, "small_cup", "turntable_deg: [0, 90, 180]\n")
    with pytest.raises(
        PipelineError, match="turntable_deg: expected an angle for each of the 12 views, found 3"
    ):
        located(tmp_path)


def test_views_of_things_of_different_widths_are_refused():
    def view(number: int, width_m: float) -> levelled.Levelled:
        points = np.array([[0.0, 0.0, 0.0], [width_m, 0.0, 0.0]])
        return levelled.Levelled(number, points, np.zeros((2, 3)), np.zeros(2), np.eye(4))

    names = [f"{i}.png" for i in range(10)]
    with_handle, with_platter = ([view(i, 0.08 * (k if i % 2 else 1)) for i in range(10)] for k in (2, 4))
    registration.check_alike(with_handle, names, "cup")
    with pytest.raises(PipelineError, match=r"80 mm in \d.png and one as wide as 320 mm in \d.png"):
        registration.check_alike(with_platter, names, "cup")
