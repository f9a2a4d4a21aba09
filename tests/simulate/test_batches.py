"""Many trials at once have the results of single ones: bit for bit where a core plays the device, within rounding on a card.

Without numba-cuda, libnvvm or a card the tests that need them say so and skip. numba-cuda's simulator runs Python for each thread,
so it gets a tiny trial, in a process of its own.
"""

import json
import os
import pickle
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline import command
from pipeline.errors import PipelineError
from pipeline.geometry.cavity import lip_alone, pour_axis
from pipeline.simulate import __main__ as simulate
from pipeline.simulate import batches, liquid

TINY = {"tilt_s": 0.4, "wait_s": 0.1}


class Core:
    """A device of one thread, which is a core's: what is not put there is rubbish at first, and the last trial runs first."""

    memory = 8e6

    def put(self, array):
        return np.array(array, order="C")

    def room(self, shape, dtype):
        return np.full(shape, 77, dtype)

    def get(self, array):
        return array.copy()

    def bytes_free(self):
        return self.memory

    def run(self, one, trials, *arguments):
        for t in reversed(range(trials)):
            one(t, *arguments)


def some_pours(vessel, count):
    """Return calls of `liquid.pour`, the first without liquid, the second with more than there is room for."""
    lip, rng = lip_alone(vessel.cavity), np.random.default_rng(3)
    axis, most = (
        pour_axis(vessel.cavity.opening_m, lip),
        liquid.particles_for(vessel, vessel.cavity.capacity_m3),
    )
    numbers = [0, most + 20, *rng.integers(1, most, count - 2).tolist()]
    return [(vessel, n, lip, axis, rng.uniform(0.0, 2.1), seed) for seed, n in enumerate(numbers)]


def some_fillings(held, second, count):
    """Return calls of `liquid.fill`, the first with a second container that is too full."""
    lip, rng = lip_alone(held.cavity), np.random.default_rng(4)
    axis, most = (
        pour_axis(held.cavity.opening_m, lip),
        liquid.particles_for(second, second.cavity.capacity_m3),
    )
    calls = []
    for seed in range(count):
        T_world_held, T_world_second = np.eye(4), np.eye(4)
        T_world_second[:3, 3] = rng.uniform(-1.0, 1.0, 3)
        beside = [-rng.uniform(0.0, 0.04), rng.uniform(-0.02, 0.02), rng.uniform(0.01, 0.05)]
        T_world_held[:3, 3] = second.cavity.opening_m + T_world_second[:3, 3] + beside - lip
        n_second = int(rng.integers(most)) if seed else most + 20
        calls.append((held, second, T_world_held, T_world_second, lip, axis, 2.1, 10, n_second, seed))
    return calls


def assert_same(found, expected):
    assert type(found) is type(expected)
    for name, value in vars(expected).items():
        np.testing.assert_array_equal(getattr(found, name), value, err_msg=name)


def test_pours_of_several_vessels_are_those_of_single_calls(cylinder, cone):
    calls = [call for pair in zip(some_pours(cylinder, 8), some_pours(cone, 8), strict=True) for call in pair]
    for found, call in zip(batches.pour_many(Core(), calls), calls, strict=True):
        assert_same(found, liquid.pour(*call))


def test_fillings_are_those_of_single_calls(cylinder, cone, bowl):
    calls = some_fillings(cylinder, bowl, 8) + some_fillings(cone, bowl, 4)
    found = batches.fill_many(Core(), calls)
    for one, call in zip(found, calls, strict=True):
        assert_same(one, liquid.fill(*call))
    assert found[0].spilled_while_settling
    assert not found[1].spilled_while_settling


def test_a_blow_up_fails_alone(cylinder):
    calls = some_pours(cylinder, 4)
    calls[2] = (*calls[2][:3], np.array([0.0, np.nan, 0.0]), *calls[2][4:])
    assert [pour.failed for pour in batches.pour_many(Core(), calls)] == [False, False, True, False]


