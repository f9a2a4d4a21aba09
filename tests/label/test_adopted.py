import numpy as np
from conftest import sampled

from pipeline.artefacts import read_table, write_table
from pipeline.label import adopted
from pipeline.schemas import TABLES


def test_mapped_parts_take_the_place_of_the_estimate_where_a_point_was_mapped(tmp_path, monkeypatch):
    estimate = sampled("short_cup").assign(container=False, rim=False, handle=True)
    write_table(tmp_path / "estimate.parquet", estimate, "labels")
    truth = sampled("short_cup")
    mapping = truth.assign(source_index=0, target_index=np.arange(len(truth)), valid=True)
    mapping.loc[:9, "valid"] = False
    mapping = mapping.sample(frac=1.0, random_state=0)[TABLES["mapping"].names]
    write_table(tmp_path / "mapping.parquet", mapping, "mapping")

    words = [f"--{name}={tmp_path}/{file}.parquet" for name, file in
             (("estimate", "estimate"), ("label-mapping", "mapping"), ("labels", "labels"))]  # fmt: skip
    monkeypatch.setattr("sys.argv", ["adopted", *words])
    adopted.main()

    labels = read_table(tmp_path / "labels.parquet", "labels")
    for part in ("container", "rim", "handle"):
        np.testing.assert_array_equal(labels[part][10:], truth[part][10:])
        np.testing.assert_array_equal(labels[f"p_{part}"][10:], truth[part][10:])
    assert labels["handle"][:10].all()
