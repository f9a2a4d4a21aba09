"""When the classifiers foresee the first drop, and whether they foresee a spill: events of executed pours, and their numbers."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

if TYPE_CHECKING:
    from pipeline.watching import Watcher

PAIR = ["held_object", "target_object"]
EXECUTION = [*PAIR, "features", "draw"]
LIKELY = 0.5


@dataclass(frozen=True)
class Curve:
    """p(pour) and p(fill) (T,) along one execution, by classifiers of one set; outside (T,): the lip is not above the opening."""

    execution: tuple[str, str, str, int]
    classifiers: str
    t_s: np.ndarray
    tilt_rad: np.ndarray
    pour: np.ndarray
    fill: np.ndarray
    outside: np.ndarray


def curves(
    trajectories: pd.DataFrame,
    watchers: "Mapping[tuple[str, str, str], Watcher]",
    fill_m3: "pd.Series",
    radius_m: "pd.Series",
) -> list[Curve]:
    """Return a curve an execution and set of classifiers; fill_m3, radius_m: of each object, what it held and its opening's."""
    found = []
    for key, run in trajectories.groupby(EXECUTION, sort=True):
        states = run[["lip_x_m", "lip_y_m", "lip_z_m", "tilt_rad"]].to_numpy(float)
        for (held, target, classifiers), watcher in watchers.items():
            if (held, target) == key[:2]:
                pour, fill = watcher.along(states, fill_m3[held]).T
                time = run["t_s"].to_numpy(float), states[:, 3]
                outside = np.hypot(states[:, 0], states[:, 1]) > radius_m[target]
                found.append(Curve(key, classifiers, *time, pour, fill, outside))
    return found


def events(found: list[Curve], outcomes: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Return one row a curve and kind of contents: how long before the first drop p(pour) passed one half, and so on.

    lead_s, lead_deg: positive where it passed before the drop; p_fill: at the first drop; clean: nothing came to lie beside the
    second. When pouring was likely for the first time, while the cup still leaned further, and filling was not (unlikely_s), or
    the lip was outside the opening (outside_s).
    """
    rows = []
    for contents, table in outcomes.items():
        by_key = table.set_index(EXECUTION)
        for curve in found:
            if curve.execution in by_key.index:
                outcome = by_key.loc[curve.execution]
                names = dict(zip(EXECUTION, curve.execution, strict=True))
                head = {**names, "classifiers": curve.classifiers, "contents": contents}
                rows.append(head | _event(curve, outcome))
    return pd.DataFrame(rows)


def _event(curve: Curve, outcome: pd.Series) -> dict[str, Any]:
    likely = np.flatnonzero(curve.pour > LIKELY)
    found: dict[str, Any] = {
        "clean": outcome["n_spilled"] == 0,
        "spill_s": outcome["first_spill_s"],
        "unlikely_s": _alarm_s(curve, curve.fill < LIKELY),
        "outside_s": _alarm_s(curve, curve.outside),
        **{"lead_s": np.nan, "lead_deg": np.nan, "p_fill": np.nan},
    }
    drop_s = outcome["first_drop_s"]
    if np.isfinite(drop_s):
        found["p_fill"] = float(np.interp(drop_s, curve.t_s, curve.fill))
        if len(likely):
            first = likely[0]
            tilt_at_drop = np.interp(drop_s, curve.t_s, curve.tilt_rad)
            found["lead_s"] = drop_s - curve.t_s[first]
            found["lead_deg"] = np.degrees(tilt_at_drop - curve.tilt_rad[first])
    return found


def _alarm_s(curve: Curve, bad: np.ndarray) -> float:
    """Return when pouring was likely in a bad place for the first time; the way back with an empty cup is left out."""
    alarm = np.flatnonzero((curve.pour > LIKELY) & bad)
    return float(curve.t_s[alarm[0]]) if len(alarm) and alarm[0] <= curve.tilt_rad.argmax() else np.nan


def numbers(rows: pd.DataFrame) -> dict[str, float]:
    """Return the numbers of each set of classifiers and kind of contents, flat: watching.<classifiers>.<contents>.…"""
    found: dict[str, float] = {}
    for (classifiers, contents), part in rows.groupby(["classifiers", "contents"], sort=False):
        key = f"watching.{classifiers}.{contents}"
        found[f"{key}.executions"] = len(part)
        dropped = part.dropna(subset=["p_fill"])
        found[f"{key}.not_foreseen"] = float((~(dropped["lead_s"] >= 0.0)).mean())
        for name in ("lead_s", "lead_deg"):
            values = part[name].dropna()
            low, median, high = np.quantile(values, [0.05, 0.5, 0.95])
            found |= {f"{key}.{name}": float(median), f"{key}.{name}_05": float(low)}
            found[f"{key}.{name}_95"] = float(high)
            # How differently they speak of different cups: of what they say of one, the median.
            medians = values.groupby(part["held_object"]).median()
            found[f"{key}.{name}_between_objects"] = float(medians.std(ddof=0))
        found |= {f"{key}.{name}": value for name, value in _spills(part).items()}
    return found


def _spills(part: pd.DataFrame) -> dict[str, float]:
    from sklearn.metrics import roc_auc_score

    found: dict[str, float] = {"clean": float(part["clean"].mean())}
    spilled, clean = part[~part["clean"]], part[part["clean"]]
    for alarm in ("unlikely", "outside"):
        at_s = part[f"{alarm}_s"]
        if len(clean):
            found[f"{alarm}.of_the_clean"] = float(at_s[clean.index].notna().mean())
        if len(spilled):
            lead_s = spilled["spill_s"] - at_s[spilled.index]
            found[f"{alarm}.before_the_spill"] = float((lead_s >= 0.0).mean())
            if lead_s.notna().any():
                found[f"{alarm}.lead_s"] = float(lead_s.median())
    known = part.dropna(subset=["p_fill"])
    if known["clean"].nunique() == 2:
        found["p_fill_auc"] = float(roc_auc_score(known["clean"], known["p_fill"]))
    return found
