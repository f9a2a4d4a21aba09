"""When an execution succeeded, and what it failed of.

Issue of the paper's experiment: enough balls in the cup, most of them poured, next to none beside the second container.
"""

import numpy as np
import pandas as pd

LEAST_BALLS = 100
LEAST_POURED = 0.80  # of what was in the cup
MOST_SPILLED = 2  # balls
MOST_OUTSIDE = 0.02  # of what was poured, of a liquid
FITS = 0.80  # what is poured is at most this share of the second container's capacity
CAUSES = ("arm", "early_pour", "overflow", "aim", "lip", "leak")


def executions(attempts: pd.DataFrame, carried: pd.DataFrame, liquid: bool) -> pd.DataFrame:
    """Return one row an execution with its verdict.

    The last attempt of a draw is the one that the arm followed, if it could; those before were refused.
    """
    key = ["held_object", "target_object", "features", "draw"]
    last = attempts.sort_values([*key, "attempt"]).groupby(key).tail(1)
    rows = last.merge(carried, on=key, how="left", validate="one_to_one")
    rows = rows.rename(columns={"attempt": "n_refused"})
    # Counted from 0, the number of the attempt that went well is how many were refused.
    rows["n_refused"] += (rows["refused"] != "").astype(int)
    rows["cause"] = [cause(row, liquid) for row in rows.itertuples()]
    rows["success"] = rows["cause"] == ""
    counts = [name for name in carried.columns if name.startswith("n_")]
    rows[counts] = rows[counts].fillna(0).astype(np.int64)
    return rows.drop(columns="failed")


def cause(row, liquid: bool) -> str:
    """Return what an execution failed of, nothing when it succeeded.

    arm: no trajectory could be followed. leak: the simulation lost something through a wall. Too much outside: early_pour (left the
    cup before the lip was above the opening), overflow (had been in), aim, whichever is most of it. lip: too little came over it.
    """
    if row.refused:
        return "arm"
    if row.failed or (row.n_balls < LEAST_BALLS and not liquid):
        return "leak"
    allowed = MOST_OUTSIDE * row.n_poured if liquid else MOST_SPILLED
    if row.n_spilled > allowed:
        aimed = row.n_spilled - row.n_early - row.n_overflowed
        shares = {"early_pour": row.n_early, "overflow": row.n_overflowed, "aim": aimed}
        return max(shares, key=lambda name: shares[name])
    return "lip" if row.n_poured < LEAST_POURED * row.n_balls else ""
