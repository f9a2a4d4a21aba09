"""Numbers about the liquid's physics, as flat names: errors against hydrostatics, audits."""

from typing import TYPE_CHECKING

import numpy as np

from pipeline.report.engines import LABELS

if TYPE_CHECKING:
    import pandas as pd

THICK = 120  # fills of fewer particles are thin

Metrics = dict[str, float]


def check_numbers(checks: "pd.DataFrame") -> Metrics:
    """Return the worst errors of each check, as flat names."""
    numbers = _rest_numbers(checks) | _spill_numbers(checks)
    for check in ("capacity", "capacity_uncalibrated"):
        rows = _of(checks, check)
        error = (rows["measured"] / rows["expected"] - 1.0).abs()
        for spacing_m, errors in error.groupby(rows["spacing_m"]):
            numbers[f"physics.{check}.{_mm(spacing_m)}.relative_error_max"] = float(errors.max())
            numbers[f"physics.{check}.{_mm(spacing_m)}.relative_error_mean"] = float(errors.mean())
    retained = _of(checks, "retained")
    brimful_m3 = retained.groupby("vessel")["measured"].transform("max")
    squares = ((retained["measured"] - retained["expected"]) / brimful_m3) ** 2
    for name, square in squares.groupby(retained["vessel"]).mean().items():
        numbers[f"physics.retained.{name}.rms_error_share"] = float(np.sqrt(square))
    for experiment in LABELS:
        for check in ("converge", "repeat"):
            again = _of(checks, f"{check}_{experiment}").dropna()
            if not again.empty:
                head = f"physics.{check}.{experiment}"
                numbers[f"{head}.agreement"] = float((again["measured"] == again["expected"]).mean())
                numbers[f"{head}.trials"] = len(again)
    return numbers


def _rest_numbers(checks: "pd.DataFrame") -> Metrics:
    density, level, speed = (_of(checks, name) for name in ("density", "level", "speed"))
    thick = density["x"] >= THICK
    off = ((level["measured"] - level["expected"]) / level["spacing_m"]).abs()
    leaked = _of(checks, "leaked")
    numbers = {
        "physics.rest.density_error_max": float(density.loc[thick, "measured"].max()),
        "physics.rest.density_error_thin_max": float(density.loc[~thick, "measured"].max()),
        "physics.rest.level_error_spacings_max": float(off[level["x"] >= THICK].max()),
        "physics.rest.level_error_spacings_thin_max": float(off[level["x"] < THICK].max()),
        "physics.thin_walls.pours": len(leaked),
        "physics.thin_walls.leaked": int(leaked["measured"].sum()),
    }
    for name, course in speed.groupby("vessel"):
        course = course.sort_values("x")["measured"]
        numbers[f"physics.rest.{name}.energy_left_share"] = float((course.iloc[-1] / course.iloc[0]) ** 2)
    return numbers


def spill_errors(checks: "pd.DataFrame") -> "pd.DataFrame":
    """Return a row a vessel, spacing and fill: error_rad of the tilt at which pouring begins, and what is allowed.

    Allowed are 3° at the default spacing and half of that at half of it, or one spacing of liquid held back.
    """
    keys = ["vessel", "spacing_m", "x"]
    allowed = _of(checks, "spill_allowed").set_index(keys)["measured"]
    spill = _of(checks, "spill").set_index(keys)
    least = (
        np.radians(3.0) * spill.index.get_level_values("spacing_m") / spill.reset_index()["spacing_m"].max()
    )
    spill["error_rad"] = spill["measured"] - spill["expected"]
    spill["allowed_rad"] = np.maximum(allowed.reindex(spill.index), least)
    return spill.reset_index()


def _spill_numbers(checks: "pd.DataFrame") -> Metrics:
    numbers: Metrics = {}
    for (name, spacing_m), rows in spill_errors(checks).groupby(["vessel", "spacing_m"]):
        head, error = f"physics.spill.{name}.{_mm(spacing_m)}", rows["error_rad"].abs()
        numbers[f"{head}.error_deg_mean"] = float(np.degrees(error.mean()))
        numbers[f"{head}.error_deg_max"] = float(np.degrees(error.max()))
        numbers[f"{head}.within_allowed_share"] = float((error <= rows["allowed_rad"]).mean())
    return numbers


def trial_numbers(trials: "pd.DataFrame") -> Metrics:
    """Return density errors while pouring, and the audit of leaks and failures, over all trials."""
    numbers: Metrics = {}
    for experiment, rows in trials.groupby("experiment"):
        head = f"physics.{experiment}"
        numbers[f"{head}.trials"] = len(rows)
        numbers[f"{head}.leaked"] = int(rows["n_leaked"].sum())
        numbers[f"{head}.failed"] = int(rows["failed"].sum())
        thick = rows["n_particles"] + rows["n_second"] >= THICK
        for kind, part in (("", rows[thick]), ("_thin", rows[~thick])):
            numbers[f"{head}.density_error{kind}_mean"] = float(part["density_error"].mean())
            numbers[f"{head}.density_error{kind}_max"] = float(part["density_error"].max())
    return numbers


def _of(checks: "pd.DataFrame", name: str) -> "pd.DataFrame":
    return checks[checks["check"] == name].copy()


def _mm(spacing_m: float) -> str:
    return f"{spacing_m * 1e3:g}_mm"
