"""The page's table of objects: parameters with their uncertainty, scan, trials."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.artefacts import read_json, read_table

if TYPE_CHECKING:
    import pandas as pd

MAPPING = "label_mapping"
# Column of `parameters`: heading, unit, how many units one SI unit is, decimals.
PARAMETERS = {
    "radius_m": ("radius", "mm", 1e3, 2),
    "height_m": ("height", "mm", 1e3, 2),
    "volume_m3": ("hull", "ml", 1e6, 1),
    "capacity_m3": ("capacity", "ml", 1e6, 1),
    "tilt_reference_rad": ("tilt reference", "°", 180 / math.pi, 1),
}


def rows(
    processed: Path, source: str, names: Sequence[str], uncertainties: Path | None, numbers: dict[str, float]
) -> list[dict[str, Any]]:
    """Return a row an object, in the order of `names`."""
    folder = processed / "parametrise" / source
    values = _of_mapping(read_table(folder / "parameters.parquet", "parameters")).set_index("object")
    spread = _spread(uncertainties)
    return [
        {
            "name": name,
            "title": name.replace("_", " "),
            "source": name == source,
            "parameters": [
                _parameter(key, float(values.at[name, key]), spread.get((name, key))) for key in PARAMETERS
            ],
            "scan": scan(read_json(processed / f"fuse/{name}/fusion.json")),
            "poured": numbers.get(f"simulate.pouring.{name}.positive_share"),
            "filled": numbers.get(f"simulate.filling.{name}.positive_share"),
        }
        for name in names
    ]


def _of_mapping(table: "pd.DataFrame") -> "pd.DataFrame":
    return table[table["mapping"] == MAPPING]


def _spread(path: Path | None) -> dict[tuple[str, str], float]:
    """Return (object, parameter) → standard deviation, in SI units."""
    if path is None:
        return {}
    table = _of_mapping(read_table(path, "uncertainties"))
    return dict(zip(zip(table["object"], table["parameter"], strict=True), table["std"], strict=True))


def _parameter(key: str, value: float, std: float | None) -> dict[str, str]:
    heading, unit, scale, decimals = PARAMETERS[key]
    return {
        "heading": heading,
        "unit": unit,
        "value": f"{value * scale:.{decimals}f}" if math.isfinite(value) else "–",
        "std": "" if std is None or not math.isfinite(std) else _small(std * scale, decimals),
    }


def _small(value: float, decimals: int) -> str:
    """Return an uncertainty to as many decimals as its value has; what would be nothing is said to be less than the last one."""
    least = 10.0**-decimals
    return f"{value:.{decimals}f}" if value >= least / 2 else f"< {least:.{decimals}f}"


def scan(fusion: dict[str, Any]) -> dict[str, Any]:
    """Return in words what the scan is, how much of the surface was seen, how near measured points are to it, and complaints."""
    residual = fusion.get("residual_m") or {}
    views = fusion.get("n_views") or 0
    return {
        "kind": f"{views} views" if views else str(fusion["layout"]),
        "seen": f"{fusion['share_seen']:.0%}" if views and "share_seen" in fusion else "–",
        "median": f"{1e3 * residual['median']:.2f} mm" if "median" in residual else "–",
        "closed": "closed" if fusion.get("watertight") else "not closed",
        "complaints": fusion.get("complaints", []),
    }
