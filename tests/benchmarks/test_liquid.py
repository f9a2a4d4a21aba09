"""The benchmark of the liquid starts, ends and finds a true pour. What it says of speed is for an idle machine to say."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.long
def test_the_benchmark_of_the_liquid_runs_and_its_pour_is_true():
    options = ["--json", "--rounds", "1", "--seconds", "0.1", "--most-particles", "155"]
    run = subprocess.run(
        [sys.executable, "benchmarks/liquid.py", *options], cwd=ROOT, capture_output=True, text=True
    )
    assert run.returncode == 0, run.stderr
    found = json.loads(run.stdout)
    assert found["rmse_155"] < 0.02
    assert found["rmse_310"] < 0.01
    assert found["ratio_bullet_155"] > 10.0
    assert found["trials_per_s_two_cores"] > 0.0
    assert [row["particles"] for row in found["by_size"]] == [155]
