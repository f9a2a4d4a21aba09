"""Reports that take longer than a few seconds tell what they are at."""

import sys
from contextlib import contextmanager

import pytest

from pipeline import command
from pipeline.report import accuracy, scans


@pytest.mark.parametrize("module", [accuracy, scans])
def test_reports_that_take_seconds_tell_the_step_they_are_at(finished, tmp_path, monkeypatch, module):
    processed, name = finished / "data/processed", "short_cup"
    fused = processed / "fuse" / name
    options = {
        accuracy: ["--processed", processed, "--source", "mug", "--object", name, "--errors"],
        scans: [
            *("--mesh", fused / "mesh.ply", "--cloud", fused / "cloud.parquet"),
            *("--fusion", fused / "fusion.json", "--output"),
        ],
    }[module]
    begun: list[str] = []
    announced: list[int] = []

    @contextmanager
    def steps(what, total):
        assert "short_cup" in what
        announced.append(total)
        yield begun.append

    monkeypatch.setattr(command, "steps", steps)
    monkeypatch.setattr(sys, "argv", ["report", *map(str, options), str(tmp_path / "made.png")])
    module.main()
    assert [len(begun)] == announced
    assert (tmp_path / "made.png").exists()
