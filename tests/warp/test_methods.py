"""What every method of warping must do, whatever it is."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml
from warp.bodies import cloud, iou, moved

from pipeline.errors import PipelineError
from pipeline.geometry.frames import transform
from pipeline.warp import files, methods, nearest_neighbour
from pipeline.warp.clouds import Cloud, subset
from pipeline.warp.foreign import foreign
from pipeline.warp.methods import METHODS
from pipeline.warp.quality import quality
from pipeline.warp.shape_space import example
from pipeline.warp.warp import Warp

POINTS, DENSE = 2000, 6000
SCHEMA = Path(__file__).parents[2] / "workflow/schemas/config.schema.yaml"

every_method = pytest.mark.parametrize("method", sorted(METHODS))


@cache
def body(name: str) -> Cloud:
    return cloud(name, POINTS)


OTHERS = ("small_cup", "tumbler", "jug", "wide_bowl")


@cache
def examples(name: str) -> list[np.ndarray]:
    """Return a source's points on objects that are no target here."""
    source = body(name)
    warps = [nearest_neighbour.fit(source, body(other), rng=np.random.default_rng(0)) for other in OTHERS]
    return [example(source, warp.deformation, warp.source_frame, warp.target_frame) for warp in warps]


def options(method: str, source: Cloud) -> dict:
    return {"examples": examples(source.name)} if method == "shape_space" else {}


def fit(method: str, source: Cloud, target: Cloud) -> Warp:
    return methods.fit(method, source, target, rng=np.random.default_rng(5), **options(method, source))


@cache
def fitted(method: str, target: str = "tall_cup") -> Warp:
    return fit(method, body("mug"), body(target))


def test_the_schema_knows_the_methods():
    section = yaml.safe_load(SCHEMA.read_text())["properties"]["warp"]["properties"]
    assert set(section["method"]["enum"]) == set(METHODS)


@every_method
def test_a_warp_has_pairs_frames_and_numbers(method):
    warp = fitted(method)
    assert warp.method == method
    assert warp.source_index.shape == warp.target_index.shape == warp.valid.shape == (POINTS,)
    assert ((warp.target_index >= 0) == warp.valid).all()
    assert warp.valid.mean() > 0.99
    np.testing.assert_allclose(warp.pose[:3, :3] @ warp.pose[:3, :3].T, np.eye(3), atol=1e-12)
    assert (warp.scale > 0.0).all()
    assert 0.0 < warp.cost_m < 0.03
    assert all(np.isfinite(list(warp.diagnostics.values())))


@every_method
def test_the_jacobian_is_the_derivative(method):
    warp, step_m = fitted(method), 1e-6
    at_m = body("mug").points_m[::97] + 0.0003
    J = warp.jacobian(at_m)
    for axis in range(3):
        ahead, behind = (warp.map_points(at_m + sign * step_m * np.eye(3)[axis]) for sign in (1, -1))
        np.testing.assert_allclose(J[:, :, axis], (ahead - behind) / (2 * step_m), atol=2e-3)


@every_method
def test_normals_stay_across_the_surface_that_moves(method):
    warp = fitted(method)
    some = np.arange(0, POINTS, 37)
    normals = warp.source.normals[some]
    along = np.cross(normals, np.roll(normals, 1, axis=1) + [0.1, 0.2, 0.3])
    carried = np.einsum("nij,nj->ni", warp.jacobian(warp.source.points_m[some]), along)
    np.testing.assert_allclose(np.einsum("ni,ni->n", carried, warp.aligned.normals[some]), 0.0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(warp.aligned.normals, axis=1), 1.0)


@every_method
def test_areas_follow_the_surface(method):
    warp = fitted(method)
    some = np.arange(0, POINTS, 37)
    normals = warp.source.normals[some]
    first = np.cross(normals, np.roll(normals, 1, axis=1) + [0.1, 0.2, 0.3])
    second = np.cross(normals, first)
    J = warp.jacobian(warp.source.points_m[some])
    before, after = (
        np.linalg.norm(np.cross(a, b), axis=1)
        for a, b in ((first, second), (np.einsum("nij,nj->ni", J, v) for v in (first, second)))
    )
    np.testing.assert_allclose(warp.aligned.area_m2[some] / warp.source.area_m2[some], after / before)


@every_method
def test_task_frames_move_with_the_points(method):
    warp = fitted(method)
    T_source_frame = np.stack([transform(np.eye(3), point) for point in body("mug").points_m[:5]])
    T_target_frame = warp.map_frames(T_source_frame)
    np.testing.assert_array_equal(
        T_target_frame[:, :3, 3], warp.map_points(np.ascontiguousarray(T_source_frame[:, :3, 3]))
    )
    R = T_target_frame[:, :3, :3]
    np.testing.assert_allclose(R @ R.transpose(0, 2, 1), np.tile(np.eye(3), (5, 1, 1)), atol=1e-12)
    assert np.linalg.det(R).min() > 0.0
    # A cup's up stays up.
    assert R[:, 2, 2].min() > 0.8


