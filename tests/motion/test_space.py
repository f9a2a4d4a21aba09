"""Phases, scales, safety, and primitives given the objects."""

import json

import numpy as np
import pandas as pd
import pytest
from motion import pours

from pipeline.errors import PipelineError
from pipeline.motion import conditioned, phase, scaling
from pipeline.motion.conditioned import ConditionedProMP
from pipeline.motion.promp import ProMP
from pipeline.motion.safety import safety, unsafe

PARAMETERS = pd.DataFrame(
    [
        [name, mapping, factor * radius, factor * height, tilt, 1e-3]
        for name, radius, height, tilt in (("cup", 0.04, 0.12, 1.0), ("bowl", 0.08, 0.06, 0.3))
        for mapping, factor in (("label_mapping", 1.0), ("point_mapping", 0.9))
    ],
    columns=["object", "mapping", "radius_m", "height_m", "tilt_reference_rad", "volume_m3"],
)


def test_references_are_those_of_section_iii_b():
    assert scaling.factors(PARAMETERS, "label_mapping", "cup", "bowl").tolist() == [0.08, 0.08, 0.12, 1.0]
    assert scaling.factors(PARAMETERS, "point_mapping", "cup", "bowl") == pytest.approx(
        [0.072, 0.072, 0.108, 1.0]
    )
    assert scaling.factors(PARAMETERS, "standard", "cup", "bowl").tolist() == [1.0] * 4
    with pytest.raises(PipelineError, match=r"vase: expected one row .* there are bowl cup"):
        scaling.factors(PARAMETERS, "label_mapping", "vase", "bowl")


def test_there_and_back_is_the_same_pour():
    references = scaling.factors(PARAMETERS, "label_mapping", "cup", "bowl")
    _, shown = pours.pour(0)
    one = scaling.to_dimensionless(shown, references)
    assert one[0] == pytest.approx(shown[0] / [0.08, 0.08, 0.12, 1.0])
    assert scaling.from_dimensionless(one, references) == pytest.approx(shown)


def test_rests_are_cut_off():
    _, values = pours.pour(0)
    still = np.concatenate([np.repeat(values[:1], 60, axis=0), values, np.repeat(values[-1:], 40, axis=0)])
    moving = phase.moving(np.arange(len(still)) * 0.02, still)
    assert 60 <= moving.start <= 75
    assert len(still) - 55 <= moving.stop <= len(still) - 39


@pytest.mark.parametrize("events", [1, 2])
def test_aligned_pours_tilt_at_the_same_phase(events):
    paces = (0.7, 1.0, 1.5)
    times, tilts = [], []
    for pace in paces:
        t, values = pours.pour(1, spread=0.0)
        u = (t / t[-1]) ** pace
        tilt = np.interp(u, t / t[-1], values[:, 3])
        kept = len(t) if events == 2 else int(np.argmax(tilt)) + 1
        times.append(t[:kept])
        tilts.append(tilt[:kept])
    before = [
        np.interp(1.0, tilt[: np.argmax(tilt)], t[: np.argmax(tilt)] / t[-1])
        for t, tilt in zip(times, tilts, strict=True)
    ]
    phases = phase.aligned(times, tilts)
    after = [
        np.interp(1.0, tilt[: np.argmax(tilt)], one[: np.argmax(tilt)])
        for one, tilt in zip(phases, tilts, strict=True)
    ]
    assert np.ptp(before) > 0.1
    assert np.ptp(after) < 0.005
    for one in phases:
        assert (one[0], one[-1]) == (0.0, 1.0)
        assert (np.diff(one) > 0.0).all()


def _tilting_early(share: float) -> ProMP:
    """Return a primitive (dimensionless) whose tilt when the lip arrives is above one in a known share of pours."""
    from scipy.stats import norm

    n, centres = 15, np.linspace(0.0, 1.0, 15)
    x = np.where(centres < 0.5, -3.0, 0.0)
    tilt = np.full(n, 1.0 + 0.1 * norm.ppf(share))
    covariance = np.zeros((4 * n, 4 * n))
    # One offset of the whole tilt, and nothing else.
    covariance[3 * n :, 3 * n :] = 0.1**2
    mean = np.concatenate([x, np.zeros(n), np.ones(n), tilt])
    return ProMP(mean, covariance, np.zeros(4), n, 0.75 / 14)


@pytest.mark.parametrize("share", [0.05, 0.5, 0.9])
def test_the_probability_to_tilt_early_is_known(share):
    found = safety(_tilting_early(share), np.random.default_rng(0), samples=4000)
    assert found.way_in == pytest.approx(share, abs=4.0 * np.sqrt(share * (1.0 - share) / 4000))
    assert found.ever >= found.way_in
    assert found == safety(_tilting_early(share), np.random.default_rng(0), samples=4000)


