"""A matrix of numbers as colours with the numbers in them."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_matrix(
    axis: "Axes",
    shown: np.ndarray,
    rows: Sequence[str],
    columns: Sequence[str],
    *,
    end: float,
    decimals: int,
    higher_is_better: bool = False,
) -> None:
    """Draw a matrix (rows, columns): dark where bad, at `end` darkest (at 0, where higher is better); a dash where it is nan.

    Names go to the axes.
    """
    dark = end - shown if higher_is_better else shown
    axis.pcolormesh(
        np.ma.masked_invalid(dark), cmap="cividis_r", vmin=0.0, vmax=end, edgecolors="white", linewidth=0.4
    )
    for (row, column), value in np.ndenumerate(shown):
        colour = "white" if dark[row, column] > 0.6 * end else "black"
        text = f"{value:.{decimals}f}" if np.isfinite(value) else "–"
        axis.text(column + 0.5, row + 0.5, text, ha="center", va="center", fontsize=6, color=colour)
    axis.set_xticks(np.arange(len(columns)) + 0.5, _words(columns), rotation=50, ha="right", fontsize=6)
    axis.set_yticks(np.arange(len(rows)) + 0.5, _words(rows), fontsize=6)
    axis.set_ylim(len(rows), 0)
    axis.tick_params(length=0)


def _words(names: Sequence[str]) -> list[str]:
    return [name.replace("_", " ") for name in names]