@every_method
@pytest.mark.parametrize("target", ["tall_cup", "espresso_cup"])
def test_labels_arrive_and_no_wall_is_crossed(method, target):
    warp = fitted(method, target)
    for mapped in (warp.map_labels(1), warp.map_cloud(1), warp.map_labels(5)):
        scores = quality(warp, mapped)
        assert scores["wall_side_flips"] == 0.0
        assert scores["share_without_candidate"] < 0.01
    found, true = warp.map_labels(1).cloud.parts, warp.target.parts
    # A wall without a handle gets none where the source's meets it.
    assert found[:, 2].any() == true[:, 2].any()
    if method != "rigid":
        assert iou(found[:, 1], true[:, 1]) > 0.45
        if true[:, 2].any():
            assert iou(found[:, 2], true[:, 2]) > 0.6


@every_method
@pytest.mark.parametrize("target", ["square_bowl", "wide_bowl", "mug"])
def test_a_source_without_a_handle_gives_none_and_leaves_out_nothing_but_a_targets(method, target):
    warp = fit(method, body("tall_cup"), cloud(target, DENSE))
    assert warp.valid.mean() > 0.99
    found, true = warp.map_labels(1).cloud.parts, warp.target.parts
    assert not found[:, 2].any()
    if target == "mug":
        assert warp.is_known[~true[:, 2]].mean() > 0.99
        assert not warp.is_known[true[:, 2]].all()
    if method != "rigid":
        assert iou(found[:, 1], true[:, 1]) > 0.45


@every_method
def test_what_the_source_has_nothing_like_is_left_out_before_the_fit(method):
    """Only nearest neighbours left it out; and what it was told of was told again, by the frame of the rest."""
    source, target = body("tall_cup"), cloud("mug", DENSE)
    warp = fit(method, source, target)
    rest = subset(target, ~foreign(target, source))
    assert 0.9 * DENSE < len(rest.points_m) < 0.97 * DENSE
    alone = METHODS[method](source, rest, rng=np.random.default_rng(5), **options(method, source))
    np.testing.assert_array_equal(warp.aligned.points_m, alone.aligned.points_m)
    assert warp.target is target
    assert warp.is_known.sum() == len(rest.points_m)


@pytest.mark.parametrize(("target", "points"), [("wide_bowl", 1500), ("square_bowl", 1500), ("jug", 1000)])
def test_pairs_are_found_in_clouds_too_thin_for_a_rim(target, points):
    whole = cloud(target, DENSE)
    thin, from_rows, to_rows = nearest_neighbour.pairs(
        nearest_neighbour.coarse(body("tall_cup"), whole), points
    )
    assert len(thin.target.points_m) == points
    with pytest.raises(PipelineError, match="expected a rim around an opening"):
        nearest_neighbour.coarse(body("tall_cup"), thin.target)
    assert len(from_rows) == len(to_rows) > points


@every_method
def test_the_source_itself_gets_its_labels_back_wherever_it_stands(method):
    source = body("mug")
    target = moved(source, 2.3, 1.0, (0.1, -0.3, 0.0))
    mapped = fit(method, source, target).map_labels(1)
    assert (mapped.cloud.parts == source.parts).mean() > 0.97
    np.testing.assert_array_equal(mapped.cloud.points_m, target.points_m)


@every_method
def test_the_same_seed_gives_the_same_warp(method):
    again = fit(method, body("mug"), body("tall_cup"))
    np.testing.assert_array_equal(again.aligned.points_m, fitted(method).aligned.points_m)
    np.testing.assert_array_equal(again.target_index, fitted(method).target_index)


@every_method
def test_a_warp_is_what_it_was_after_saving(method, tmp_path):
    warp = fitted(method)
    files.save(tmp_path / "warp.npz", warp)
    loaded = files.load(tmp_path / "warp.npz", warp.source, warp.target)
    assert (loaded.method, loaded.diagnostics) == (warp.method, warp.diagnostics)
    assert loaded.target_frame.rim_low_m == warp.target_frame.rim_low_m
    assert loaded.target_frame.roll_observable is warp.target_frame.roll_observable
    np.testing.assert_array_equal(loaded.aligned.points_m, warp.aligned.points_m)
    np.testing.assert_array_equal(loaded.map_labels(3).cloud.parts, warp.map_labels(3).cloud.parts)
    with pytest.raises(PipelineError, match=r"warp\.npz: expected the warp of clouds of 500 and 2000 points"):
        files.load(tmp_path / "warp.npz", cloud("mug", 500), warp.target)


def test_a_file_that_holds_no_warp_is_named(tmp_path):
    np.savez(tmp_path / "warp.npz", points=np.zeros(2))
    with pytest.raises(PipelineError, match=r"warp\.npz: expected a warp, found arrays without"):
        files.load(tmp_path / "warp.npz", body("mug"), body("mug"))
