import numpy as np
import pandas as pd
import pytest

from pipeline.report import engines_page, physics_page
from pipeline.report.engines import compared, engine_numbers, kappa
from pipeline.report.physics_numbers import check_numbers, spill_errors, trial_numbers
from pipeline.report.style import save


def checks() -> pd.DataFrame:
    """A row or two of each check, of two objects and the references."""
    rows = []

    def add(check, vessel, x, measured, expected=np.nan, spacing_m=0.010):
        rows.append((check, vessel, spacing_m, 100, float(x), float(measured), float(expected)))

    for n, error in ((60, 0.08), (200, 0.02)):
        add("density", "cylinder", n, error, 0.0)
        add("level", "cylinder", n, 0.051, 0.050)
    for time_s, speed in ((0.0, 0.3), (1.0, 0.03)):
        add("speed", "cylinder", time_s, speed)
    for spacing_m in (0.010, 0.005):
        add("spill", "cylinder", 0.5, np.radians(54.0), np.radians(52.0), spacing_m)
        add("spill_allowed", "cylinder", 0.5, np.radians(1.0), spacing_m=spacing_m)
    add("leaked", "cylinder", 0, 0, 0)
    for name in ("cup", "bowl"):
        for check, held in (("capacity", 1.01), ("capacity_uncalibrated", 0.9)):
            add(check, name, 0.5, held * 2e-4, 2e-4)
        for tilt, kept in ((0.0, 2e-4), (1.0, 1e-4)):
            add("retained", name, tilt, kept, kept)
        for experiment in ("pouring", "filling"):
            for trial, label in enumerate((1.0, 0.0, 1.0, np.nan)):
                add(f"repeat_{experiment}", name, trial, label, label)
                add(f"converge_{experiment}", name, trial, label, 1.0, 0.005)
    columns = ["check", "vessel", "spacing_m", "n_particles", "x", "measured", "expected"]
    return pd.DataFrame(rows, columns=columns)


def trials(labels: list[bool]) -> pd.DataFrame:
    """Pouring and filling trials of a cup and a bowl with these labels."""
    tables = []
    for experiment in ("pouring", "filling"):
        for name in ("cup", "bowl"):
            n = len(labels)
            table = {"experiment": experiment, "object": name, "trial": range(n), "seed": range(n)}
            table |= {"poured": labels, "filled": labels, "failed": False, "n_void": 0, "n_leaked": 0}
            table |= {"n_particles": 150, "n_second": 0, "density_error": 0.01, "tilt_rad": 1.0}
            table |= {"n_left": 30, "fill_m3": 1.5e-4, "second_fill_m3": 1e-4}
            tables.append(pd.DataFrame({**table, "hydrostatic_margin": np.linspace(-0.5, 0.5, n)}))
    return pd.concat(tables, ignore_index=True)


def test_cohens_kappa_of_a_known_table():
    # The example of Cohen's paper in every textbook: 20 yes-yes, 5 yes-no, 10 no-yes, 15 no-no.
    one = pd.Series([True] * 25 + [False] * 25)
    other = pd.Series([True] * 20 + [False] * 5 + [True] * 10 + [False] * 15)
    assert kappa(one, other) == pytest.approx(0.4)
    assert kappa(one, one) == 1.0
    assert np.isnan(kappa(one[:25], one[:25]))


def test_the_numbers_are_those_of_the_rows():
    numbers = check_numbers(checks())
    assert numbers["physics.rest.density_error_max"] == 0.02
    assert numbers["physics.rest.density_error_thin_max"] == 0.08
    assert numbers["physics.rest.level_error_spacings_max"] == pytest.approx(0.1)
    assert numbers["physics.rest.cylinder.energy_left_share"] == pytest.approx(0.01)
    assert numbers["physics.capacity.10_mm.relative_error_max"] == pytest.approx(0.01)
    assert numbers["physics.capacity_uncalibrated.10_mm.relative_error_max"] == pytest.approx(0.1)
    assert numbers["physics.retained.cup.rms_error_share"] == 0.0
    assert numbers["physics.repeat.pouring.agreement"] == 1.0
    assert numbers["physics.converge.pouring.agreement"] == pytest.approx(2 / 3)
    assert numbers["physics.converge.pouring.trials"] == 6  # a failed one has no label


