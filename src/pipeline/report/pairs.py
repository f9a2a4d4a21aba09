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

_ROWS_A_PAGE = 62
_LIGHT_FROM = 55.0  # per cent: darker, a black number is not read
_LEGEND = (
    "In the heads: of all executions with pairs that fit, with a 95 % interval over pairs. Empty: all succeeded.\n"
    "arm: could follow no sample; early pour: came down before the lip was above the opening; overflow: had been in;\n"
    "aim: fell beside it; lip: less than 80 % came over it; leak: the simulation lost something. One cause an execution: of\n"
    "what was spilled the largest."
)


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
    sets = _sets(executions)
    with plt.rc_context({**RC, "axes.spines.top": True, "axes.spines.right": True}):
        figure, axes = plt.subplots(
            1,
            len(sets),
            figsize=(2.9 * len(sets) + 1.3, 4.6),
            sharey=True,
            squeeze=False,
            layout="constrained",
        )
        for axis, features in zip(axes[0], sets, strict=True):
            image = _map(axis, executions[executions["features"] == features], names)
            axis.set_title(WORDS[features])
        axes[0, 0].set_ylabel("held object")
        bar = figure.colorbar(image, ax=axes[0], shrink=0.75)
        bar.set_label("spilled, % of what was poured")
        figure.supxlabel(
            "second container\nnumbers: successes of ten, where not all; ○: what is poured does not fit;\n"
            "grey: the arm could follow no sample, or none was tried",
            fontsize=8,
        )
    return figure


def _sets(executions: "pd.DataFrame") -> list[str]:
    return [name for name in WORDS if name in set(executions["features"])]


def _map(axis: "Axes", rows: "pd.DataFrame", names: list[str]):
    grid = np.full((len(names), len(names)), np.nan)
    for (held, target), part in rows.groupby(PAIR):
        at = names.index(held), names.index(target)
        if part["n_poured"].sum():
            grid[at] = 100.0 * part["n_spilled"].sum() / part["n_poured"].sum()
        mark = "○" if not part["fits"].all() else "" if part["success"].all() else str(part["success"].sum())
        light = grid[at] > _LIGHT_FROM
        axis.text(*at[::-1], mark, ha="center", va="center", fontsize=6, color="white" if light else "black")
    axis.set_facecolor("0.8")
    image = axis.imshow(grid, cmap="magma_r", vmin=0.0, vmax=100.0)
    words = [name.replace("_", " ") for name in names]
    axis.set_xticks(range(len(names)), words, rotation=90)
    axis.set_yticks(range(len(names)), words)
    return image


def failures(executions: "pd.DataFrame") -> "list[Figure]":
    """Return pages with a row for every pair that fits and does not always succeed, with the causes of each feature set."""
    fit = executions[executions["fits"]]
    sets, found = _sets(fit), numbers(fit)
    heads = [f"{WORDS[name]}\n{_rate(found, name)}" for name in sets]
    table = by_pair(fit).set_index([*PAIR, "features"])
    failing = [pair for pair, part in fit.groupby(PAIR) if not part["success"].all()]
    rows = [[_words(pair), *(_told(table, (*pair, name)) for name in sets)] for pair in failing] or [
        ["none", *([""] * len(sets))]
    ]
    return [_page(heads, rows[first : first + _ROWS_A_PAGE]) for first in range(0, len(rows), _ROWS_A_PAGE)]


def _words(pair: tuple[str, str]) -> str:
    return " → ".join(name.replace("_", " ") for name in pair)


def _rate(found: dict[str, float], features: str) -> str:
    rate, low, high = (100 * found[f"pairs.{features}.fit.success{end}"] for end in ("", "_low", "_high"))
    return f"{rate:.0f} % [{low:.0f}, {high:.0f}]"


def _told(table: "pd.DataFrame", key: tuple[str, str, str]) -> str:
    """Return successes and causes in words; nothing where all succeeded or none was tried."""
    if key not in table.index or table.loc[key, "successes"] == table.loc[key, "n"]:
        return ""
    return f"{table.loc[key, 'successes']}: {table.loc[key, 'causes']}"


def _page(heads: list[str], rows: list[list[str]]) -> "Figure":
    import matplotlib.pyplot as plt

    with plt.rc_context(RC):
        figure = plt.figure(figsize=(8.27, 11.69))
    figure.text(
        0.05,
        0.965,
        "Pairs that fit and do not always succeed: successes, and what the others failed of",
        fontsize=9,
    )
    figure.text(0.05, 0.955, _LEGEND, fontsize=7, va="top", linespacing=1.4)
    lefts = [0.05, *(0.22 + 0.765 * number / len(heads) for number in range(len(heads)))]
    for left, head in zip(lefts[1:], heads, strict=True):
        figure.text(left, 0.88, head, fontsize=7, va="bottom")
    for number, row in enumerate(rows):
        for left, text in zip(lefts, row, strict=True):
            figure.text(left, 0.868 - 0.0133 * number, text, fontsize=5.8, va="center")
    return figure


if __name__ == "__main__":
    command.run(main)
