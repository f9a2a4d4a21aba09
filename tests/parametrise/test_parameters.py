import inspect

import numpy as np
import pandas as pd
import pytest
from conftest import sampled
from parametrise.clouds import cloud

from pipeline.artefacts import read_table, write_table
from pipeline.errors import PipelineError
from pipeline.geometry.cavity import TIE_M, cavity, pour_axis, retained_volume_m3
from pipeline.geometry.frames import rotation_about
from pipeline.parametrise.cloud import PIECES, evened
from pipeline.parametrise.inside import GRID_DEG
from pipeline.parametrise.library import parameter
from pipeline.parametrise.parameters import INGREDIENTS, PARAMETERS, evaluate, numbers
from pipeline.scan.shapes import NAMES, shape

HULL_POINTS = 5000
LENGTHS = ("opening_m", "radius_m", "height_m", "wall_m", "spout_depth_m")
VOLUMES = ("volume_m3", "capacity_m3", "retained_m3")
ANGLES = ("tilt_reference_rad", "tilt_reference_cavity_rad", "stability_rad")


def found(names, name: str, **how) -> dict:
    return evaluate(names, cloud(name, **how).pieces(HULL_POINTS))


@pytest.mark.parametrize("name", NAMES)
def test_parameters_of_the_demonstration_objects(name):
    values, body = found([*LENGTHS, *VOLUMES], name), shape(name)
    assert values["height_m"] == pytest.approx(body.height_m, abs=0.0007)  # noise of 0.1 mm at both ends
    assert values["volume_m3"] == pytest.approx(body.hull_volume_m3, rel=0.01)
    assert values["capacity_m3"] == pytest.approx(body.capacity_m3, rel=0.02)
    assert values["wall_m"] == pytest.approx(body.wall_m, rel=0.05)
    # The rim's band lies up to 4 mm below its edge, on either side of it.
    assert body.height_m - 0.004 < values["opening_m"][2] < body.height_m


@pytest.mark.parametrize("name", ["mug", "jug", "square_bowl"])
def test_what_is_kept_when_tilted_is_what_hydrostatics_says_of_the_true_cavity(name):
    body, values = shape(name), found(["retained_m3", "tilt_reference_cavity_rad", "lip_m"], name)
    cup = cavity(body.vertices_m, body.triangles, name=name)
    lip = cup.rim_m[np.argmin(np.linalg.norm(cup.rim_m - values["lip_m"], axis=1))]
    axis = pour_axis(cup.opening_m, lip)
    true = retained_volume_m3(cup, lip, axis, np.radians(GRID_DEG))
    np.testing.assert_allclose(values["retained_m3"], true, atol=0.02 * body.capacity_m3)
    assert np.all(np.diff(values["retained_m3"]) <= 0.0)
    half = retained_volume_m3(cup, lip, axis, values["tilt_reference_cavity_rad"])
    assert half == pytest.approx(cup.capacity_m3 / 2, rel=0.03)


def test_tilt_reference_of_a_cup_is_that_of_its_cylinder():
    # A cylinder is half above its lip when the plane through the lip passes the middle of its axis.
    values, body = found(["tilt_reference_rad"], "short_cup"), shape("short_cup")
    outer_radius_m = np.abs(body.vertices_m[:, 0]).max()
    assert np.degrees(values["tilt_reference_rad"]) == pytest.approx(
        np.degrees(np.arctan2(body.height_m / 2, outer_radius_m)), abs=4.0
    )


