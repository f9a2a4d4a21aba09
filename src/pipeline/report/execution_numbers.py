"""Rates of success with their intervals, what executions failed of, and how safely cups were carried."""

import numpy as np
import pandas as pd

PAIR = ["held_object", "target_object"]
RESAMPLES = 2000
_Z = 1.959964  # 95 %


def wilson(successes: int, n: int) -> tuple[float, float]:
    """Return Wilson's 95 % interval of a rate."""
    rate, z2 = successes / n, _Z**2 / n
    centre = (rate + z2 / 2.0) / (1.0 + z2)
    half = _Z * np.sqrt(rate * (1.0 - rate) / n + z2 / n / 4.0) / (1.0 + z2)
    return max(0.0, centre - half), min(1.0, centre + half)


def clustered(rows: pd.DataFrame, name: str = "success", seed: int = 0) -> tuple[float, float]:
    """Return a 95 % interval of the rate of `name` by bootstrap over pairs: a pair's executions are not independent."""
    by_pair = rows.groupby(PAIR)[name].mean().to_numpy()
    drawn = np.random.default_rng(seed).integers(0, len(by_pair), (RESAMPLES, len(by_pair)))
    low, high = np.quantile(by_pair[drawn].mean(axis=1), [0.025, 0.975])
    return float(low), float(high)


def first_sample(executions: pd.DataFrame) -> pd.Series:
    """Return of each execution whether it succeeded with its first sample: a refused one counts as a failure, not as a redraw."""
    return executions["success"] & (executions["n_refused"] == 0)


def by_pair(executions: pd.DataFrame) -> pd.DataFrame:
    """Return one row a pair and feature set: executions, successes, refused samples, the most frequent causes in words."""
    rows = []
    for (held, target, features), part in executions.groupby([*PAIR, "features"], sort=False):
        causes = part.loc[~part["success"], "cause"].value_counts()
        rows.append(
            {
                **{"held_object": held, "target_object": target, "features": features},
                **{"n": len(part), "successes": int(part["success"].sum())},
                "first_successes": int(first_sample(part).sum()),
                "refused_share": part["n_refused"].sum()
                / (part["n_refused"] + (part["cause"] != "arm")).sum(),
                "spilled_share": part["n_spilled"].sum() / max(part["n_balls"].sum(), 1),
                "causes": ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in causes.items()),
            }
        )
    return pd.DataFrame(rows)


def unsafe(trajectories: pd.DataFrame, parameters: pd.DataFrame) -> pd.DataFrame:
    """Return, a pair and feature set, the share of executions in which the tilt is above its reference while the lip is outside.

    Outside: further than the radius from the opening's axis. `way_in`: before it has been inside for the first time; `ever`: at any
    time, the way back with an empty cup too. References by label mapping, whatever moved the arm.
    """
    warped = parameters[parameters["mapping"] == "label_mapping"].set_index("object")
    rows = []
    for key, run in trajectories.groupby([*PAIR, "features", "draw"], sort=False):
        held, target, features, _ = key
        off_m = np.hypot(run["lip_x_m"], run["lip_y_m"]).to_numpy()
        outside = off_m > warped.at[target, "radius_m"]
        tilted = run["tilt_rad"].to_numpy() > warped.at[held, "tilt_reference_rad"]
        on_way_in = np.cumsum(~outside) == 0
        both = outside & tilted
        flags = {"way_in": bool((both & on_way_in).any()), "ever": bool(both.any())}
        rows.append(dict(zip([*PAIR, "features"], (held, target, features), strict=True)) | flags)
    return (
        pd.DataFrame(rows).groupby([*PAIR, "features"], sort=False)[["way_in", "ever"]].mean().reset_index()
    )


def with_drawn(executed: pd.DataFrame, drawn: pd.DataFrame) -> pd.DataFrame:
    """Return what `unsafe` told of executions beside what the stage execute drew (table `safety`): drawn_way_in, drawn_ever."""
    names = {"way_in": "drawn_way_in", "ever": "drawn_ever"}
    both = drawn.drop(columns="samples").rename(columns=names)
    return both.merge(executed, how="left", on=[*PAIR, "features"])


def numbers(
    executions: pd.DataFrame, safety: pd.DataFrame, demonstrated: tuple[str, str]
) -> dict[str, float]:
    """Return all headline numbers, flat: execution.<features>.…"""
    found: dict[str, float] = {}
    novel = executions[
        (executions["held_object"] + "/" + executions["target_object"]) != "/".join(demonstrated)
    ]
    for features, rows in executions.groupby("features"):
        key = f"execution.{features}"
        for name, part in (("", rows), (".novel", novel[novel["features"] == features])):
            if len(part):
                found |= {f"{key}{name}.{what}": value for what, value in _rates(part).items()}
        attempts = (rows["n_refused"] + (rows["cause"] != "arm")).sum()
        found[f"{key}.refused_share"] = float(rows["n_refused"].sum() / attempts)
        for cause, count in rows.loc[~rows["success"], "cause"].value_counts().items():
            found[f"{key}.failed.{cause}"] = int(count)
    for row in by_pair(executions).itertuples():
        key = f"execution.{row.features}.{row.held_object}.{row.target_object}"
        found |= {f"{key}.success": row.successes / row.n, f"{key}.spilled_share": float(row.spilled_share)}
    for row in safety.itertuples():
        key = f"execution.{row.features}.{row.held_object}.{row.target_object}.tilted_outside"
        if row.way_in == row.way_in:  # nothing to tell of a pair that the arm never followed
            found |= {f"{key}.way_in": float(row.way_in), f"{key}.ever": float(row.ever)}
        found |= {f"{key}.drawn_way_in": float(row.drawn_way_in), f"{key}.drawn_ever": float(row.drawn_ever)}
    return found


def _rates(part: pd.DataFrame) -> dict[str, float]:
    """Return the rate of success with its interval over pairs, refused samples redrawn, and as failures (first_sample)."""
    rows = part.assign(first_sample=first_sample(part))
    found: dict[str, float] = {"executions": len(rows)}
    for name in ("success", "first_sample"):
        low, high = clustered(rows, name)
        found |= {name: float(rows[name].mean()), f"{name}_low": low, f"{name}_high": high}
    return found
