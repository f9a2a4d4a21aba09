"""What robust point matching and the space of shapes find where the right deformation is known."""

from dataclasses import replace

import numpy as np
import pytest
from warp.bodies import cloud, moved

from pipeline.errors import PipelineError
from pipeline.warp import files, nearest_neighbour, shape_space, tps_rpm
from pipeline.warp.clouds import Cloud
from pipeline.warp.quality import quality
from pipeline.warp.warp import Warp

POINTS = 3000


def off_surface_m(warp: Warp) -> float:
    """Return how far the aligned source is from the target's surface, in mean along the target's normals."""
    index = warp.target_index[warp.valid]
    apart_m = warp.target.points_m[index] - warp.aligned.points_m[warp.valid]
    return float(np.mean(np.abs(np.einsum("nc,nc->n", apart_m, warp.target.normals[index]))))


def rng() -> np.random.Generator:
    return np.random.default_rng(2)


def bellied(cup: Cloud, share: float, height: float = 1.0) -> Cloud:
    """Return a cup that is wider half way up by a share, and higher."""
    top_m = cup.points_m[:, 2].max()
    z = cup.points_m[:, 2] / top_m
    wider, slope = 1.0 + share * np.sin(np.pi * z), share * np.cos(np.pi * z) * np.pi / top_m
    points_m = cup.points_m * np.column_stack([wider, wider, np.full(len(z), height)])
    # The inverse transpose of the map's derivative, times its determinant over `wider`.
    across = height * cup.normals[:, :2]
    along = wider * cup.normals[:, 2] - slope * np.einsum("nc,nc->n", cup.points_m[:, :2], cup.normals[:, :2])
    normals = np.column_stack([across, along])
    return replace(cup, points_m=points_m, normals=normals / np.linalg.norm(normals, axis=1, keepdims=True))


def astray_m(warp: Warp, target: Cloud) -> float:
    """Return how far points are from where they belong, as a root mean square."""
    return float(np.sqrt(np.mean(np.sum((warp.aligned.points_m - target.points_m) ** 2, axis=1))))


def test_every_point_is_shared_out_once_at_most():
    here, there = rng().normal(size=(40, 3)), rng().normal(size=(60, 3))
    match = tps_rpm.correspondence(here, there, 0.5)
    assert (match >= 0.0).all()
    assert match.sum(axis=1).max() <= 1.0
    # Columns are brought to their sum before rows are: what is left over is small.
    assert match.sum(axis=0).max() <= 1.2 * 40 / 60


def test_a_point_far_from_all_others_has_no_counterpart():
    here = np.vstack([np.eye(3), [[9.0, 9.0, 9.0]]])
    match = tps_rpm.correspondence(here, np.eye(3) + 0.01, 0.1)
    assert match[3].sum() < 1e-6
    np.testing.assert_array_equal(match[:3].argmax(axis=1), [0, 1, 2])
    assert np.diag(match).min() > 0.9


def test_robust_point_matching_finds_a_belly():
    cup = cloud("mug", POINTS)
    target = moved(bellied(cup, 0.25), 0.8, 1.0, (0.1, 0.0, 0.0))
    before = nearest_neighbour.coarse(cup, target)
    after = tps_rpm.fit(cup, target, rng=rng())
    # Along the surface points may slide: a mug without its handle is the same all round.
    assert off_surface_m(after) < 0.6 * off_surface_m(before)


def shapes(cup: Cloud) -> list[np.ndarray]:
    """Return a cup's points on cups with other bellies and heights, as examples."""
    found = []
    for share, height in ((0.4, 1.0), (-0.2, 1.0), (0.0, 1.5), (0.3, 0.7)):
        other = bellied(cup, share, height)
        warp = nearest_neighbour.coarse(cup, other)
        scale = np.linalg.norm(warp.source_frame.spread_m) / np.linalg.norm(warp.target_frame.spread_m)
        T = warp.target_frame.T_object_part
        found.append((other.points_m - T[:3, 3]) @ T[:3, :3] * scale)
    return found


def test_a_shape_between_those_that_were_learnt_is_found_wherever_it_stands():
    cup = cloud("mug", POINTS)
    target = moved(bellied(cup, 0.2, 1.2), 2.0, 1.4, (0.1, -0.2, 0.0))
    warp = shape_space.fit(cup, target, rng=rng(), examples=shapes(cup))
    assert warp.diagnostics["components"] == 4.0
    assert astray_m(warp, target) < 0.2 * astray_m(nearest_neighbour.coarse(cup, target), target)
    assert quality(warp, warp.map_labels(1))["residual_m"] < 0.001


def test_examples_of_files_are_those_of_warps(tmp_path):
    cup, other = cloud("mug", 1000), cloud("tumbler", 1000)
    warp = nearest_neighbour.fit(cup, other, rng=rng())
    files.save(tmp_path / "warp.npz", warp)
    read = files.load_example(tmp_path / "warp.npz", cup)
    expected = shape_space.example(cup, warp.deformation, warp.source_frame, warp.target_frame)
    np.testing.assert_array_equal(read, expected)
    # At the source's size, about the middle of the container.
    assert read[cup.parts[:, 0]].std(axis=0) == pytest.approx(warp.source_frame.spread_m, rel=0.5)
    with pytest.raises(
        PipelineError, match="expected a warp of mug with its 500 points, found one of a source of 1000"
    ):
        files.load_example(tmp_path / "warp.npz", cloud("mug", 500))


def test_a_space_of_no_shapes_is_refused():
    cup = cloud("mug", 500)
    with pytest.raises(
        PipelineError, match="tumbler: expected objects beside it and mug to learn shapes from"
    ):
        shape_space.fit(cup, cloud("tumbler", 500), rng=rng(), examples=[])
