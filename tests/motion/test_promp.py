"""Primitives against distributions that are known."""

import json

import numpy as np
import pytest

from pipeline.errors import PipelineError
from pipeline.motion import basis
from pipeline.motion.fitting import widening
from pipeline.motion.promp import ProMP

PHASE = np.linspace(0.0, 1.0, 80)
NOISE = 0.01
BUMPS = np.exp(-0.5 * ((PHASE - np.array([[0.0], [0.5], [1.0]])) / 0.25) ** 2)


class Truth:
    """Pours (T, 4) of a Gaussian with six hidden factors that all dimensions share."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng([3, seed])
        self.loads = 0.05 * self.rng.standard_normal((3, 4, 6))
        self.weights = self.rng.standard_normal((3, 4))

    def draw(self, count: int, noise: float = NOISE) -> np.ndarray:
        hidden = self.rng.standard_normal((count, 6))
        smooth = np.einsum("kt,nkd->ntd", BUMPS, self.weights + np.einsum("kde,ne->nkd", self.loads, hidden))
        return smooth + noise * self.rng.standard_normal(smooth.shape)

    def covariance(self) -> np.ndarray:
        by_phase = np.einsum("kt,kde->tde", BUMPS, self.loads)
        return by_phase @ by_phase.transpose(0, 2, 1) + NOISE**2 * np.eye(4)


@pytest.mark.parametrize(("count", "seeds"), [(5, 60), (10, 40), (40, 15)])
def test_bands_of_95_per_cent_hold_95_per_cent(count, seeds):
    inside = []
    for seed in range(seeds):
        truth = Truth(seed)
        promp = ProMP.fit(list(truth.draw(count)))
        off = np.abs(truth.draw(200) - promp.mean(PHASE)) / promp.deviation(PHASE)
        inside.append((off < 1.959964).mean())
    assert 0.93 < np.mean(inside) < 0.97


def test_widening_is_that_of_students_t():
    rng = np.random.default_rng(1)
    for count in (3, 5, 10):
        shown, new = rng.standard_normal((200_000, count)), rng.standard_normal(200_000)
        deviation = np.sqrt(shown.var(axis=1, ddof=1) * widening(count))
        assert (np.abs(new - shown.mean(axis=1)) < 1.959964 * deviation).mean() == pytest.approx(
            0.95, abs=0.003
        )


def test_many_demonstrations_tell_mean_covariance_and_noise():
    truth = Truth(0)
    promp = ProMP.fit(list(truth.draw(400)))
    expected = truth.covariance()
    assert promp.noise_variance == pytest.approx(NOISE**2, rel=0.05)
    standard_error = np.sqrt(np.diagonal(expected, axis1=1, axis2=2) / 400)
    assert (np.abs(promp.mean(PHASE) - BUMPS.T @ truth.weights) < 4.0 * standard_error).all()
    assert np.abs(promp.covariance(PHASE) - expected).max() < 0.12 * expected.max()


@pytest.mark.parametrize("count", [5, 10])
def test_noise_is_not_taken_for_variation_of_few_demonstrations(count):
    found = [ProMP.fit(list(Truth(seed).draw(count))).noise_variance.mean() for seed in range(10)]
    assert np.mean(found) == pytest.approx(NOISE**2, rel=0.1)


def test_conditioning_is_that_of_gaussians():
    promp = ProMP.fit(list(Truth(1).draw(12)))
    phase, value, variance = 0.3, np.array([0.4, -0.2]), 1e-3
    given = promp.condition(phase, value, variance, ["y", "tilt"])
    # The same by the precision instead of the gain.
    H = basis.blocks(np.array([phase]), promp.n_basis, promp.width, 4)[0][[1, 3]]
    precision = np.linalg.inv(promp.weights_covariance)
    covariance = np.linalg.inv(precision + H.T @ H / variance)
    mean = covariance @ (precision @ promp.weights_mean + H.T @ value / variance)
    assert given.weights_mean == pytest.approx(mean, abs=1e-6)
    assert given.weights_covariance == pytest.approx(covariance, abs=1e-7)


def test_via_points_are_passed_and_noise_stays():
    promp = ProMP.fit(list(Truth(2).draw(10)))
    start, via = np.array([1.0, 0.0, 2.0, 0.0]), np.array([0.5])
    given = promp.condition(0.0, start, 0.0).condition(0.6, via, 1e-10, ["z"])
    rng = np.random.default_rng(0)
    for _ in range(5):
        drawn = given.sample(np.array([0.0, 0.6]), rng)
        assert drawn[0] == pytest.approx(start, abs=1e-3)
        assert drawn[1, 2] == pytest.approx(0.5, abs=1e-3)
    assert given.deviation(np.array([0.0]))[0] == pytest.approx(np.sqrt(promp.noise_variance), rel=0.02)


def test_known_starts_tell_the_rest_as_truly():
    inside, before, after = [], [], []
    for seed in range(10):
        truth = Truth(seed)
        promp = ProMP.fit(list(truth.draw(10)))
        for new in truth.draw(20):
            given = promp.condition(0.0, new[0], promp.noise_variance)
            inside.append((np.abs(new - given.mean(PHASE)) < 1.96 * given.deviation(PHASE)).mean())
            before.append(np.mean((new - promp.mean(PHASE)) ** 2))
            after.append(np.mean((new - given.mean(PHASE)) ** 2))
    assert 0.9 < np.mean(inside) < 0.98
    assert np.mean(after) < 0.8 * np.mean(before)


def test_samples_have_the_distribution_they_are_drawn_from():
    promp = ProMP.fit(list(Truth(4).draw(10)))
    drawn = promp.samples(PHASE, 20_000, np.random.default_rng(0))
    expected = promp.covariance(PHASE) - np.diag(promp.noise_variance)
    assert np.abs(drawn.mean(axis=0) - promp.mean(PHASE)).max() < 0.01
    found = np.einsum("ntd,nte->tde", *2 * [drawn - drawn.mean(axis=0)]) / len(drawn)
    assert np.abs(found - expected).max() < 0.05 * expected.max()


def test_scaled_primitives_are_those_of_scaled_demonstrations():
    # As the smallest deviations are absolute, equal up to them.
    shown, factors = Truth(5).draw(8), np.array([0.07, 0.07, 0.13, 1.06])
    scaled, learnt = ProMP.fit(list(shown)).scaled(factors), ProMP.fit(list(shown * factors))
    assert scaled.mean(PHASE) == pytest.approx(learnt.mean(PHASE), abs=1e-5)
    assert scaled.deviation(PHASE) == pytest.approx(learnt.deviation(PHASE), rel=1e-3)


def test_demonstrations_of_other_lengths_and_paces():
    truth = Truth(6)
    shown = [one[:: 1 + number % 2] for number, one in enumerate(truth.draw(30, noise=1e-4))]
    promp = ProMP.fit(shown, [PHASE[:: 1 + number % 2] for number in range(30)])
    assert np.abs(promp.mean(PHASE) - BUMPS.T @ truth.weights).max() < 0.06


def test_dimensions_that_never_change_are_no_obstacle():
    shown = Truth(7).draw(6)
    shown[..., 1] = 0.0
    promp = ProMP.fit(list(shown)).condition(0.0, shown[0, 0], 1e-6)
    assert promp.mean(PHASE)[:, 1] == pytest.approx(0.0, abs=1e-4)
    assert np.isfinite(promp.sample(PHASE, np.random.default_rng(0))).all()


def test_saved_primitives_come_back():
    promp = ProMP.fit(list(Truth(8).draw(5)), duration_s=4.5, units=("1",) * 4)
    back = ProMP.from_json(json.loads(json.dumps(promp.to_json())))
    assert back.duration_s == 4.5
    assert back.units == ("1",) * 4
    one, other = (p.sample(PHASE, np.random.default_rng(1)) for p in (promp, back))
    assert np.array_equal(one, other)


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("n_basis", 3, "weights_mean of shape"),
        ("weights_covariance", [[1.0], [1.0, 2.0]], "even rows"),
        ("noise_variance", [-1.0, 0, 0, 0], "noise_variance.0"),
        ("colour", 1, "colour"),
        ("units", ["m"], "4 units"),
    ],
)
def test_damaged_files_are_refused(key, value, said):
    content = {**ProMP.fit(list(Truth(9).draw(3)), n_basis=6).to_json(), key: value}
    with pytest.raises(PipelineError, match=rf"^my\.json: .*{said}"):
        ProMP.from_json(content, "my.json")


def test_one_demonstration_or_a_foreign_dimension_is_refused():
    with pytest.raises(PipelineError, match="at least two"):
        ProMP.fit(list(Truth(0).draw(1)))
    promp = ProMP.fit(list(Truth(0).draw(3)))
    for arguments in [(0.5, [1.0], 0.1, ["w"]), (0.5, [1.0], 0.1), (1.5, [1.0], 0.1, ["x"])]:
        with pytest.raises(PipelineError, match="condition"):
            promp.condition(*arguments)
