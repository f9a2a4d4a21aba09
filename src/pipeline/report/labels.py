"""Draw the parts of the source, and of every target before and after warping, as the paper's Fig. 2."""

from pathlib import Path
from typing import TYPE_CHECKING

from pipeline import command
from pipeline.artefacts import points, read_table

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's colours; a part drawn later covers the earlier ones, as rim points are container points, too.
PARTS = {"container": "#56B4E9", "rim": "#D55E00", "handle": "#009E73"}
POINTS = 2500
AZIMUTH_RAD, ELEVATION_RAD = 0.6, 0.5


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
    """Return the figure: the source first, then a column a target; initial labels above final ones."""
    import matplotlib.pyplot as plt

    from pipeline.report.style import RC

    with plt.rc_context(RC):
        columns = 1 + len(initial)
        figure, axes = plt.subplots(
            2, columns, figsize=(1.15 * columns, 2.9), squeeze=False, layout="constrained"
        )
        for axis in axes.flat:
            axis.set_axis_off()
        _panel(axes[0, 0], annotated, f"{source}\n(annotated)")
        for column, name in enumerate(initial, start=1):
            _panel(axes[0, column], initial[name], f"{name}\ninitial")
            _panel(axes[1, column], final[name], "final")
        handles = [
            plt.Line2D([], [], marker="o", ls="", ms=4, color=colour, label=part)
            for part, colour in PARTS.items()
        ]
        axes[1, 0].legend(handles=handles, loc="center", frameon=False)
    return figure


def _panel(axis: "Axes", table: "pd.DataFrame", title: str) -> None:
    """Draw points as seen from above and the side, the far ones first."""
    thin = table.iloc[:: max(1, len(table) // POINTS)]
    for part, colour in PARTS.items():
        across, up = _seen(points(thin[thin[part]]))
        axis.scatter(across, up, s=0.6, lw=0, color=colour)
    axis.set_title(title.replace("_", " "), fontsize=7)
    axis.set_aspect("equal")


def _seen(points_m: "np.ndarray") -> "tuple[np.ndarray, np.ndarray]":
    """Return the coordinates across and up (N,) of points (N, 3) in a parallel projection."""
    import numpy as np

    across = np.array([-np.sin(AZIMUTH_RAD), np.cos(AZIMUTH_RAD), 0.0])
    towards = np.array([np.cos(AZIMUTH_RAD), np.sin(AZIMUTH_RAD), 0.0])
    up = np.array([0.0, 0.0, np.cos(ELEVATION_RAD)]) - np.sin(ELEVATION_RAD) * towards
    return points_m @ across, points_m @ up


if __name__ == "__main__":
    command.run(main)