def test_a_batch_fits_the_memory(cylinder, monkeypatch):
    sizes, calls = [], some_pours(cylinder, 12)
    monkeypatch.setattr(Core, "run", lambda self, one, trials, *arguments: sizes.append(trials))
    monkeypatch.setattr(batches, "_pour_of", lambda *_: None)
    for memory in (1e9, 1.2e6, 1.0):
        Core.memory, before = memory, len(sizes)
        batches.pour_many(Core(), calls)
        assert sum(sizes[before:]) == len(calls)
    Core.memory = 8e6
    assert sizes[0] == 12
    assert max(sizes[1:-12]) < 4
    assert sizes[-12:] == [1] * 12


def test_a_card_computes_the_liquid_alone():
    with pytest.raises(
        PipelineError, match=r"^simulate\.device: cuda: expected simulate\.engine liquid, found bullet; "
    ):
        batches.card("cuda", "bullet")


def test_without_numba_cuda_there_is_one_sentence_and_no_trial(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "numba_cuda", None)
    words = ["pouring", "--object", "cup", "--container", "cup.npz", "--device", "cuda"]
    monkeypatch.setattr(sys, "argv", ["simulate", *words, "--trials-table", str(tmp_path / "t.parquet")])
    with pytest.raises(SystemExit) as stopped:
        command.run(simulate.main)
    assert stopped.value.code == 1
    said = capsys.readouterr().err.strip()
    assert said.startswith("error: simulate.device: cuda: expected the package numba-cuda, found none; ")
    assert said.endswith("or set simulate.device: cpu")
    assert "\n" not in said
    assert not (tmp_path / "t.parquet").exists()


def test_without_a_card_there_is_one_sentence():
    cuda = _numba_cuda()
    if cuda.is_available():
        pytest.skip("there is a card")
    with pytest.raises(
        PipelineError, match=r"expected a graphics card .*, found none; set simulate\.device: cpu$"
    ):
        batches.card("cuda", "liquid")


def test_the_simulated_card_pours_and_fills_as_the_core(tmp_path):
    """A few dozen particles of 20 mm. Python rounds otherwise than machine code: densities agree to a hundredth."""
    _numba_cuda()
    held, second = _coarse(0.04, 0.10), _coarse(0.06, 0.06)
    pours, fillings = some_pours(held, 4)[1:], some_fillings(held, second, 2)
    pours = [(*call[:4], 1.9, call[5]) for call in pours]
    expected = [liquid.pour(*call, **TINY) for call in pours]
    filled = [liquid.fill(*call) for call in fillings]
    (tmp_path / "calls.pickle").write_bytes(pickle.dumps((pours, fillings)))
    program = (
        "import json, pickle, sys; from pipeline.simulate import batches; card = batches.card('cuda', 'liquid');"
        "pours, fillings = pickle.load(open(sys.argv[1], 'rb'));"
        f"pours = batches.pour_many(card, pours, **{TINY}); fillings = batches.fill_many(card, fillings);"
        "print(json.dumps([[p.n_left, p.n_retained, p.n_leaked, p.density_error, p.failed] for p in pours]));"
        "print(json.dumps([[f.n_retained, f.n_in_second, f.n_spilled, f.n_leaked, f.spilled_while_settling]"
        " for f in fillings]))"
    )
    environment = {**os.environ, "NUMBA_ENABLE_CUDASIM": "1", "NUMBA_DISABLE_JIT": "1"}
    words = [sys.executable, "-c", program, str(tmp_path / "calls.pickle")]
    run = subprocess.run(words, env=environment, capture_output=True, text=True, check=True)
    poured, ended = map(json.loads, run.stdout.splitlines())
    for found, pour in zip(poured, expected, strict=True):
        assert found[0] == pytest.approx(pour.n_left, abs=1)
        assert found[0] + found[1] + found[2] == pour.n_particles
        assert found[3] == pytest.approx(pour.density_error, abs=0.01)
        assert found[4] == pour.failed
    assert any(pour.n_left > 3 and pour.n_retained > 3 for pour in expected)
    for found, filling in zip(ended, filled, strict=True):
        assert found[:3] == pytest.approx([filling.n_retained, filling.n_in_second, filling.n_spilled], abs=1)
        assert found[4] == filling.spilled_while_settling