def test_a_round_cup_tips_where_its_middle_is_above_the_edge_of_its_foot():
    # Centre of mass of an empty shell: the mean of its surface; the foot has the radius that the mesh has on the table.
    body, values = shape("tumbler"), found(["stability_rad"], "tumbler")
    corners = body.vertices_m[body.triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    height = (area @ corners.mean(axis=1)[:, 2]) / area.sum()
    foot = np.hypot(*body.vertices_m[body.vertices_m[:, 2] < 0.0015, :2].T).max()
    assert values["stability_rad"] == pytest.approx(np.arctan2(foot, height), rel=0.05)


@pytest.mark.parametrize(("scale", "yaw_rad"), [(0.5, 1.0), (2.0, -2.0)])
def test_parameters_scale_and_turn_with_the_object(scale, yaw_rad):
    names = [*LENGTHS, *VOLUMES, *ANGLES, "tilt_references_rad"]
    here, there = found(names, "mug"), found(names, "mug", scale=scale, yaw_rad=yaw_rad)
    for name in ("radius_m", "height_m", "wall_m"):
        assert there[name] == pytest.approx(scale * here[name], rel=0.005), name
    for name in ("volume_m3", "capacity_m3"):
        assert there[name] == pytest.approx(scale**3 * here[name], rel=0.005), name
    assert np.linalg.norm(there["opening_m"][:2]) == pytest.approx(
        scale * np.linalg.norm(here["opening_m"][:2]), abs=2e-4
    )
    np.testing.assert_allclose(there["tilt_references_rad"], here["tilt_references_rad"], atol=0.03)


def test_the_opening_does_not_move_when_a_part_of_the_rim_has_more_points():
    body, rim_m = shape("short_cup"), cloud("short_cup").pieces(HULL_POINTS)["rim_m"]
    denser = np.vstack([rim_m, np.repeat(rim_m[rim_m[:, 0] > 0.0], 4, axis=0)])
    for points_m in (rim_m, denser):
        values = evaluate(["opening_m", "radius_m"], {"rim_m": points_m})
        assert np.linalg.norm(values["opening_m"][:2] - body.lip_edge_m[:, :2].mean(axis=0)) < 5e-4
    assert np.linalg.norm(denser.mean(axis=0)[:2]) > 5e-3  # the plain mean does


def test_the_lip_of_a_jug_is_its_spout():
    body = shape("jug")
    spout = body.lip_edge_m[np.argmin(body.lip_edge_m[:, 2])]
    values = found(["lip_m", "spout_direction", "spout_depth_m"], "jug")
    for direction in (values["lip_m"], values["spout_direction"]):
        between = np.arctan2(*direction[1::-1]) - np.arctan2(*spout[1::-1])
        assert abs((np.degrees(between) + 180) % 360 - 180) < 15
    heights = body.lip_edge_m[:, 2]
    assert values["spout_depth_m"] == pytest.approx(np.median(heights) - heights.min(), abs=1e-3)
    assert found(["spout_depth_m"], "tall_cup")["spout_depth_m"] < 0.001


@pytest.mark.parametrize("points", [24, 45, 90, 180, 360, 400, 720])
def test_what_is_read_off_a_regular_rim_turns_with_it(points):
    names = ["contour_m", "opening_m", "radius_m", "spout_depth_m"]
    azimuth = np.arange(points) * 2 * np.pi / points
    rim_m = np.column_stack([0.04 * np.cos(azimuth), 0.04 * np.sin(azimuth), np.full(points, 0.1)])
    here = evaluate(names, {"rim_m": rim_m})
    assert here["spout_depth_m"] == pytest.approx(0.0, abs=1e-9)
    for yaw_deg in (1.0, 7.3, 45.0, 90.0, 123.4, 200.0, 359.0):
        R = rotation_about(np.array([0.0, 0.0, 1.0]), np.radians(yaw_deg))
        there = evaluate(names, {"rim_m": rim_m @ R.T})
        for name in names[:2]:
            np.testing.assert_allclose(there[name], here[name] @ R.T, atol=1e-9, err_msg=f"{name} {yaw_deg}")
        for name in names[2:]:
            assert there[name] == pytest.approx(here[name], abs=1e-9), (name, yaw_deg)


def test_a_wall_of_which_one_side_is_seen_or_no_two_points_are_opposite_has_no_thickness():
    pieces = cloud("short_cup").pieces(HULL_POINTS)
    container_m, inner = pieces["container_m"], evaluate(["inner", "opening_m"], pieces)["inner"]
    assert inner.any()
    assert not inner.all()
    up = np.tile([0.0, 0.0, 1.0], (len(inner), 1))
    for normals, sides in (
        (pieces["container_normals"], np.ones_like(inner)),
        (pieces["container_normals"], np.zeros_like(inner)),
        (up, inner),
    ):
        given = {"container_m": container_m, "container_normals": normals, "inner": sides}
        assert np.isnan(evaluate(["wall_m"], given)["wall_m"])


@pytest.mark.parametrize("points", [4000, 6000, 12000])
@pytest.mark.parametrize("name", NAMES)
def test_a_rim_is_level_or_spouted_however_dense_its_points(name, points):
    table, heights_m = sampled(name, points), shape(name).lip_edge_m[:, 2]
    rim_m = table.loc[table["rim"], ["x_m", "y_m", "z_m"]].to_numpy()
    depth_m = evaluate(["spout_depth_m"], {"rim_m": rim_m})["spout_depth_m"]
    # Tops of a few points lie below the edge, here more and there less: by less than half of what makes a spout.
    assert depth_m == pytest.approx(np.median(heights_m) - heights_m.min(), abs=TIE_M / 2)
    assert (depth_m > TIE_M) == (name == "jug")


def test_every_parameter_is_documented_named_by_its_unit_and_builds_on_what_there_is():
    for name, function in {**{n: p.function for n, p in PARAMETERS.items()}, **INGREDIENTS}.items():
        assert function.__doc__, name
        assert set(inspect.signature(function).parameters) <= {*PARAMETERS, *INGREDIENTS, *PIECES}, name
    assert numbers(["opening_m"], {"opening_m": np.array([1.0, 2.0, 3.0])}) == {
        "opening_x_m": 1.0,
        "opening_y_m": 2.0,
        "opening_z_m": 3.0,
    }


def test_one_function_is_a_new_parameter():
    try:

        @parameter("m")
        def girth_m(radius_m: float) -> float:
            """Length of the rim: 2πr."""
            return 2 * np.pi * radius_m

        values = found(["girth_m"], "mug")
        assert numbers(["girth_m"], values)["girth_m"] == pytest.approx(2 * np.pi * values["radius_m"])
    finally:
        del PARAMETERS["girth_m"]


def test_a_parameter_without_its_unit_in_its_name_is_refused():
    with pytest.raises(PipelineError, match="ends with its unit, _m"):
        parameter("m")(lambda rim_m: 0.0)


def test_an_unknown_parameter_is_refused_by_name():
    with pytest.raises(PipelineError, match=r"'weight_kg' is unknown; correct parametrise\.parameters"):
        evaluate(["weight_kg"], {})


def test_a_table_with_a_missing_column_is_refused_and_nothing_is_written(tmp_path):
    path = tmp_path / "labels.parquet"
    with pytest.raises(PipelineError, match="missing: p_rim"):
        write_table(path, sampled("mug").drop(columns="p_rim"), "labels")
    assert list(tmp_path.iterdir()) == []
    write_table(path, sampled("mug"), "labels")
    pd.testing.assert_frame_equal(
        read_table(path, "labels")[list(sampled("mug"))], sampled("mug"), check_dtype=False
    )


def test_a_truncated_table_is_refused_by_file(tmp_path):
    path = tmp_path / "labels.parquet"
    write_table(path, sampled("mug"), "labels")
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(PipelineError, match=r"labels\.parquet: expected a Parquet table"):
        read_table(path, "labels")


def test_points_that_many_were_mapped_to_stay_where_they_are():
    body = cloud("short_cup")
    points_m, normals = body.points_m[body.container], body.normals[body.container]
    twice = np.repeat(np.arange(0, len(points_m), 40), 60)
    np.testing.assert_allclose(evened(points_m[twice], normals[twice]), points_m[twice], atol=1e-4)
