import numpy as np
import pytest
from conftest import PARTS, sampled
from scipy.spatial import cKDTree

from pipeline.artefacts import points
from pipeline.errors import PipelineError
from pipeline.label.annotation import transfer_annotation
from pipeline.label.classifier import train
from pipeline.label.features import neighbourhood_features
from pipeline.label.paint import paint, read_strokes

NEIGHBOURS = (30, 60, 150)  # of 6000 points, the shares of the surface that the default takes of 12,000


def features(name: str) -> np.ndarray:
    return neighbourhood_features(points(sampled(name)), NEIGHBOURS)


def test_features_do_not_depend_on_scale_or_pose():
    cloud = points(sampled("mug"))
    turned = 1.7 * cloud @ np.array([[0.0, -1.0, 0.0], [0.6, 0.0, -0.8], [0.8, 0.0, 0.6]]).T + [
        0.3,
        0.1,
        -0.2,
    ]
    np.testing.assert_allclose(neighbourhood_features(turned, NEIGHBOURS), features("mug"), atol=1e-9)


def test_features_of_the_middle_of_a_square():
    grid = np.stack(np.meshgrid(np.arange(9.0), np.arange(9.0), [0.0]), axis=-1).reshape(-1, 3)
    first, second, third, offset = neighbourhood_features(grid, [9])[40]
    # Nine points of a unit grid: variance 2/3 along both sides, the furthest at √2.
    assert first == pytest.approx(np.sqrt(2 / 3) / np.sqrt(2))
    assert second == pytest.approx(first)
    assert third == pytest.approx(0.0, abs=1e-7)
    assert offset == pytest.approx(0.0, abs=1e-9)


def test_parts_of_other_objects_are_found_from_the_source_alone():
    classifier = train(features("mug"), sampled("mug")[PARTS].to_numpy(), ridge=300.0)
    rim = {}
    for name in ("short_cup", "tumbler", "wide_bowl", "jug"):
        found = classifier.probabilities(features(name)) > 0.5
        true = sampled(name)[PARTS].to_numpy()
        rim[name] = (found[true[:, 1], 1].mean() + (~found[~true[:, 1], 1]).mean()) / 2
        if name == "jug":
            assert (found[true[:, 2], 2].mean() + (~found[~true[:, 2], 2]).mean()) / 2 > 0.85
    assert min(rim.values()) > 0.8, rim
    assert np.mean(list(rim.values())) > 0.9, rim


def test_features_are_those_of_each_point_s_own_neighbours():
    points_m = points(sampled("jug"))
    found = neighbourhood_features(points_m, NEIGHBOURS)
    tree = cKDTree(points_m)
    for row in range(0, len(points_m), 97):
        expected = []
        for k in NEIGHBOURS:
            distance_m, near = tree.query(points_m[row], k=k)
            around_m = points_m[near] - points_m[row]
            spread = np.sqrt(np.linalg.eigvalsh(np.cov(around_m.T, bias=True))[::-1])
            expected += [*spread / distance_m[-1], np.linalg.norm(around_m.mean(axis=0)) / distance_m[-1]]
        np.testing.assert_allclose(found[row], expected, rtol=1e-9, atol=1e-12)


def test_a_part_that_the_source_lacks_is_never_found():
    parts = sampled("short_cup")[PARTS].to_numpy()
    assert (train(features("short_cup"), parts, 300.0).probabilities(features("mug"))[:, 2] == 0.0).all()


def test_annotation_is_carried_to_the_nearest_points():
    cloud = sampled("mug")
    carried = transfer_annotation(points(cloud)[::2], cloud[PARTS].to_numpy()[::2], points(cloud), name="mug")
    assert (carried == cloud[PARTS].to_numpy()).mean() > 0.97


def test_borders_of_a_coarse_annotation_run_straight_between_its_points():
    points_m = points(sampled("mug"))
    band = np.column_stack(
        [points_m[:, 2] < 0.05, np.abs(points_m[:, 2] - 0.091) < 0.004, points_m[:, 0] > 0.02]
    )
    painted_m, painted = points_m[::4], band[::4]
    carried = transfer_annotation(painted_m, painted, points_m, name="mug")
    nearest = painted[cKDTree(painted_m).query(points_m)[1]]
    assert (carried != band).sum() < 0.75 * (nearest != band).sum()
    # Neither wider nor narrower than they were painted.
    assert carried.sum(axis=0) == pytest.approx(band.sum(axis=0), rel=0.05)


@pytest.mark.parametrize("painted", [1, 3])
def test_an_annotation_of_few_points_is_carried_too(painted):
    painted_m = np.array([[0.0, 0.0, 0.0], [0.001, 0.0, 0.0], [0.001, 0.0, 0.0]])[:painted]
    parts = np.array([[True, False, False], [True, True, False], [True, True, False]])[:painted]
    carried = transfer_annotation(
        painted_m, parts, np.array([[-0.001, 0.0, 0.0], [0.002, 0.0, 0.0]]), name="mug"
    )
    np.testing.assert_array_equal(carried, parts[[0, -1]])


def test_annotation_of_another_scan_is_refused():
    cloud = sampled("mug")
    with pytest.raises(PipelineError, match=r"annotation\.parquet.*0\.[0-9]+ m away"):
        transfer_annotation(
            points(cloud) + 0.2, cloud[PARTS].to_numpy(), points(cloud), name="annotation.parquet"
        )


def test_the_last_box_that_holds_a_point_gives_its_parts(tmp_path):
    path = tmp_path / "strokes.yaml"
    path.write_text(
        "- {parts: [container], low_m: [0, 0, 0], high_m: [1, 1, 1]}\n"
        "- {parts: [container, rim], low_m: [0, 0, 0.9], high_m: [1, 1, 1]}\n"
    )
    found = paint(np.array([[0.5, 0.5, 0.5], [0.5, 0.5, 0.95], [2.0, 0.0, 0.0]]), read_strokes(path))
    np.testing.assert_array_equal(found, [[True, False, False], [True, True, False], [False, False, False]])


def test_strokes_with_an_unknown_part_are_refused_by_file(tmp_path):
    path = tmp_path / "strokes.yaml"
    path.write_text("- {parts: [lid], low_m: [0, 0, 0], high_m: [1, 1, 1]}\n")
    with pytest.raises(PipelineError, match=r"strokes\.yaml.*lid"):
        read_strokes(path)
