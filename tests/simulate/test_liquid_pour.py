import json
import os
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.geometry.cavity import lip_alone, pour_axis, retained_volume_m3
from pipeline.simulate import liquid, pouring, rest
from pipeline.simulate.liquid import Pour, Vessel

# Share kept after a tilt by so many degrees in 1.0 s and a wait of 0.3 s: SPlisHSPlasH, DFSPH, 1240 particles of 5 mm.
REFERENCE = {60: 0.994, 65: 0.936, 70: 0.826, 75: 0.683, 80: 0.527, 90: 0.236, 100: 0.038}


def pour(vessel: Vessel, n: int, tilt_deg: float, seed: int = 1, **more: float) -> Pour:
    lip = lip_alone(vessel.cavity)
    axis = pour_axis(vessel.cavity.opening_m, lip)
    return liquid.pour(vessel, n, lip, axis, np.radians(tilt_deg), seed, **more)


def test_the_reference_pour(cylinder: Vessel) -> None:
    kept = [pour(cylinder, 155, tilt, wait_s=0.3).n_retained / 155 for tilt in REFERENCE]
    assert np.sqrt(np.mean((np.array(kept) - list(REFERENCE.values())) ** 2)) < 0.03


def test_upright_nothing_leaves_and_upside_down_all(cylinder: Vessel) -> None:
    assert pour(cylinder, 200, 0.0).n_left == 0
    assert pour(cylinder, 200, 120.0).n_retained <= 2


def test_a_half_full_cylinder_begins_to_pour_where_hydrostatics_says(cylinder: Vessel) -> None:
    # Half of the liquid is kept when the surface reaches from the lip to the far edge of the floor.
    theory = np.degrees(np.arctan2(0.097, 2 * 0.037))
    n = liquid.particles_for(cylinder, 0.5 * np.pi * 0.037**2 * 0.097)
    assert pour(cylinder, n, theory - 6.0).n_left == 0
    assert pour(cylinder, n, theory + 6.0).n_left > 0


@pytest.mark.parametrize("name", ["thin", "cone", "bowl"])
def test_no_particle_is_lost_and_none_crosses_a_wall(request: pytest.FixtureRequest, name: str) -> None:
    vessel, rng = request.getfixturevalue(name), np.random.default_rng(5)
    for seed in range(12):
        n = liquid.particles_for(vessel, rng.uniform(0.05, 1.0) * vessel.cavity.capacity_m3)
        result = pour(vessel, n, rng.uniform(0.0, 120.0), seed)
        assert not result.failed
        assert result.n_leaked == 0
        assert result.n_left + result.n_retained == result.n_particles == n
        if n >= 120:
            assert result.density_error < 0.05


def test_after_a_long_wait_about_what_hydrostatics_keeps_is_left(cylinder: Vessel) -> None:
    lip = lip_alone(cylinder.cavity)
    axis = pour_axis(cylinder.cavity.opening_m, lip)
    for tilt in (40.0, 60.0, 75.0):
        kept = pour(cylinder, 300, tilt, wait_s=3.0).n_retained * cylinder.spacing_m**3
        static = float(retained_volume_m3(cylinder.cavity, lip, axis, np.radians(tilt)))
        surface_m2 = (
            np.pi * 0.037**2 / np.cos(np.radians(min(tilt, 52.0)))
        )  # beyond 52° the floor cuts it off
        assert static - 0.5 * surface_m2 * cylinder.spacing_m < kept
        assert kept < static + surface_m2 * cylinder.spacing_m


def test_a_trial_that_ends_early_has_the_same_label(cylinder: Vessel) -> None:
    rng = np.random.default_rng(7)
    for seed in range(10):
        n, tilt = int(rng.integers(20, 400)), rng.uniform(0.0, 90.0)
        early, patient = (pour(cylinder, n, tilt, seed, patient=p) for p in (False, True))
        assert (early.n_left > 0) == (patient.n_left > 0)
        assert abs(early.n_left - patient.n_left) <= max(2, 0.03 * n)


