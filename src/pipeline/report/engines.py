"""The same trials by the liquid and by another engine: which labels agree, by how much, and where they do not."""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

LABELS = {"pouring": "poured", "filling": "filled"}
NEAR = 0.1  # of a hydrostatic margin: labels that near to the border may differ for any reason
WORDS = {"liquid": "liquid", "bullet": "gel balls", "bullet_fluid": "Bullet's fluid"}
_DRAW = ["experiment", "object", "trial", "seed", "n_void"]

Metrics = dict[str, float]


def compared(liquid: "pd.DataFrame", others: "dict[str, pd.DataFrame]") -> "pd.DataFrame":
    """Return a row for each trial that the liquid and another engine ran alike.

    engine; label_liquid, label_other; left_liquid, left_other, shares of the held cup's particles; tilt_rad; fill, a share of
    the object's largest; margin, of hydrostatics. The same draw of the same trial: one that is void for one engine alone is
    another trial for the other.
    """
    import pandas as pd

    tables = [_pair(liquid, other, name) for name, other in others.items() if len(other)]
    return pd.concat(tables, ignore_index=True) if tables else _pair(liquid, liquid.iloc[:0], "")


def _pair(liquid: "pd.DataFrame", other: "pd.DataFrame", engine: str) -> "pd.DataFrame":
    import pandas as pd

    both = liquid.merge(other, on=_DRAW, suffixes=("_liquid", "_other"))
    both = both[~both["failed_liquid"] & ~both["failed_other"]]
    pouring = both["experiment"] == "pouring"
    columns = {"engine": engine, **{key: both[key] for key in _DRAW}}
    for who in ("liquid", "other"):
        columns[f"label_{who}"] = both[f"poured_{who}"].where(pouring, both[f"filled_{who}"])
        columns[f"left_{who}"] = both[f"n_left_{who}"] / both[f"n_particles_{who}"].clip(lower=1)
    fill_m3 = both["fill_m3_liquid"].where(pouring, both["second_fill_m3_liquid"])
    fullest_m3 = fill_m3.groupby([both["experiment"], both["object"]]).transform("max")
    return pd.DataFrame(
        {
            **columns,
            "tilt_rad": both["tilt_rad_liquid"],
            "fill": fill_m3 / fullest_m3,
            "margin": both["hydrostatic_margin_liquid"],
        }
    )


def engine_numbers(both: "pd.DataFrame", others: "dict[str, pd.DataFrame]") -> Metrics:
    """Return, for each engine and experiment, Cohen's κ and how labels agree, by object and in all; what leaked and failed."""
    numbers: Metrics = {}
    for (engine, experiment), rows in both.groupby(["engine", "experiment"]):
        head = f"physics.engines.{engine}.{experiment}"
        numbers |= {f"{head}.{key}": value for key, value in _agreement(rows).items()}
        for name, part in rows.groupby("object"):
            numbers[f"{head}.{name}.kappa"] = kappa(part["label_liquid"], part["label_other"])
    for engine, table in others.items():
        for experiment, rows in table.groupby("experiment"):
            head = f"physics.engines.{engine}.{experiment}"
            numbers[f"{head}.leaked"] = int(rows["n_leaked"].sum())
            numbers[f"{head}.failed"] = int(rows["failed"].sum())
            numbers[f"{head}.run"] = len(rows)
    return numbers


def _agreement(rows: "pd.DataFrame") -> Metrics:
    liquid, other, near = rows["label_liquid"], rows["label_other"], rows["margin"].abs() <= NEAR
    differ = liquid != other
    return {
        "trials": len(rows),
        "agreement": float((~differ).mean()),
        "kappa": kappa(liquid, other),
        "kappa_far": kappa(liquid[~near], other[~near]),
        "other_alone_share": float((other & ~liquid).mean()),
        "liquid_alone_share": float((liquid & ~other).mean()),
        "near_share": float(near.mean()),
        "differ_near_share": float(near[differ].mean()) if differ.any() else np.nan,
    }


def kappa(one: "pd.Series", other: "pd.Series") -> float:
    """Return Cohen's κ of two raters' yes and no; NaN when chance alone makes them agree."""
    a, b = one.to_numpy(bool), other.to_numpy(bool)
    if not len(a):
        return np.nan
    chance = a.mean() * b.mean() + (1.0 - a.mean()) * (1.0 - b.mean())
    return float(((a == b).mean() - chance) / (1.0 - chance)) if chance < 1.0 else np.nan
