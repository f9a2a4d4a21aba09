"""Draw the parts of the source, and of every target before and after warping, as the paper's Fig. 2."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipeline import command
from pipeline.artefacts import normals, points, read_table

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's colours; a point has that of the last part it belongs to, as rim points are container points, too.
PARTS = {"container": "#56B4E9", "rim": "#D55E00", "handle": "#009E73"}
POINTS = 2500  # drawn of those that are seen
ELEVATION_RAD, TURN_RAD = 0.5, 0.3
HANDLE_SHARE = 0.02  # of the points, from where on there is a handle
CELL_SPACINGS, BEHIND_MM = 2.0, 8.0  # what is this far behind another point of its cell is not seen
MARGIN_MM, BAR_MM = 4.0, 50.0
INCHES_A_MM = 0.0085


def main() -> None:
    """Read the labels of all objects and the label mappings of the targets; write the figure."""
    parser = command.parser(__doc__)
    parser.add_argument("--source-labels", type=Path, required=True)
    parser.add_argument(
        "--target-labels", type=Path, nargs="*", default=[], help="initial labels, one table a target"
    )
    parser.add_argument(
        "--label-mappings", type=Path, nargs="*", default=[], help="one table a target, same order"
    )
    parser.add_argument("--output", type=Path, required=True)
    options = parser.parse_args()

    from pipeline.report.style import save

    initial = {path.parent.name: read_table(path, "labels") for path in options.target_labels}
    final = {path.parent.name: read_table(path, "mapping") for path in options.label_mappings}
    source = options.source_labels.parent.name
    save(draw(source, read_table(options.source_labels, "labels"), initial, final), options.output)


def draw(
    source: str,
    annotated: "pd.DataFrame",
    initial: "dict[str, pd.DataFrame]",
    final: "dict[str, pd.DataFrame]",
) -> "Figure":
    """Return the figure: the source first, then a column a target, to one scale; initial labels above final ones."""
    import matplotlib.pyplot as plt
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    from pipeline.report.style import RC

    views = {source: _view(annotated), **{name: _view(table) for name, table in final.items()}}
    seen = {name: _seen(table, *views[name]) for name, table in {source: annotated, **final}.items()}
    widths = [np.ptp(own[0]) + 2 * MARGIN_MM for own in seen.values()]
    height = max(np.ptp(own[1]) for own in seen.values()) + 2 * MARGIN_MM
    with plt.rc_context(RC):
        close = ConstrainedLayoutEngine(w_pad=0.0, wspace=0.0, h_pad=0.02)
        size = sum(widths) * INCHES_A_MM, 2 * height * INCHES_A_MM + 0.7
        figure, axes = plt.subplots(
            2, len(widths), figsize=size, squeeze=False, width_ratios=widths, layout=close
        )
        for axis in axes.flat:
            axis.set_axis_off()
        _panel(axes[0, 0], seen[source], height)
        _title(axes[0, 0], f"{source}\n(annotated)")
        for column, name in enumerate(initial, start=1):
            _panel(axes[0, column], _seen(initial[name], *views[name]), height)
            _panel(axes[1, column], seen[name], height)
            _title(axes[0, column], f"{name}\ninitial")
            _title(axes[1, column], "final")
        _legend(axes[1, 0], widths[0], height)
    return figure


def _view(table: "pd.DataFrame") -> tuple[np.ndarray, np.ndarray]:
    """Return an eye's directions (3, 3) to the right, up and to the eye, and the object's middle (3,): a handle is to the right."""
    placed_m = points(table)
    middle_m = (placed_m.min(axis=0) + placed_m.max(axis=0)) / 2.0
    handle = table["handle"].to_numpy(bool)
    right = (
        placed_m[handle].mean(axis=0) - middle_m
        if handle.mean() > HANDLE_SHARE
        else np.array([0.0, 1.0, 0.0])
    )
    azimuth = np.arctan2(right[1], right[0]) - TURN_RAD
    right = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    towards = np.array([right[1], -right[0], 0.0])
    up, eye = np.array([[np.cos(ELEVATION_RAD)], [np.sin(ELEVATION_RAD)]]) * [0.0, 0.0, 1.0]
    return np.stack(
        [right, up - np.sin(ELEVATION_RAD) * towards, eye + np.cos(ELEVATION_RAD) * towards]
    ), middle_m


def _seen(table: "pd.DataFrame", axes: np.ndarray, middle_m: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return what an eye sees, the furthest first: coordinates to the right and up (N,) in millimetres, and colours (N,)."""
    across, up, near = axes @ (points(table) - middle_m).T * 1e3
    colours = np.full(len(table), "#FFFFFF")
    for part, colour in PARTS.items():
        colours[table[part].to_numpy(bool)] = colour
    cell_mm = CELL_SPACINGS * 1e3 * np.sqrt(np.median(table["area_m2"]))
    cells = np.floor(np.column_stack([across, up]) / cell_mm).astype(int)
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    front = np.full(cell.max() + 1, -np.inf)
    np.maximum.at(front, cell, near)
    shown = np.flatnonzero((normals(table) @ axes[2] > 0.0) & (near > front[cell] - BEHIND_MM))
    shown = shown[:: max(1, len(shown) // POINTS)]
    shown = shown[np.argsort(near[shown])]
    return across[shown], up[shown], colours[shown]


def _panel(axis: "Axes", seen: tuple[np.ndarray, ...], height: float) -> None:
    """Draw what is seen of an object on the bottom of its panel."""
    across, up, colours = seen
    axis.scatter(across, up, s=1.1, lw=0, c=colours)
    axis.set_aspect("equal")
    axis.set_xlim(across.min() - MARGIN_MM, across.max() + MARGIN_MM)
    axis.set_ylim(up.min() - MARGIN_MM, up.min() - MARGIN_MM + height)


def _title(axis: "Axes", words: str) -> None:
    axis.set_title(words.replace("_", " "), fontsize=7)


def _legend(axis: "Axes", width: float, height: float) -> None:
    """Draw what colours mean, and how long 50 mm are."""
    import matplotlib.pyplot as plt

    marks = [
        plt.Line2D([], [], marker="o", ls="", ms=4, color=colour, label=part)
        for part, colour in PARTS.items()
    ]
    axis.legend(handles=marks, loc="center left", frameon=False)
    axis.set_aspect("equal")
    axis.set_xlim(0.0, width)
    axis.set_ylim(0.0, height)
    axis.plot([MARGIN_MM, MARGIN_MM + BAR_MM], [MARGIN_MM] * 2, color="black", lw=1.2)
    axis.text(
        MARGIN_MM + BAR_MM / 2.0, 2 * MARGIN_MM, f"{BAR_MM:.0f} mm", ha="center", va="bottom", fontsize=7
    )


if __name__ == "__main__":
    command.run(main)