def test_a_shared_settled_state_gives_the_labels_that_one_of_its_own_gives(
    cylinder: Vessel, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(8)
    draws = [(int(rng.integers(20, 400)), rng.uniform(0.0, 110.0), seed) for seed in range(12)]
    shared = [pour(cylinder, *draw).n_left for draw in draws]
    monkeypatch.setattr(pouring, "settle", lambda vessel, n, seed: rest._settled(vessel, n))
    own = [pour(cylinder, *draw).n_left for draw in draws]
    assert [left > 0 for left in own] == [left > 0 for left in shared]
    assert {True, False} == {left > 0 for left in own}
    for (n, _, _), a, b in zip(draws, own, shared, strict=True):
        assert abs(a - b) <= max(3, 0.04 * n)


@pytest.mark.long
def test_single_precision_gives_the_labels_that_double_gives(
    cylinder: Vessel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same code compiled for arrays of doubles: the liquid's state, the wall's fields, all sums."""

    def doubled(arrays: tuple) -> tuple:
        return type(arrays)(*(a.astype(float) if a.dtype == np.float32 else a for a in arrays))

    rng = np.random.default_rng(3)
    draws = [(int(rng.integers(20, 200)), rng.uniform(0.0, 110.0), seed) for seed in range(10)]
    single = [pour(cylinder, *draw).n_left for draw in draws]
    finer = replace(cylinder, walls=doubled(cylinder.walls))
    make = pouring.particles
    monkeypatch.setattr(pouring, "particles", lambda n, walls: doubled(make(n, walls)))
    double = [pour(finer, *draw).n_left for draw in draws]
    assert double != single  # it really was another computation
    assert [left > 0 for left in double] == [left > 0 for left in single]


@pytest.mark.long
def test_ending_the_pressure_iterations_early_gives_the_labels_that_all_of_them_give(
    cylinder: Vessel, tmp_path: Path
) -> None:
    """The share of the density's excess at which they end is compiled in: with all iterations in a process of its own."""
    rng = np.random.default_rng(4)
    draws = [(int(rng.integers(20, 400)), round(rng.uniform(0.0, 110.0), 3), seed) for seed in range(1, 41)]
    early = [pour(cylinder, *draw).n_left for draw in draws]
    program = (
        "import json, pickle, sys, numpy as np; from pipeline.simulate import kernels, liquid; kernels.ENOUGH = -1.0;"
        "from pipeline.geometry.cavity import lip_alone, pour_axis; v = pickle.load(open(sys.argv[1], 'rb'));"
        "lip = lip_alone(v.cavity); axis = pour_axis(v.cavity.opening_m, lip);"
        "print([liquid.pour(v, n, lip, axis, np.radians(t), s).n_left for n, t, s in json.loads(sys.argv[2])])"
    )
    with (tmp_path / "vessel.pickle").open("wb") as file:
        pickle.dump(cylinder, file)
    command = [sys.executable, "-c", program, str(tmp_path / "vessel.pickle"), json.dumps(draws)]
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "NUMBA_CPU_NAME": "generic"}
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    complete = json.loads(run.stdout.splitlines()[-1])
    assert complete != early  # it really was another computation
    assert np.mean([(a > 0) == (b > 0) for a, b in zip(complete, early, strict=True)]) >= 0.97
    counts = np.array([n for n, _, _ in draws])
    assert np.mean(np.abs(np.array(complete) - early) / counts) < 0.02


def test_the_same_arguments_give_the_same_bits_on_any_thread(cylinder: Vessel) -> None:
    with ThreadPoolExecutor(3) as pool:
        results = list(pool.map(lambda _: pour(cylinder, 155, 70.0, 11), range(3)))
    again = pour(cylinder, 155, 70.0, 11)
    for result in results:
        assert result.retained.tobytes() == again.retained.tobytes()
        assert result.density_error == again.density_error
    assert pour(cylinder, 155, 70.0, 12).density_error != again.density_error


def test_the_bits_do_not_depend_on_who_compiled(cylinder: Vessel, tmp_path: Path) -> None:
    """A process that loads what was compiled for this processor, and one that compiles for the oldest of its kind, agree."""
    result = pour(cylinder, 60, 70.0, 11)
    with (tmp_path / "vessel.pickle").open("wb") as file:
        pickle.dump(cylinder, file)
    program = (
        "import pickle, sys, numpy as np; from pipeline.simulate import liquid; from pipeline.geometry.cavity import *;"
        "v = pickle.load(open(sys.argv[1], 'rb')); lip = lip_alone(v.cavity); v.settled.clear();"
        "r = liquid.pour(v, 60, lip, pour_axis(v.cavity.opening_m, lip), np.radians(70.0), 11);"
        "print(r.retained.tobytes().hex(), r.density_error)"
    )
    command = [sys.executable, "-c", program, str(tmp_path / "vessel.pickle")]
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "NUMBA_CPU_NAME": "generic"}
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert run.stdout.split() == [result.retained.tobytes().hex(), str(result.density_error)]


def test_a_blow_up_is_recorded_as_failed(cylinder: Vessel) -> None:
    lip = lip_alone(cylinder.cavity)
    assert liquid.pour(cylinder, 50, lip, np.array([0.0, np.nan, 0.0]), 1.0, 1).failed


def test_no_liquid_is_no_error(cylinder: Vessel) -> None:
    result = pour(cylinder, 0, 90.0)
    assert (result.n_left, result.n_retained, result.failed) == (0, 0, False)