def test_way_in_ends_when_the_lip_is_inside():
    there, tilted, back = [-2.0, 0.0, 1.0, 0.5], [0.0, 0.0, 1.0, 2.0], [-2.0, 0.0, 1.0, 1.5]
    runs = np.array([[there, tilted, tilted], [there, tilted, back], [back, tilted, tilted]])
    way_in, ever = unsafe(runs)
    assert way_in.tolist() == [False, False, True]
    assert ever.tolist() == [False, True, True]
    assert not unsafe(runs, radius=2.5)[1].any()


def _pairs(count: int, each: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return contexts (N, 2) and pours (N, T, 4) whose x is that of the first parameter's logarithm, whose y is not."""
    rng = np.random.default_rng(seed)
    contexts = np.repeat(rng.uniform(-0.5, 0.5, (count, 2)), each, axis=0)
    return contexts, np.array([_of_pair(context, rng) for context in contexts])


def _of_pair(context: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    ramp = np.linspace(0.0, 1.0, 60)[:, None]
    late = np.array([2.0 * context[0], 0.0, -context[1], 0.0]) * ramp
    return np.ones(4) + late + 0.05 * rng.standard_normal(4) + 0.01 * rng.standard_normal((60, 4))


def test_given_the_objects_only_what_depends_on_them_moves():
    contexts, shown = _pairs(12, 4, 0)
    learnt = ConditionedProMP.fit(list(shown), contexts)
    at = np.array([0.0, 1.0])
    there, here = (learnt.given(np.array([x, 0.0])).mean(at) for x in (0.4, 0.0))
    assert (there - here)[1] == pytest.approx([0.8, 0.0, 0.0, 0.0], abs=0.09)
    assert (there - here)[0] == pytest.approx(0.0, abs=0.09)


@pytest.mark.parametrize(("pairs", "least"), [(8, 0.93), (4, 0.92)])
def test_bands_of_new_pairs_hold_and_grow_with_the_distance(pairs, least):
    phases, inside, blind = np.linspace(0.0, 1.0, 60), [], []
    for seed in range(25):
        contexts, shown = _pairs(pairs, 3, seed)
        learnt, plain = ConditionedProMP.fit(list(shown), contexts), ProMP.fit(list(shown))
        rng = np.random.default_rng([seed, 1])
        for _ in range(10):
            context = rng.uniform(-0.5, 0.5, 2)
            given, new = learnt.given(context), _of_pair(context, rng)
            inside.append((np.abs(new - given.mean(phases)) < 1.96 * given.deviation(phases)).mean())
            blind.append(given.deviation(phases)[-1, 0] / plain.deviation(phases)[-1, 0])
    assert least < np.mean(inside) < 0.97
    assert np.mean(blind) < 0.3
    near, far = (learnt.given(np.array([x, 0.0])).deviation(phases).mean() for x in (0.0, 2.0))
    assert far > 1.5 * near


def test_conditioned_primitives_need_two_pairs_and_known_objects():
    _, shown = _pairs(1, 4, 0)
    with pytest.raises(PipelineError, match="at least two pairs"):
        ConditionedProMP.fit(list(shown), np.zeros((4, 2)))
    context = conditioned.log_parameters(PARAMETERS, "label_mapping", "cup", "bowl")
    assert context == pytest.approx(np.log([0.04, 0.12, 1.0, 1e-3, 0.08, 0.06]))
    with pytest.raises(PipelineError, match="vase"):
        conditioned.log_parameters(PARAMETERS, "label_mapping", "cup", "vase")


def test_a_conditioned_primitive_that_was_written_is_the_same_and_a_mended_one_is_refused():
    contexts, shown = _pairs(4, 3, 0)
    learnt = ConditionedProMP.fit(list(shown), contexts)
    content = json.loads(json.dumps(learnt.to_json()))
    at, context = np.linspace(0.0, 1.0, 5), np.array([0.1, 0.2])
    read = ConditionedProMP.from_json(content).given(context)
    assert (read.mean(at) == learnt.given(context).mean(at)).all()
    assert (read.covariance(at) == learnt.given(context).covariance(at)).all()
    content["slope"] = content["slope"][:-1]
    with pytest.raises(PipelineError, match=r"mine.json: expected slope of shape \(60, 2\)"):
        ConditionedProMP.from_json(content, "mine.json")
    with pytest.raises(
        PipelineError, match=r"mine.json: expected a conditioned primitive with residual slope"
    ):
        ConditionedProMP.from_json(learnt.residual.to_json(), "mine.json")
