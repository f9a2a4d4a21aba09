"""The paper's claims about its robot (section IV-B), each in its words, as a number a pair, and whether it holds here.

Numbers are of label mapping, intervals a bootstrap's over pairs: pours of one pair are not independent.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from pipeline.report.claims import answer
from pipeline.report.execution_numbers import PAIR, clustered

FEATURES = "label_mapping"
NOTE = (
    "By label mapping; intervals are a bootstrap's over pairs; not sure: the interval has both answers. What holds is our "
    "reading:\nnine pours of ten; three balls in the paper's thirty; beyond two standard deviations; more than half of the pours."
)
COUPLE = 3 / 30  # balls a pour
BEYOND_TWO_DEVIATIONS = 0.023  # of a normal distribution, on one side of the paper's shaded region


@dataclass(frozen=True)
class Claim:
    """The paper's `words`, what the `column` of the pours' table is, and when its mean `holds`."""

    name: str
    words: str
    measure: str
    column: str
    holds: Callable[[float], bool]


CLAIMS = (
    Claim(
        "robot_pours_novel_objects",
        "the robot successfully learned to pour from a shorter cup into a bigger bowl, a smaller cup, and a square bowl",
        "novel pairs: share of pours that succeed",
        "success",
        lambda x: x >= 0.9,
    ),
    Claim(
        "robot_spills_a_couple",
        "only a couple of gel balls were spilled during the experiments",
        "novel pairs: balls beside the target, a pour",
        "n_spilled",
        lambda x: x <= COUPLE,
    ),
    Claim(
        "robot_keeps_below_one",
        "the distribution over trajectories remains safely below this value [one] until the lip point is above the opening",
        "all pairs: share of drawn trajectories that tilt above one before the lip has come above the opening",
        "way_in",
        lambda x: x <= BEYOND_TWO_DEVIATIONS,
    ),
    Claim(
        "robot_pours_near_the_rim",
        "the cup was often placed close to the rim of the second container",
        "all pairs: share of pours whose lip is nearer to the rim than to the centre of the opening when the first ball drops",
        "near_rim",
        lambda x: x > 0.5,
    ),
)


def claim_rows(
    executions: pd.DataFrame,
    trajectories: pd.DataFrame,
    safety: pd.DataFrame,
    parameters: pd.DataFrame,
    demonstrated: tuple[str, str],
) -> pd.DataFrame:
    """Return a row a claim, with the columns of `evaluation_numbers.claim_rows`; `safety` is that of drawn trajectories."""
    pours = executions[(executions["features"] == FEATURES) & (executions["cause"] != "arm")]
    novel = pours[(pours["held_object"] + "/" + pours["target_object"]) != "/".join(demonstrated)]
    pours = pours.assign(near_rim=near_rim(pours, trajectories, parameters))
    tables = {
        "success": novel,
        "n_spilled": novel,
        "way_in": safety[safety["features"] == FEATURES],
        "near_rim": pours.dropna(subset="near_rim"),
    }
    return pd.DataFrame(_row(claim, tables[claim.column]) for claim in CLAIMS if len(tables[claim.column]))


def near_rim(pours: pd.DataFrame, trajectories: pd.DataFrame, parameters: pd.DataFrame) -> np.ndarray:
    """Return of each pour 1 if its lip is nearer to the rim than to the opening's axis at the first drop, else 0, or nan."""
    radius_m = parameters[parameters["mapping"] == FEATURES].set_index("object")["radius_m"]
    runs = dict(list(trajectories[trajectories["features"] == FEATURES].groupby([*PAIR, "draw"])))
    found = []
    for pour in pours.itertuples():
        run = runs.get((pour.held_object, pour.target_object, pour.draw))
        if run is None or not np.isfinite(pour.first_drop_s):
            found.append(np.nan)
            continue
        at = run.iloc[int(np.argmin(np.abs(run["t_s"].to_numpy() - pour.first_drop_s)))]
        off = np.hypot(at["lip_x_m"], at["lip_y_m"]) / radius_m[pour.target_object]
        found.append(float(off > 0.5))
    return np.array(found)


def _row(claim: Claim, table: pd.DataFrame) -> dict:
    value = float(table.groupby(PAIR)[claim.column].mean().mean())
    head = {"name": claim.name, "section": "IV-B", "words": claim.words, "measure": claim.measure}
    return {**head, **answer(claim.holds, value, *clustered(table, claim.column)), "why": ""}
