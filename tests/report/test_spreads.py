"""How parameters spread: over k and over sources as standard deviations of what the tables say, beside redraws and errors."""

import numpy as np
import pandas as pd
import pytest

from pipeline.artefacts import write_table
from pipeline.report.sources import ERRORS
from pipeline.report.spreads import QUANTITIES, draw_spreads, spread_numbers, spreads
from pipeline.schemas import TABLES

NAMES = ["cup", "jug"]


def _table(path, radius_m: float, opening_x_m: float = 0.0) -> None:
    row = dict.fromkeys(TABLES["parameters"].names, 1.0) | {"object": path.stem}
    rows = [{**row, "mapping": "label_mapping"} | {"radius_m": radius_m, "opening_x_m": opening_x_m}]
    rows += [{**row, "mapping": "point_mapping", "radius_m": 77.0}]
    write_table(path, pd.DataFrame(rows), "parameters")


@pytest.fixture
def processed(tmp_path):
    folder = tmp_path / "parametrise"
    for target in NAMES:
        for source, radius_m in (("cup", 0.040), ("jug", 0.042)):
            _table(folder / source / f"{target}.parquet", radius_m)
        for by, x_m in (("near_k1", 0.001), ("near_k5", 0.003)):
            _table(folder / "cup/by" / by / f"{target}.parquet", 0.040, x_m)
        listed = {"parameter": ["radius_m", "radius_m"], "value": 0.04, "std": [0.0004, 9.0], "unit": "m"}
        listed |= {"object": target, "mapping": ["label_mapping", "point_mapping"]}
        path = folder / "cup/uncertainties" / f"{target}.parquet"
        write_table(path, pd.DataFrame(listed), "uncertainties")
    return tmp_path


def found(processed) -> dict:
    errors = {key: np.array([[0.01, 0.02], [0.5, 0.5]]) for key in ERRORS}
    return spreads(processed, "cup", NAMES, ["near_k1", "near_k5"], errors)


def test_spreads_are_those_of_label_mapping_in_the_units_of_errors(processed):
    jug = found(processed)["jug"]
    assert jug["redraws"] == {"radius": pytest.approx(0.01)}  # the others are not listed
    assert jug["sources"]["radius"] == pytest.approx(np.std([0.040, 0.042], ddof=1) / 0.041)
    assert jug["k"]["radius"] == 0.0
    assert jug["k"]["opening_mm"] == pytest.approx(np.std([1.0, 3.0], ddof=1))
    assert jug["error"]["height"] == 0.02  # that of the first source


def test_numbers_and_page_say_the_same(processed):
    flat = spread_numbers(found(processed))
    assert flat["sources.spread.jug.opening_mm.k"] == pytest.approx(np.sqrt(2.0))
    assert "sources.spread.jug.height.redraws" not in flat
    axes = dict(zip(QUANTITIES, draw_spreads(found(processed), "cup", ["1", "5"]).axes, strict=True))
    shown = [text.get_text() for text in axes["opening_mm"].texts]
    assert shown == ["–", "–", "1.41", "1.41", "0.00", "0.00", "0.01", "0.02"]
    rows = [label.get_text() for label in axes["radius"].get_yticklabels()]
    assert rows == ["points redrawn", "k of 1, 5", "2 sources", "error"]
