"""What is compiled ahead is what the jobs call: a type that differs would be compiled again by each of them."""

import json
import subprocess
import sys

from numba.core.sigutils import normalize_signature

from pipeline import compile as ahead
from pipeline.artefacts import read_json

FUSED = """
import json, sys
from pathlib import Path
from pipeline import compile as ahead
from pipeline.fuse.fusion import fused
fused(Path(sys.argv[1]), voxel_m=0.004, truncation_m=0.008, n_points=5000, seed=1)
print(json.dumps([list(map(str, function.signatures)) for function in ahead.fuse_types()]))
"""
SIMULATED = """
import json
import numpy as np
from pipeline.geometry.cavity import lip_alone, pour_axis
from pipeline.simulate import filling, liquid, pouring, prepared, rest
from pipeline.simulate.references import references
from pipeline.compile import simulate

cup = references()[1].cavity()
ready = liquid.vessel(cup, 0.02)
box = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
container = prepared.Container("cone", 0.08, box, [box[0]], ready, prepared.ENGINES["liquid"])
vessel = prepared.from_arrays("cone", prepared.to_arrays(container)).vessel
lip, T_world_held = lip_alone(cup), np.eye(4)
T_world_held[2, 3] = 0.2
axis = pour_axis(cup.opening_m, lip)
liquid.pour(vessel, 10, lip, axis, 1.0, 1)
liquid.fill(vessel, vessel, T_world_held, np.eye(4), lip, axis, 1.0, 4, 6, 1)
functions = rest.rest, pouring._pour, filling._fill
called = [len(function.signatures) for function in functions]
simulate()
print(json.dumps([called, [len(function.signatures) for function in functions]]))
"""


def _said(code: str, *arguments: str) -> list:
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_fusion_calls_what_was_compiled_and_nothing_else(tmp_path) -> None:
    scan = [sys.executable, "-m", "pipeline.scan", "--object", "short_cup", "--views", "12"]
    subprocess.run([*scan, "--raw", tmp_path / "raw/cup", "--truth", tmp_path / "truth"], check=True)
    wanted = [[str(normalize_signature(text)[0])] for text in ahead.fuse_types().values()]
    assert _said(FUSED, str(tmp_path / "raw/cup")) == wanted


def test_trials_call_what_was_compiled_and_nothing_else() -> None:
    assert _said(SIMULATED) == [[1, 1, 1], [1, 1, 1]]


def test_it_tells_what_it_compiled(tmp_path) -> None:
    command = [sys.executable, "-m", "pipeline.compile", "fuse", "--compiled", str(tmp_path / "fuse.json")]
    subprocess.run(command, check=True)
    assert "pipeline.fuse.planes._fit_all" in read_json(tmp_path / "fuse.json")["functions"]
