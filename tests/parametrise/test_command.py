"""The commands of the stage, as the workflow calls them."""

import re
import subprocess
import sys

import numpy as np
import pytest
from conftest import sampled

from pipeline.artefacts import read_table, write_table


@pytest.fixture(scope="module")
def mapping(tmp_path_factory):
    path = tmp_path_factory.mktemp("warp") / "mapping.parquet"
    rows = range(len(sampled("short_cup")))
    table = sampled("short_cup").assign(source_index=rows, target_index=rows, valid=True)
    names = ["x_m", "y_m", "z_m", "nx", "ny", "nz", "area_m2", "container", "rim", "handle"]
    write_table(path, table[[*names, "source_index", "target_index", "valid"]], "mapping")
    return path


def _call(module: str, mapping, *arguments: str) -> subprocess.CompletedProcess:
    given = ["--object", "short_cup", "--point-mapping", str(mapping), "--label-mapping", str(mapping)]
    return subprocess.run(
        [sys.executable, "-m", module, *given, *arguments], capture_output=True, text=True, check=False
    )


def test_uncertainties_are_the_same_bytes_again(mapping, tmp_path):
    listed = ["--redraws", "3", "--hull-points", "500", "--parameters", "radius_m", "spout_direction"]
    paths = [tmp_path / name for name in ("one.parquet", "two.parquet")]
    for path in paths:
        told = _call("pipeline.parametrise.uncertainty", mapping, "--uncertainties", str(path), *listed)
        assert told.returncode == 0, told.stderr
    assert paths[0].read_bytes() == paths[1].read_bytes()
    table = read_table(paths[0], "uncertainties")
    assert list(table["parameter"]) == ["radius_m", "spout_direction_x", "spout_direction_y"] * 2
    assert (table["std"] > 0.0).all()


def test_a_typo_is_refused_in_one_sentence_and_nothing_is_written(mapping, tmp_path):
    path = tmp_path / "out.parquet"
    told = _call(
        "pipeline.parametrise.uncertainty", mapping, "--uncertainties", str(path), "--parameters", "radus_m"
    )
    assert told.returncode == 1
    assert told.stderr.startswith("error: parameter 'radus_m' is unknown")
    assert told.stderr.count("\n") == 1
    assert not path.exists()


def test_an_object_whose_wall_shows_one_side_has_every_parameter_but_that(mapping, tmp_path):
    table = read_table(mapping, "mapping")
    inward = -(table[["x_m", "y_m"]] - table[["x_m", "y_m"]].mean())
    table[["nx", "ny", "nz"]] = 0.0
    table[["nx", "ny"]] = (inward.T / np.hypot(*inward.to_numpy().T)).T.to_numpy()
    one_sided, path = tmp_path / "mapping.parquet", tmp_path / "parameters.parquet"
    write_table(one_sided, table, "mapping")
    written = ["--parameters", str(path), "--tilt-references", str(tmp_path / "tilts.parquet")]
    told = _call("pipeline.parametrise", one_sided, "--hull-points", "500", *written)
    assert told.returncode == 0, told.stderr
    assert told.stderr == ""
    found = read_table(path, "parameters").set_index("mapping")
    assert found["wall_m"].isna().all()
    assert found.drop(columns="wall_m").notna().all(axis=None)


def test_what_the_mappings_do_not_agree_on_is_told(mapping, tmp_path):
    wide = read_table(mapping, "mapping").assign(y_m=lambda table: 1.3 * table["y_m"])
    other, paths = tmp_path / "mapping.parquet", [str(tmp_path / name) for name in ("p.parquet", "t.parquet")]
    write_table(other, wide, "mapping")
    written = ["--parameters", paths[0], "--tilt-references", paths[1]]
    alike = _call("pipeline.parametrise", mapping, *written)
    assert (alike.returncode, alike.stderr) == (0, "")
    told = _call("pipeline.parametrise", mapping, *written, "--source", "mug", "--point-mapping", str(other))
    assert told.returncode == 0
    (line,) = told.stderr.splitlines()
    assert re.fullmatch(
        r"short_cup: expected point and label mapping to agree within 10%, found radius \d+ and \d+ mm, "
        r"hull volume \d+ and \d+ ml, capacity \d+ and \d+ ml: perhaps it has little of the shape of mug; "
        r"label mapping is then the nearer, .*",
        line,
    )
