import subprocess
import sys

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from pipeline.artefacts import read_columns, read_table, write_table
from pipeline.columns import to_numpy
from pipeline.errors import PipelineError

N = 1001  # no multiple of the eight truths in a byte
RNG = np.random.default_rng(0)
MAPPING = {
    **{name: RNG.normal(size=N) for name in ("x_m", "y_m", "z_m", "nx", "ny", "nz", "area_m2")},
    **{name: RNG.uniform(size=N) > 0.5 for name in ("container", "rim", "handle", "valid")},
    **{name: RNG.integers(-1, 12000, N) for name in ("source_index", "target_index")},
}
MAPPING["x_m"][[0, 500]] = np.nan
REFERENCES = {
    **{name: ["mug", "tasse à café", ""] for name in ("object", "mapping")},
    **{name: np.zeros(3) for name in ("x_m", "y_m", "z_m", "tilt_reference_rad")},
}


@pytest.mark.parametrize(("table", "columns"), [("mapping", MAPPING), ("tilt_references", REFERENCES)])
def test_columns_are_the_bytes_that_pandas_writes_and_are_read_as_they_were(tmp_path, table, columns):
    plain, by_pandas = tmp_path / "plain.parquet", tmp_path / "pandas.parquet"
    write_table(plain, columns, table)
    write_table(by_pandas, pd.DataFrame(columns), table)
    assert plain.read_bytes() == by_pandas.read_bytes()
    found = read_columns(plain, table)
    for name, values in read_table(plain, table).items():
        np.testing.assert_array_equal(found[name], values)
        np.testing.assert_array_equal(found[name], columns[name])


def test_a_part_of_a_table_is_read_from_where_it_begins():
    whole = pa.table({"number": [0.0, None, 2.0, 3.0], "truth": [True, False, False, True]})
    part = to_numpy(whole.slice(1, 2))
    np.testing.assert_array_equal(part["number"], [np.nan, 2.0])
    np.testing.assert_array_equal(part["truth"], [False, False])


@pytest.mark.parametrize("wrong", [{"rim": np.zeros(N)}, {"source_index": np.full(N, 0.5)}])
def test_columns_of_the_wrong_type_are_refused(tmp_path, wrong):
    with pytest.raises(PipelineError, match="does not fit the schema of table 'mapping'"):
        write_table(tmp_path / "wrong.parquet", {**MAPPING, **wrong}, "mapping")
    assert not list(tmp_path.iterdir())


def test_they_come_and_go_without_pandas(tmp_path):
    path = tmp_path / "mapping.parquet"
    write_table(path, MAPPING, "mapping")
    program = (
        "import sys\nfrom pipeline.artefacts import read_columns, write_table\n"
        f"write_table({str(path)!r}, read_columns({str(path)!r}, 'mapping'), 'mapping')\nprint('pandas' in sys.modules)"
    )
    before = pq.read_table(path)
    told = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert told.stdout == "False\n"
    assert pq.read_table(path).equals(before)
