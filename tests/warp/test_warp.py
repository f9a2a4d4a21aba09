from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from warp.bodies import cloud, iou, moved

from pipeline.parametrise.cloud import warped
from pipeline.parametrise.parameters import evaluate
from pipeline.warp.clouds import Cloud, Mapped
from pipeline.warp.methods import fit as fit_by
from pipeline.warp.nearest import agreeing_neighbours, majority_of_neighbours
from pipeline.warp.quality import quality
from pipeline.warp.stretch import between_extents, linear
from pipeline.warp.warp import Warp


def fit(source: Cloud, target: Cloud, refinements: int, bends: int = 0) -> Warp:
    own = {"refinements": refinements, "bends": bends}
    return fit_by("nearest_neighbour", source, target, rng=np.random.default_rng(0), **own)


def test_the_stretch_gives_the_container_the_target_s_variances():
    source, target = cloud("mug"), cloud("wide_bowl")
    warp = fit(source, target, refinements=0)
    frame = warp.target_frame.T_object_part
    spread = ((warp.aligned.points_m[source.parts[:, 0]] - frame[:3, 3]) @ frame[:3, :3]).std(axis=0)
    np.testing.assert_allclose(spread, warp.target_frame.spread_m, rtol=1e-6)


def test_a_kept_rim_is_moved_not_stretched():
    stretch = between_extents(np.array([0.0, 0.1]), np.array([0.0, 0.05]), 0.004, np.ones(3))
    heights = np.array([[0.0, 0, 0], [0.096, 0, 0], [0.1, 0, 0]])
    np.testing.assert_allclose(stretch.map(heights)[:, 0], [0.0, 0.046, 0.05])
    np.testing.assert_allclose(stretch.factors(heights)[[0, 2], 0], [0.046 / 0.096, 1.0])


