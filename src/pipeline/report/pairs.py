"""Every object poured into every other with the liquid: reports/pairs.pdf, heat maps and a table, and the numbers."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipeline import command
from pipeline.artefacts import read_table, write_json
from pipeline.report.execution_numbers import PAIR, by_pair, clustered
from pipeline.report.style import RC, WORDS

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ROWS_A_PAGE = 66


def main() -> None:
    """Read the executions; write the pages and the numbers."""
    parser = command.parser(__doc__)
    for name in ("--executions", "--page", "--numbers"):
        parser.add_argument(name, type=Path, required=True)
    options = parser.parse_args()

    from pipeline.report.style import save

    executions = read_table(options.executions, "executions")
    save([maps(executions), *failures(executions)], options.page)
    write_json(options.numbers, numbers(executions))


def numbers(executions: "pd.DataFrame") -> dict[str, float]:
    """Return rates over all pairs that fit, with intervals over pairs, and what the others failed of: pairs.<features>.…"""
    found: dict[str, float] = {}
    for features, rows in executions.groupby("features"):
        key, fit = f"pairs.{features}", rows[rows["fits"]]
        low, high = clustered(fit)
        found |= {
            f"{key}.fit.pairs": len(fit[PAIR].drop_duplicates()),
            f"{key}.all.pairs": len(rows[PAIR].drop_duplicates()),
        }
        found |= {
            f"{key}.fit.success": float(fit["success"].mean()),
            f"{key}.all.success": float(rows["success"].mean()),
        }
        found |= {f"{key}.fit.success_low": low, f"{key}.fit.success_high": high}
        moved = fit[fit["cause"] != "arm"]
        found[f"{key}.fit.success_where_the_arm_moved"] = float(moved["success"].mean())
        for cause, count in fit.loc[~fit["success"], "cause"].value_counts().items():
            found[f"{key}.fit.failed.{cause}"] = int(count)
    return found


def maps(executions: "pd.DataFrame") -> "Figure":
    """Return a heat map a feature set: the share of what was poured that ended outside, held object × second container."""
    import matplotlib.pyplot as plt

    names = sorted(set(executions["held_object"]) | set(executions["target_object"]))
    sets = [name for name in WORDS if name in set(executions["features"])]
    with plt.rc_context({**RC, "axes.spines.top": True, "axes.spines.right": True}):
        figure, axes = plt.subplots(
            1,
            len(sets),
            figsize=(2.9 * len(sets) + 1.3, 3.9),
            sharey=True,
            squeeze=False,
            layout="constrained",
        )
        for axis, features in zip(axes[0], sets, strict=True):
            image = _map(axis, executions[executions["features"] == features], names)
            axis.set_title(WORDS[features])
        axes[0, 0].set_ylabel("held object")
        bar = figure.colorbar(image, ax=axes[0], shrink=0.75)
        bar.set_label("spilled, % of what was poured\n(grey: itself, or the arm could follow no sample)")
        figure.supxlabel(
            "second container (○: what is poured does not fit; ×: fewer than 9 of 10 succeed)", fontsize=8
        )
    return figure


def _map(axis: "Axes", rows: "pd.DataFrame", names: list[str]):
    grid = np.full((len(names), len(names)), np.nan)
    for (held, target), part in rows.groupby(PAIR):
        at = names.index(held), names.index(target)
        if part["n_poured"].sum():
            grid[at] = 100.0 * part["n_spilled"].sum() / part["n_poured"].sum()
        mark = "o" if not part["fits"].all() else "x" if part["success"].mean() < 0.9 else ""
        if mark:
            axis.plot(at[1], at[0], marker=mark, ms=4, color="black", mfc="none", mew=0.8)
    axis.set_facecolor("0.8")
    image = axis.imshow(grid, cmap="viridis_r", vmin=0.0, vmax=100.0)
    words = [name.replace("_", " ") for name in names]
    axis.set_xticks(range(len(names)), words, rotation=90)
    axis.set_yticks(range(len(names)), words)
    return image


def failures(executions: "pd.DataFrame") -> "list[Figure]":
    """Return pages with a line for every pair that fits and does not always succeed, with its causes."""
    import matplotlib.pyplot as plt

    table = by_pair(executions[executions["fits"]])
    lines = [
        f"{row.held_object:>13} → {row.target_object:<13} {WORDS[row.features]:<18}"
        f"{row.successes:>3} of {row.n:<3} {100 * row.spilled_share:5.1f} % spilled   {row.causes}"
        for row in table.itertuples()
        if row.successes < row.n
    ]
    pages = []
    for first in range(0, max(len(lines), 1), _ROWS_A_PAGE):
        with plt.rc_context(RC):
            figure = plt.figure(figsize=(8.27, 11.69))
        title = "Pairs that fit and do not always succeed: executions, spilled of what was in the cup, causes"
        figure.text(0.06, 0.965, title, fontsize=9, va="top")
        text = "\n".join(lines[first : first + _ROWS_A_PAGE]) or "none"
        figure.text(0.06, 0.945, text, fontsize=6.5, family="monospace", va="top", linespacing=1.5)
        pages.append(figure)
    return pages


if __name__ == "__main__":
    command.run(main)