@pytest.mark.parametrize("what", ["pour", "fill"])
def test_a_cards_machine_code_can_be_made_without_one(monkeypatch, what):
    """For an H100 (sm_90), by libnvvm and nvjitlink."""
    cuda = _numba_cuda()
    nvjitlink = pytest.importorskip("cuda.bindings.nvjitlink", reason="no nvjitlink")
    import numba
    from numba.cuda.cudadrv import nvvm

    if not nvvm.is_available():
        pytest.skip("no libnvvm")

    from pipeline.simulate import device

    made = {}

    def compiled(self, one, trials, *arguments):
        types = numba.typeof(trials), numba.typeof(arguments)
        ptx, _ = cuda.compile(device.kernel(one).py_func, types, device=False, abi="numba", cc=(9, 0))
        link = nvjitlink.create(1, ["-arch=sm_90"])
        nvjitlink.add_data(link, nvjitlink.InputType.PTX, ptx.encode(), len(ptx.encode()), one.__name__)
        nvjitlink.complete(link)
        made["ptx"], made["bytes"] = ptx, nvjitlink.get_linked_cubin_size(link)

    monkeypatch.setattr(
        "numba.cuda.dispatcher.get_current_device", lambda: SimpleNamespace(compute_capability=(9, 0))
    )
    monkeypatch.setattr(Core, "run", compiled)
    cup = _coarse(0.04, 0.10)
    if what == "pour":
        batches.pour_many(Core(), some_pours(cup, 3))
    else:
        batches.fill_many(Core(), some_fillings(cup, cup, 3))
    assert ".entry" in made["ptx"]
    assert made["bytes"] > 100_000
    assert "sqrt.rn" in made["ptx"]  # as exact as a core's


def test_a_card_agrees_with_the_core(cylinder, bowl):
    """Another rounding is another trial within its repeatability: labels agree but for a few of a hundred."""
    cuda = _numba_cuda()
    if not cuda.is_available():
        pytest.skip("no graphics card")
    card = batches.card("cuda", "liquid")
    calls = some_pours(cylinder, 300)[2:]
    found, expected = batches.pour_many(card, calls), [liquid.pour(*call) for call in calls]
    assert np.mean([(a.n_left > 0) == (b.n_left > 0) for a, b in zip(found, expected, strict=True)]) >= 0.98
    shares = [abs(a.n_left - b.n_left) / b.n_particles for a, b in zip(found, expected, strict=True)]
    assert np.mean(shares) < 0.01
    assert not any(pour.failed or pour.n_leaked for pour in found)
    assert batches.pour_many(card, [(*calls[0][:3], np.array([0.0, np.nan, 0.0]), *calls[0][4:])])[0].failed
    again = batches.pour_many(card, calls[::-1])[::-1]
    for one, other in zip(found, again, strict=True):
        assert_same(one, other)
    calls = some_fillings(cylinder, bowl, 200)
    found, expected = batches.fill_many(card, calls), [liquid.fill(*call) for call in calls]
    outside = [[f.n_particles - f.n_in_second > 0 for f in each] for each in (found, expected)]
    assert np.mean(np.equal(*outside)) >= 0.95


def _numba_cuda():
    pytest.importorskip("numba_cuda", reason="numba-cuda is not installed")
    from numba import cuda

    return cuda


def _coarse(radius_m, depth_m):
    """Return a vessel for particles of 20 mm."""
    from simulate.test_trials import lathe

    from pipeline.geometry.cavity import cavity

    return liquid.vessel(cavity(*lathe(radius_m, depth_m), name="coarse"), 0.020)