def test_at_half_the_spacing_half_the_error_is_allowed():
    rows = spill_errors(checks()).set_index("spacing_m")
    assert np.degrees(rows.allowed_rad[0.010]) == pytest.approx(3.0)
    assert np.degrees(rows.allowed_rad[0.005]) == pytest.approx(1.5)
    numbers = check_numbers(checks())
    assert numbers["physics.spill.cylinder.10_mm.within_allowed_share"] == 1.0
    assert numbers["physics.spill.cylinder.5_mm.within_allowed_share"] == 0.0


def test_engines_are_compared_on_the_same_draws_alone():
    liquid, bullet = trials([True, True, False, False]), trials([True, False, False, False])

    def numbers() -> dict[str, float]:
        others = {"bullet": bullet}
        return engine_numbers(compared(liquid, others), others)

    assert numbers()["physics.engines.bullet.pouring.kappa"] == pytest.approx(0.5)
    bullet.loc[bullet["trial"] == 1, "n_void"] = 2
    assert numbers()["physics.engines.bullet.pouring.trials"] == 6
    assert numbers()["physics.engines.bullet.pouring.run"] == 8
    assert numbers()["physics.engines.bullet.pouring.agreement"] == 1.0
    bullet.loc[bullet["trial"] == 0, "failed"] = True
    assert numbers()["physics.engines.bullet.filling.trials"] == 4
    assert numbers()["physics.engines.bullet.filling.failed"] == 2


def test_disagreements_are_told_by_who_says_yes_and_how_near_the_border_they_are():
    """The margins of the four trials are -0.5, -1/6, 1/6 and 0.5; the third is put at the border."""
    liquid, fluid = trials([False, True, True, True]), trials([False, False, False, True])
    liquid.loc[liquid["trial"] == 2, "hydrostatic_margin"] = 0.05
    numbers = engine_numbers(compared(liquid, {"bullet_fluid": fluid}), {})
    head = "physics.engines.bullet_fluid.pouring"
    assert numbers[f"{head}.liquid_alone_share"] == 0.5
    assert numbers[f"{head}.other_alone_share"] == 0.0
    assert numbers[f"{head}.differ_near_share"] == 0.5
    assert numbers[f"{head}.near_share"] == 0.25
    assert numbers[f"{head}.kappa_far"] == pytest.approx(0.4)
    assert numbers[f"{head}.cup.kappa"] == numbers[f"{head}.kappa"]


def test_the_audit_counts_every_trial():
    rows = trials([True, False])
    rows.loc[0, "n_leaked"] = 3
    numbers = trial_numbers(rows)
    assert numbers["physics.pouring.leaked"] == 3
    assert numbers["physics.filling.trials"] == 4


def test_the_pages_are_the_same_bytes_for_the_same_rows(tmp_path):
    rows = trials([True, False, True, True])
    both = compared(rows, {"bullet": rows.head(6), "bullet_fluid": rows})
    for name in ("one.pdf", "two.pdf"):
        save([physics_page.draw(checks(), rows), engines_page.draw(both)], tmp_path / name)
    written = (tmp_path / "one.pdf").read_bytes()
    assert (tmp_path / "two.pdf").read_bytes() == written
    assert written.startswith(b"%PDF")
    assert written.count(b"/Type /Page ") == 2


def test_without_other_engines_there_is_nothing_to_compare():
    rows = trials([True, False])
    assert compared(rows, {}).empty
    assert compared(rows, {"bullet": rows.iloc[:0]}).empty
