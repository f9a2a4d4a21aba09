"""The volumes of a container side by side: hull, cavity, and what the simulation holds before it overflows."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from pipeline.geometry.cavity import Cavity, pour_axis, retained_volume_m3

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pipeline.report.parameters_page import Drawn

Arrays = Mapping[str, np.ndarray]

BRIMFUL = 0  # the key of a container's state that was filled until it overflowed
ML = 1e6
# What is compared, and how it is called; each against the cavity of the scan.
KINDS = {
    "hull_label_mapping": "hull, label mapping (the paper's volume)",
    "hull_point_mapping": "hull, point mapping",
    "capacity_label_mapping": "cavity, label mapping",
    "capacity_point_mapping": "cavity, point mapping",
    "overflow": "filled until it overflows, simulation",
    "true_cavity": "cavity, true",
}
MARKERS = dict(zip(KINDS, ("s", "D", "o", "v", "^", "_"), strict=True))
COLOURS = dict(zip(KINDS, ("#D55E00", "#E69F00", "#0072B2", "#56B4E9", "#009E73", "black"), strict=True))


def volumes(
    listed: pd.DataFrame, containers: Mapping[str, Arrays], errors: Mapping[str, Mapping[str, float]]
) -> pd.DataFrame:
    """Return the volumes in m³: a row an object; the columns of `KINDS` and `scan_cavity`, nan where one is not known."""
    rows = {}
    values = listed.set_index(["object", "mapping", "parameter"])["value"]
    for name, container in containers.items():
        row = {"scan_cavity": float(container["cavity_capacity_m3"]), "overflow": _overflow_m3(container)}
        for mapping in ("label_mapping", "point_mapping"):
            for kind, parameter in {"hull": "volume_m3", "capacity": "capacity_m3"}.items():
                row[f"{kind}_{mapping}"] = values.get((name, mapping, parameter), np.nan)
        error = errors.get(name, {}).get("fuse.capacity_relative_error", np.nan)
        rows[name] = {**row, "true_cavity": row["scan_cavity"] / (1.0 + error)}
    return pd.DataFrame.from_dict(rows, orient="index")


def _overflow_m3(container: Arrays) -> float:
    """Return what stays in a container that was filled gently until it overflowed: particles times the volume of one."""
    count = container["settled_counts"][container["settled_keys"] == BRIMFUL]
    return float(count[0] * container["spacing_m"] ** 3)


def biases(found: pd.DataFrame) -> dict[str, float]:
    """Return each object's volumes and, but for the scan's cavity, how far they are from it, as a share of it."""
    numbers = {}
    for name, row in found.iterrows():
        for kind, volume in row.dropna().items():
            numbers[f"volumes.{name}.{kind}_m3"] = float(volume)
            if kind != "scan_cavity":
                numbers[f"volumes.{name}.{kind}.bias"] = float(volume / row["scan_cavity"] - 1.0)
    return numbers


def comparison(found: pd.DataFrame, objects: "Sequence[Drawn]", containers: Mapping[str, Arrays]) -> "Figure":
    """Return the page: bias of every volume, and what is kept when tilted, against hydrostatics of the scanned cavity."""
    import matplotlib.pyplot as plt

    from pipeline.report.style import RC

    columns = 5
    rows = -(-len(objects) // columns)
    with plt.rc_context(RC):
        figure = plt.figure(figsize=(10.4, 3.2 + 1.9 * rows), layout="constrained")
        halves = figure.add_gridspec(2, 1, height_ratios=[3.2, 1.9 * rows])
        upper, lower = figure.add_subfigure(halves[0]), figure.add_subfigure(halves[1])
        _biases(upper.subplots(), found)
        axes = lower.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for axis in axes.flat[len(objects) :]:
            axis.set_axis_off()
        for axis, drawn in zip(axes.flat, objects, strict=False):
            _kept(axis, drawn, _cavity(containers[drawn.name]))
        if axes[0, 0].lines:
            axes[0, 0].legend(frameon=False, fontsize=6)
        lower.supxlabel("tilt, degrees", fontsize=8)
        lower.supylabel("kept of the capacity, %", fontsize=8)
    return figure


def _biases(axis: "Axes", found: pd.DataFrame) -> None:
    places = np.arange(len(found))
    for step, (kind, word) in enumerate(KINDS.items()):
        bias = 100.0 * (found[kind] / found["scan_cavity"] - 1.0)
        axis.plot(places + 0.11 * (step - 2.5), bias, MARKERS[kind], color=COLOURS[kind], ms=4.5, label=word)
    axis.axhline(0.0, color="0.6", lw=0.8, zorder=0)
    sizes = [
        f"{name.replace('_', ' ')}\n{found.loc[name, 'scan_cavity'] * ML:.0f} ml" for name in found.index
    ]
    axis.set_xticks(places, sizes, fontsize=7)
    axis.set_ylabel("difference from the cavity\nof the scan, %")
    axis.set_title("Volumes side by side; below the names, the cavity of the scan")
    axis.legend(frameon=False, ncols=2, loc="upper right")


def _cavity(container: Arrays) -> Cavity:
    arrays = {part.name: container[f"cavity_{part.name}"] for part in fields(Cavity)}
    values: Any = {name: array if array.ndim else array.item() for name, array in arrays.items()}
    return Cavity(**values)


def _kept(axis: "Axes", drawn: "Drawn", cup: Cavity) -> None:
    """Draw the share kept by label mapping, its spread as a band of two standard deviations, and that of the scanned cavity."""
    names = [name for name in drawn.values if name.startswith("retained_")]
    axis.set_title(drawn.name.replace("_", " "), fontsize=8)
    if names:
        tilts_deg = np.array([int(name.split("_")[1]) for name in names])
        kept = np.array([drawn.values[name] for name in names])
        spread = np.array([drawn.std[name] for name in names])
        axis.plot(tilts_deg, 100 * kept / kept[0], "o-", ms=2.5, lw=1, color="#0072B2", label="label mapping")
        low, high = (100 * (kept + sign * 2 * spread) / kept[0] for sign in (-1, 1))
        axis.fill_between(tilts_deg, low, high, color="#0072B2", alpha=0.25, lw=0)
    if "lip_x_m" not in drawn.values:  # not listed: about which lip is not known
        return
    lip_m = drawn.vector_mm("lip") * 1e-3
    lip_m = cup.rim_m[np.argmin(np.linalg.norm(cup.rim_m - lip_m, axis=1))]
    tilts_deg = np.arange(0.0, 121.0, 3.0)
    kept = retained_volume_m3(cup, lip_m, pour_axis(cup.opening_m, lip_m), np.radians(tilts_deg))
    axis.plot(tilts_deg, 100 * kept / cup.capacity_m3, "--", lw=1, color="0.3", label="hydrostatics, scan")
