"""The parameters as tables: value, uncertainty, and error where the true value is known."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import pandas as pd

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Parameter: its key among the errors, and what the error there is in; a relative one is shown in per cent.
ERRORS = {
    "radius_m": ("radius", "%"),
    "height_m": ("height", "%"),
    "volume_m3": ("hull_volume", "%"),
    "capacity_m3": ("capacity", "%"),
    "wall_m": ("wall", "%"),
    "opening_z_m": ("opening_mm", "mm"),
    "tilt_reference_rad": ("tilt_reference_deg", "°"),
    "tilt_reference_cavity_rad": ("tilt_reference_cavity_deg", "°"),
}
# How units are shown: factor, name, decimals.
SHOWN = {"m": (1e3, "mm", 2), "m3": (1e6, "ml", 1), "rad": (57.29577951308232, "°", 1), "1": (1.0, "", 2)}
WORDS = {"label_mapping": "label mapping", "point_mapping": "point mapping"}
ROWS = 28  # a page


def table(listed: pd.DataFrame, errors: Mapping[str, Mapping[str, float]]) -> "list[Figure]":
    """Return a page or more a mapping: a row a parameter, a column an object; value ± std, and the error in brackets."""
    pages = []
    for mapping, word in WORDS.items():
        own = listed[listed["mapping"] == mapping]
        names = list(dict.fromkeys(own["parameter"]))
        for start in range(0, len(names), ROWS):
            pages.append(_page(own, names[start : start + ROWS], errors, mapping, word))
    return pages


def _page(own: pd.DataFrame, names: list[str], errors: Mapping, mapping: str, word: str) -> "Figure":
    import matplotlib.pyplot as plt
    from matplotlib.transforms import Bbox

    from pipeline.report.style import RC

    objects = list(dict.fromkeys(own["object"]))
    rows = own.set_index(["parameter", "object"])
    units = own.drop_duplicates("parameter").set_index("parameter")["unit"]
    cells = [
        [_cell(rows.loc[(name, thing)], name, errors.get(thing, {}), mapping) for thing in objects]
        for name in names
    ]
    with plt.rc_context(RC):
        size = 2.3 + 1.15 * len(objects), 1.0 + 0.24 * len(names)
        figure, axis = plt.subplots(figsize=size, layout="constrained")
        axis.set_axis_off()
        axis.set_title(
            f"Parameters by {word}: value ± standard deviation (error, where the truth is known;"
            " the opening's is the distance of its centre)",
            loc="left",
        )
        drawn = axis.table(
            cells,
            rowLabels=[_title(name, units[name]) for name in names],
            colLabels=[thing.replace("_", " ") for thing in objects],
            cellLoc="right",
            loc="upper left",
            bbox=Bbox.unit(),
            edges="horizontal",
        )
        drawn.auto_set_font_size(False)
        drawn.set_fontsize(5.8)
        for place in drawn.get_celld().values():
            place.set_linewidth(0.3)
            place.set_edgecolor("0.6")
    return figure


def _title(name: str, unit: str) -> str:
    shown = SHOWN.get(unit, (1.0, unit, 3))[1]
    stem = name if unit == "1" else name.removesuffix(f"_{unit}")
    stem = " ".join(
        f"{int(word)}°" if word.isdigit() else word for word in stem.removesuffix("_deg").split("_")
    )
    return f"{stem}, {shown}" if shown else stem


def _cell(row: pd.Series, name: str, errors: Mapping[str, float], mapping: str) -> str:
    if pd.isna(row["value"]):
        return "–"
    factor, _, decimals = SHOWN.get(row["unit"], (1.0, row["unit"], 3))
    text = f"{row['value'] * factor:z.{decimals}f} ± {row['std'] * factor:.{decimals}f}".replace("-", "−")
    key, unit = ERRORS.get(name, ("", ""))
    error = errors.get(f"parametrise.{mapping}.{key}")
    if error is None:
        return text
    shown = (
        f"{100 * error:+z.1f} %" if unit == "%" else f"{error:.1f} mm" if unit == "mm" else f"{error:+z.1f}°"
    )
    return f"{text} ({shown})".replace("-", "−")
