import numpy as np
import pandas as pd
import pytest
from conftest import sampled

from pipeline.artefacts import normals, points, read_table, write_table
from pipeline.errors import PipelineError
from pipeline.geometry.frames import rotation_about
from pipeline.parametrise.__main__ import SCALARS
from pipeline.parametrise.parameters import CLOUD_PIECES, PARAMETERS, evaluate
from pipeline.scan.shapes import NAMES, shape


def pieces(table: pd.DataFrame, scale: float = 1.0, yaw_rad: float = 0.0) -> dict:
    R = rotation_about(np.array([0.0, 0.0, 1.0]), yaw_rad)
    container, rim = table[table["container"]], table[table["rim"]]
    return {
        "points_m": scale * points(table) @ R.T,
        "container_m": scale * points(container) @ R.T,
        "container_normals": normals(container) @ R.T,
        "container_area_m2": scale**2 * container["area_m2"].to_numpy(),
        "rim_m": scale * points(rim) @ R.T,
        "hull_points": 5000,
    }


@pytest.mark.parametrize("name", NAMES)
def test_parameters_of_the_demonstration_objects(name):
    values, body = evaluate([*SCALARS, "opening_m"], pieces(sampled(name))), shape(name)
    assert values["height_m"] == pytest.approx(body.height_m, rel=0.02)
    assert values["volume_m3"] == pytest.approx(body.hull_volume_m3, rel=0.03)
    assert values["capacity_m3"] == pytest.approx(body.capacity_m3, rel=0.04)
    # The rim's band lies up to 4 mm below its edge, on either side of it.
    assert body.height_m - 0.004 < values["opening_m"][2] < body.height_m


def test_tilt_reference_of_a_cup_is_that_of_its_cylinder():
    # A cylinder is half above its lip when the plane through the lip passes the middle of its axis.
    values, body = evaluate(["tilt_reference_rad"], pieces(sampled("short_cup"))), shape("short_cup")
    outer_radius_m = np.abs(body.vertices_m[:, 0]).max()
    assert np.degrees(values["tilt_reference_rad"]) == pytest.approx(
        np.degrees(np.arctan2(body.height_m / 2, outer_radius_m)), abs=4.0
    )


@pytest.mark.parametrize(("scale", "yaw_rad"), [(0.5, 1.0), (2.0, -2.0)])
def test_parameters_scale_with_the_object(scale, yaw_rad):
    table = sampled("mug")
    here, there = (
        evaluate([*SCALARS, "tilt_references_rad"], p) for p in (pieces(table), pieces(table, scale, yaw_rad))
    )
    for name, power in {"radius_m": 1, "height_m": 1, "volume_m3": 3, "capacity_m3": 3}.items():
        assert there[name] == pytest.approx(scale**power * here[name], rel=0.005), name
    np.testing.assert_allclose(there["tilt_references_rad"], here["tilt_references_rad"], atol=0.03)


def test_the_lip_of_a_jug_is_its_spout():
    body = shape("jug")
    spout = body.lip_edge_m[np.argmin(body.lip_edge_m[:, 2])]
    lip = evaluate(["lip_m"], pieces(sampled("jug")))["lip_m"]
    between = np.arctan2(*lip[1::-1]) - np.arctan2(*spout[1::-1])
    assert abs((np.degrees(between) + 180) % 360 - 180) < 15


def test_every_parameter_is_documented_and_builds_on_what_there_is():
    import inspect

    for function in PARAMETERS.values():
        assert function.__doc__
        assert set(inspect.signature(function).parameters) <= {*PARAMETERS, *CLOUD_PIECES}


def test_an_unknown_parameter_is_refused_by_name():
    with pytest.raises(PipelineError, match="'weight_kg' is unknown"):
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
