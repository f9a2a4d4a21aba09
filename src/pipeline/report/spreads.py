"""How far each parameter of an object goes astray with redrawn points, with k and with the source, beside its error."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from pipeline.artefacts import read_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Error's name: the columns that its spread is of, words, whether it is relative, factor to the unit shown, where colours end.
QUANTITIES = {
    "radius": (["radius_m"], "radius, %", True, 100.0, 3.0),
    "height": (["height_m"], "height, %", True, 100.0, 3.0),
    "hull_volume": (["volume_m3"], "hull volume, %", True, 100.0, 3.0),
    "capacity": (["capacity_m3"], "capacity, %", True, 100.0, 3.0),
    "opening_mm": (["opening_x_m", "opening_y_m", "opening_z_m"], "opening's centre, mm", False, 1e3, 2.0),
    "tilt_reference_deg": (["tilt_reference_rad"], "tilt reference, °", False, 180.0 / np.pi, 2.0),
}
# Spreads by target and kind, and for each kind by quantity, in the unit of the error.
Spreads = dict[str, dict[str, dict[str, float]]]


def spreads(
    processed: Path, source: str, names: Sequence[str], by_k: Sequence[str], errors: Mapping[str, np.ndarray]
) -> Spreads:
    """Return standard deviations by target, kind and quantity, by label mapping; beside them the error with the first source.

    `by_k` are the folders of one method with one k each; errors (sources, targets) are those of `sources.matrices`.
    """
    folder = processed / "parametrise"
    found: Spreads = {}
    for column, name in enumerate(names):
        listed = read_table(folder / source / "uncertainties" / f"{name}.parquet", "uncertainties")
        own = listed[listed["mapping"] == "label_mapping"].set_index("parameter")
        over_k = _rows([folder / source / "by" / by / f"{name}.parquet" for by in by_k])
        over_sources = _rows([folder / other / f"{name}.parquet" for other in names])
        found[name] = {
            "redraws": _spread(own["std"], own["value"]),
            "k": _spread(over_k.std(), over_k.mean()),
            "sources": _spread(over_sources.std(), over_sources.mean()),
            "error": {key: float(errors[key][names.index(source), column]) for key in QUANTITIES},
        }
    return found


def _rows(paths: Sequence[Path]) -> pd.DataFrame:
    tables = pd.concat([read_table(path, "parameters") for path in paths])
    return tables[tables["mapping"] == "label_mapping"].drop(columns=["object", "mapping"])


def _spread(std: pd.Series, value: pd.Series) -> dict[str, float]:
    """Return the spread of each quantity in the unit of its error; those that are not listed are left out."""
    found = {}
    for key, (columns, _, relative, factor, _) in QUANTITIES.items():
        if not set(columns) <= set(std.index):
            continue
        size = float(np.linalg.norm(std[columns]))
        found[key] = size / float(value[columns[0]]) if relative else size * factor
    return found


def spread_numbers(found: Spreads) -> dict[str, float]:
    """Return every spread as `sources.spread.<target>.<quantity>.<kind>`."""
    return {
        f"sources.spread.{name}.{key}.{kind}": value
        for name, kinds in found.items()
        for kind, values in kinds.items()
        if kind != "error"
        for key, value in values.items()
    }


def draw_spreads(found: Spreads, source: str, ks: Sequence[str]) -> "Figure":
    """Return the page: a matrix a quantity, a row a kind of spread, a column an object."""
    import matplotlib.pyplot as plt

    from pipeline.report.matrices import draw_matrix
    from pipeline.report.style import RC

    rows = {
        "redraws": "points redrawn",
        "k": f"k of {', '.join(ks)}",
        "sources": f"{len(found)} sources",
        "error": "error",
    }
    with plt.rc_context(RC):
        figure, axes = plt.subplots(2, 3, figsize=(11.0, 4.2), sharex=True, sharey=True, layout="constrained")
        for axis, (key, (_, words, relative, factor, end)) in zip(axes.flat, QUANTITIES.items(), strict=True):
            shown = np.array([[kinds[kind].get(key, np.nan) for kinds in found.values()] for kind in rows])
            shown = shown * (factor if relative else 1.0)
            draw_matrix(axis, shown, list(rows.values()), list(found), end=end, decimals=2)
            axis.axhline(len(rows) - 1, color="black", lw=0.8)
            axis.set_title(words, fontsize=8)
        figure.suptitle(
            "How sure is a parameter? Standard deviations over redrawn points, over the number k of neighbours of the label "
            "mapping, and over all sources;\nbelow the line the absolute error with the source "
            f"{source.replace('_', ' ')} and k as configured.",
            fontsize=8,
        )
    return figure