@pytest.mark.parametrize("refinements", [0, 5])
@pytest.mark.parametrize(("yaw_rad", "scale"), [(0.0, 1.0), (2.3, 0.5), (-1.1, 2.0), (0.4, 1.3)])
def test_the_same_object_moved_and_scaled_gets_its_labels_back(yaw_rad, scale, refinements):
    source = cloud("mug")
    target = moved(source, yaw_rad, scale, (0.1, -0.3, 0.0))
    mapped = fit(source, target, refinements=refinements, bends=refinements // 5).map_labels(1)
    assert (mapped.cloud.parts == source.parts).mean() > 0.999
    assert (mapped.source_index == np.arange(len(source.points_m))).mean() > 0.999


@settings(max_examples=6, deadline=None, derandomize=True)
@given(
    name=st.sampled_from(["espresso_cup", "jug", "square_bowl", "tall_cup", "wide_bowl"]),
    yaw_rad=st.floats(-3.1, 3.1),
    x_m=st.floats(-0.3, 0.3),
)
def test_labels_and_parameters_do_not_depend_on_where_the_target_stands(name, yaw_rad, x_m):
    source, target = cloud("mug", 3000), cloud(name, 3000)
    here, there = (
        fit(source, body, refinements=5, bends=1).map_labels(1)
        for body in (target, moved(target, yaw_rad, 1.0, (x_m, -x_m, 0.0)))
    )
    assert (here.cloud.parts == there.cloud.parts).all(axis=1).mean() > 0.999
    before, after = (read_off(mapped) for mapped in (here, there))
    for parameter, value in before.items():
        assert after[parameter] == pytest.approx(value, rel=0.02), parameter


@settings(max_examples=6, deadline=None, derandomize=True)
@given(scale=st.floats(0.5, 2.0), yaw_rad=st.floats(-3.1, 3.1))
def test_parameters_scale_with_the_object(scale, yaw_rad):
    source = cloud("mug", 3000)
    here, there = (
        fit(source, body, refinements=5, bends=1).map_labels(1)
        for body in (source, moved(source, yaw_rad, scale, (0.2, 0.1, 0.0)))
    )
    np.testing.assert_array_equal(here.cloud.parts, there.cloud.parts)
    powers = {"radius_m": 1, "height_m": 1, "volume_m3": 3, "capacity_m3": 3}
    before, after = (read_off(mapped) for mapped in (here, there))
    for parameter, power in powers.items():
        assert after[parameter] == pytest.approx(before[parameter] * scale**power, rel=5e-3), parameter


def read_off(mapped: Mapped) -> dict[str, float]:
    body = mapped.cloud
    table = pd.DataFrame(
        np.hstack([body.points_m, body.normals]), columns=["x_m", "y_m", "z_m", "nx", "ny", "nz"]
    )
    container, rim = body.parts[:, 0], body.parts[:, 1]
    table = table.assign(
        area_m2=body.area_m2, container=container, rim=rim, handle=body.parts[:, 2], valid=True
    )
    names = ("radius_m", "height_m", "volume_m3", "capacity_m3")
    values = evaluate(names, warped(table, name="body").pieces(hull_points=1000))
    return {name: values[name] for name in names}


def test_normals_follow_the_inverse_transpose():
    source = cloud("short_cup")
    target = replace(source, points_m=source.points_m * [1.0, 1.0, 0.5])
    aligned = fit(source, target, refinements=0).aligned
    squeezed = source.normals / [1.0, 1.0, 0.5]
    squeezed /= np.linalg.norm(squeezed, axis=1, keepdims=True)
    assert np.einsum("nc,nc->n", aligned.normals, squeezed).min() > 0.999
    # The area of a wall halves, that of a floor stays.
    wall = np.abs(source.normals[:, 2]) < 0.05
    assert (aligned.area_m2 / source.area_m2)[wall].mean() == pytest.approx(0.5, rel=0.01)


@pytest.mark.parametrize("name", ["tall_cup", "tumbler", "espresso_cup", "wide_bowl", "square_bowl"])
def test_rims_are_found_on_other_objects_and_no_wall_is_crossed(name):
    source, target = cloud("mug"), cloud(name)
    warp = fit(source, target, refinements=5, bends=1)
    labels = warp.map_labels(1)
    assert iou(labels.cloud.parts[:, 1], target.parts[:, 1]) > 0.7
    for mapped in (labels, warp.map_cloud(1)):
        scores = quality(warp, mapped)
        assert scores["wall_side_flips"] == scores["share_without_candidate"] == 0.0
        assert scores["residual_m"] < 0.003


@pytest.mark.parametrize("name", ["tumbler", "wide_bowl", "square_bowl"])
def test_a_bend_brings_pairs_nearer_that_no_factors_do(name):
    source, target = cloud("mug"), cloud(name)
    stretched, bent = (fit(source, target, refinements=5, bends=bends) for bends in (0, 1))
    before, after = (quality(warp, warp.map_labels(1))["residual_m"] for warp in (stretched, bent))
    assert after < 0.7 * before


def unseen(target: Cloud) -> Cloud:
    """Return a target as a source without a handle may see it: all is container."""
    return replace(target, parts=target.parts & [True, True, False] | [True, False, False])


def mistaken(target: Cloud) -> Cloud:
    """Return a target as a source without a handle may see it: a handle is as curved as a rim."""
    return replace(unseen(target), parts=unseen(target).parts | (target.parts[:, 2:] & [False, True, False]))


@pytest.mark.parametrize("name", ["mug", "jug", "espresso_cup"])
@pytest.mark.parametrize("source", ["tall_cup", "wide_bowl"])
@pytest.mark.parametrize("seen", [unseen, mistaken])
def test_a_source_without_a_handle_does_not_take_one_for_container(seen, source, name):
    target = cloud(name)
    warp = fit(cloud(source), seen(target), refinements=5, bends=1)
    mapped = warp.map_labels(1).cloud
    wall, handle = target.parts[:, 0], target.parts[:, 2]
    assert handle[warp.target_index[warp.valid]].mean() < 0.01
    assert mapped.parts[wall, 0].mean() > 0.999
    # What is left is the stump, less than a twentieth of the radius off the wall.
    assert mapped.parts[handle].any(axis=1).mean() < 0.2


@pytest.mark.parametrize("name", ["square_bowl", "wide_bowl", "tumbler"])
def test_a_source_without_a_handle_leaves_nothing_out_where_there_is_none(name):
    mapped = fit(cloud("tall_cup"), unseen(cloud(name)), refinements=5, bends=1).map_labels(1).cloud
    assert mapped.parts[:, 0].mean() > 0.999


def test_neighbours_across_the_wall_are_passed_over():
    # A wall of 3 mm: the nearest point is on the other side, and a hundred more are.
    inner = np.column_stack([np.zeros(200), np.linspace(0, 0.1, 200), np.zeros(200)])
    outer = inner + [0.003, 0.0, 0.0]
    facing = np.array([[-1.0, 0.0, 0.0]] * 200 + [[1.0, 0.0, 0.0]] * 200)
    query = np.array([[0.0021, 0.05, 0.0]])
    index, distance = agreeing_neighbours(
        query, np.array([[-1.0, 0.0, 0.0]]), np.vstack([inner, outer]), facing, 3
    )
    assert (index < 200).all()
    assert distance[0, 0] == pytest.approx(0.0021, abs=1e-4)


def test_points_without_any_agreeing_normal_are_marked():
    index, distance = agreeing_neighbours(
        np.zeros((1, 3)), np.eye(3)[:1], np.ones((5, 3)), -np.ones((5, 3)), 2
    )
    assert (index == -1).all()
    assert np.isinf(distance).all()


def test_label_mapping_of_several_neighbours_takes_the_majority():
    labels = np.array([[True], [True], [False]])
    np.testing.assert_array_equal(
        majority_of_neighbours(labels, np.array([[0, 1, 2], [2, 2, 0]]))[:, 0], [True, False]
    )


def test_linear_stretch_scales_about_the_origin():
    np.testing.assert_allclose(
        linear(np.array([2.0, 3.0, 4.0])).map(np.array([[1.0, 1, 1], [-2.0, 0, 1]])), [[2, 3, 4], [-4, 0, 4]]
    )
