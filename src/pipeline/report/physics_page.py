"""The page on the liquid's physics: a panel a check, what was measured in colour, what hydrostatics says in grey."""

from typing import TYPE_CHECKING

import numpy as np

from pipeline.report.physics_numbers import THICK, spill_errors

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import GridSpec

# Okabe and Ito's colours with a marker each, so that print in grey tells them apart as well.
VESSELS = {"cylinder": ("#0072B2", "o"), "cone": ("#D55E00", "s"), "bowl": ("#009E73", "^")}
BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#7F7F7F"
SPACING_STYLES = [("#D55E00", "o"), ("#0072B2", "s"), ("#009E73", "^")]
EXPERIMENTS = ("pouring", "filling")


def draw(checks: "pd.DataFrame", trials: "pd.DataFrame") -> "Figure":
    """Return the page (A4, portrait) from the table "physics" and all trials of the liquid."""
    import matplotlib.pyplot as plt

    from pipeline.report.style import RC

    objects = list(dict.fromkeys(checks.loc[checks["check"] == "retained", "vessel"]))
    with plt.rc_context(
        {**RC, "font.size": 7, "axes.labelsize": 7, "axes.titlesize": 8, "legend.fontsize": 6}
    ):
        figure = plt.figure(figsize=(8.27, 11.69))
        grid = figure.add_gridspec(4, 3, left=0.11, right=0.98, top=0.97, bottom=0.05, hspace=0.6, wspace=0.4)
        panels = (rest_density, rest_level, rest_speed, spill)
        for number, panel in enumerate(panels):
            panel(figure.add_subplot(grid[number // 3, number % 3]), checks)
        capacity(figure.add_subplot(grid[1, 1]), checks)
        pouring_density(figure.add_subplot(grid[1, 2]), trials)
        _retained(figure, grid, checks, objects)
        again(figure.add_subplot(grid[3, 0]), checks)
        again_where(figure.add_subplot(grid[3, 1]), checks, trials)
        audit(figure.add_subplot(grid[3, 2]), checks, trials)
    return figure


def rest_density(axis: "Axes", checks: "pd.DataFrame") -> None:
    """Density error at rest against the number of particles."""
    for name, rows in _by_vessel(checks, "density"):
        colour, marker = VESSELS[name]
        axis.plot(rows["x"], 100 * rows["measured"], marker=marker, ms=3, lw=0.8, color=colour, label=name)
    axis.axhline(3.0, color=GREY, lw=0.8, ls="--")
    _thin(axis)
    axis.set(title="Density at rest", xlabel="particles", ylabel="mean |density − 1| (%)")
    axis.set_ylim(0.0, 1.25 * max(3.0, axis.get_ylim()[1]))
    axis.legend(frameon=False, ncol=3, loc="upper center", handlelength=1.2, columnspacing=0.8)


def rest_level(axis: "Axes", checks: "pd.DataFrame") -> None:
    """Error of the free surface's level against the number of particles."""
    for name, rows in _by_vessel(checks, "level"):
        colour, marker = VESSELS[name]
        off = (rows["measured"] - rows["expected"]) / rows["spacing_m"]
        axis.plot(rows["x"], off, marker=marker, ms=3, lw=0.8, color=colour, label=name)
    for limit in (-0.5, 0.5):
        axis.axhline(limit, color=GREY, lw=0.8, ls="--")
    _thin(axis)
    axis.set(
        title="Free surface", xlabel="particles", ylabel="level − hydrostatic (spacings)", ylim=(-0.8, 0.8)
    )


def rest_speed(axis: "Axes", checks: "pd.DataFrame") -> None:
    """Speed after a push, undamped."""
    for name, rows in _by_vessel(checks, "speed"):
        axis.semilogy(rows["x"], rows["measured"], lw=1.0, color=VESSELS[name][0], label=name)
    axis.set(title="After a push", xlabel="time (s)", ylabel="rms speed (m/s)")
    axis.legend(frameon=False)


def spill(axis: "Axes", checks: "pd.DataFrame") -> None:
    """Tilt at which pouring begins beyond the hydrostatic one; bars: what one spacing held back allows."""
    spacings = sorted(checks.loc[checks["check"] == "spill", "spacing_m"].unique(), reverse=True)
    for (name, spacing_m), rows in spill_errors(checks).groupby(["vessel", "spacing_m"]):
        colour, marker = VESSELS[name]
        fine = spacing_m == min(spacings)
        x = 100 * rows["x"] + (1.0 if fine else -1.0) + (0.6 if name == "cone" else -0.6)
        axis.vlines(x, 0.0, np.degrees(rows["allowed_rad"]), color=GREY, lw=0.6)
        axis.plot(
            x,
            np.degrees(rows["error_rad"]),
            ls="none",
            marker=marker,
            ms=3.5,
            color=colour,
            mfc="white" if fine else colour,
            label=f"{name}, {spacing_m * 1e3:g} mm",
        )
    axis.axhline(0.0, color=GREY, lw=0.8)
    axis.set(title="Pouring begins", xlabel="fill (% of capacity)", ylabel="tilt − hydrostatic (°)")
    axis.set_ylim(top=1.6 * axis.get_ylim()[1])
    axis.legend(
        frameon=False, ncol=2, loc="upper center", title="grey: one spacing held back", title_fontsize=6
    )


def capacity(axis: "Axes", checks: "pd.DataFrame") -> None:
    """Capacity by overflow against the cavity's, for each object and spacing; hollow: before the calibration."""
    rows = checks[checks["check"].isin(["capacity", "capacity_uncalibrated"])]
    error = 100 * (rows["measured"] / rows["expected"] - 1.0)
    names = list(dict.fromkeys(rows["vessel"]))
    keys = sorted(rows["spacing_m"].unique(), reverse=True)
    for k, spacing_m in enumerate(keys):
        colour, marker = SPACING_STYLES[k % 3]
        for check, face in (("capacity_uncalibrated", "none"), ("capacity", colour)):
            part = rows[(rows["spacing_m"] == spacing_m) & (rows["check"] == check)]
            at = [names.index(name) + 0.25 * (k - 1) for name in part["vessel"]]
            label = f"{spacing_m * 1e3:g} mm" if check == "capacity" else None
            shown = error[part.index]
            axis.plot(
                shown, at, ls="none", marker=marker, ms=2.8, color=colour, mfc=face, mew=0.7, label=label
            )
    axis.axvline(0.0, color=GREY, lw=0.8)
    _named(axis, names)
    axis.set_ylim(top=len(names) + 1.0)
    axis.set(title="Capacity by overflow", xlabel="held − cavity (%); hollow: uncalibrated")
    axis.legend(frameon=False, loc="upper center", ncol=3, handletextpad=0.1, columnspacing=0.8)


def pouring_density(axis: "Axes", trials: "pd.DataFrame") -> None:
    """Distribution of a trial's mean density error, over all pouring trials."""
    pours = trials[(trials["experiment"] == "pouring") & ~trials["failed"]]
    for label, part, colour, line in (
        (f"{THICK} particles or more", pours[pours["n_particles"] >= THICK], BLUE, "-"),
        ("thin fills", pours[pours["n_particles"] < THICK], ORANGE, "--"),
    ):
        error = np.sort(100 * part["density_error"].to_numpy())
        if len(error):
            axis.step(error, np.linspace(0.0, 100.0, len(error)), color=colour, ls=line, lw=1.0, label=label)
    axis.axvline(5.0, color=GREY, lw=0.8, ls="--")
    axis.set(
        title="Density while pouring", xlabel="mean |density − 1| (%)", ylabel="trials (%)", xlim=(0.0, 8.0)
    )
    axis.legend(frameon=False, loc="lower right")


def _retained(figure: "Figure", grid: "GridSpec", checks: "pd.DataFrame", objects: list[str]) -> None:
    """What a brimful object keeps while it is tilted slowly: measured, and by hydrostatics."""
    columns = max(1, int(np.ceil(len(objects) / 2)))
    small = grid[2, :].subgridspec(2, columns, hspace=0.85, wspace=0.14)
    rows = checks[checks["check"] == "retained"]
    for number, name in enumerate(objects):
        axis = figure.add_subplot(small[number // columns, number % columns])
        part = rows[rows["vessel"] == name].sort_values("x")
        brimful = part["measured"].max()
        tilts = np.degrees(part["x"])
        axis.plot(tilts, 100 * part["expected"] / brimful, color=GREY, ls="--", lw=1.0, label="hydrostatic")
        axis.plot(tilts, 100 * part["measured"] / brimful, color=BLUE, lw=1.0, label="liquid")
        axis.set_title(name.replace("_", " "), fontsize=7, pad=2)
        axis.set(xlim=(0, 120), ylim=(0, 105), xticks=[0, 60, 120], yticks=[0, 50, 100])
        if number % columns:
            axis.set_yticklabels([])
        else:
            axis.set_ylabel("kept (%)")
        if number // columns == (len(objects) - 1) // columns:
            axis.set_xlabel("tilt (°)")
        if number == 0:
            axis.legend(frameon=False, fontsize=5, handlelength=1.2, loc="upper right", borderpad=0.0)


def again(axis: "Axes", checks: "pd.DataFrame") -> None:
    """Agreement of labels when trials run again, by object: another seed, half the spacing and step."""
    names = list(dict.fromkeys(checks.loc[checks["check"] == "repeat_pouring", "vessel"]))
    for k, (experiment, marker) in enumerate(zip(EXPERIMENTS, "os", strict=True)):
        for check, colour, word in (("repeat", GREY, "another seed"), ("converge", BLUE, "half the spacing")):
            rows = checks[checks["check"] == f"{check}_{experiment}"].dropna(subset=["measured", "expected"])
            share = 100 * (rows["measured"] == rows["expected"]).groupby(rows["vessel"]).mean()
            total = 100 * (rows["measured"] == rows["expected"]).mean()
            at = [names.index(name) + 0.3 * (k - 0.5) for name in share.index]
            label = f"{experiment}, {word} ({total:.1f} %)"
            axis.plot(share, at, ls="none", marker=marker, ms=3.5, color=colour, mfc="none", label=label)
    axis.axvline(97.0, color=GREY, lw=0.8, ls="--")
    _named(axis, names)
    axis.set_ylim(top=1.6 * len(names) + 1.0)
    axis.set(title="Trials run again", xlabel="labels that agree (%)")
    axis.legend(frameon=False, fontsize=5.5, loc="upper left", handletextpad=0.0, borderpad=0.0)


def again_where(axis: "Axes", checks: "pd.DataFrame", trials: "pd.DataFrame") -> None:
    """How far from hydrostatics' own border the pours are whose label changes at half the spacing."""
    rows = checks[checks["check"] == "converge_pouring"].dropna(subset=["measured"])
    pours = trials[trials["experiment"] == "pouring"][["object", "trial", "hydrostatic_margin"]]
    rows = rows.merge(pours, left_on=["vessel", "x"], right_on=["object", "trial"])
    differ = rows["measured"] != rows["expected"]
    _margins(axis, rows["hydrostatic_margin"], differ)
    axis.set(title="Pours that change at half the spacing")


def audit(axis: "Axes", checks: "pd.DataFrame", trials: "pd.DataFrame") -> None:
    """The audit of particles that crossed a wall, as a table."""
    thin = checks[checks["check"] == "leaked"]
    lines = [("pours, 1.5 mm walls", len(thin), int(thin["measured"].sum()), "–")]
    for experiment in EXPERIMENTS:
        rows = trials[trials["experiment"] == experiment]
        lines.append(
            (f"{experiment} trials", len(rows), int(rows["n_leaked"].sum()), str(int(rows["failed"].sum())))
        )
    axis.set_axis_off()
    axis.set_title("Audit of walls")
    cells = [[what, f"{n:,}", f"{leaked:,}", failed] for what, n, leaked, failed in lines]
    table = axis.table(
        cells,
        colLabels=["", "trials", "particles\nleaked", "failed"],
        colWidths=[0.46, 0.18, 0.20, 0.16],
        edges="horizontal",
        loc="center",
    )
    table.auto_set_font_size(False)
    table.set_fontsize(6)
    table.scale(1.0, 1.8)


def _margins(axis: "Axes", margin: "pd.Series", differ: "pd.Series") -> None:
    edges = np.linspace(-1.0, 1.0, 21).tolist()
    inside = margin.clip(-1.0, 1.0)
    axis.hist(inside, edges, color="0.85", label="all")
    axis.hist(inside[differ], edges, color=ORANGE, label="label changes")
    axis.axvline(0.0, color=GREY, lw=0.8, ls="--")
    axis.set(xlabel="hydrostatic margin (share)", ylabel="trials")
    axis.legend(frameon=False)


def _by_vessel(checks: "pd.DataFrame", check: str):
    rows = checks[checks["check"] == check]
    return [(name, part.sort_values("x")) for name, part in rows.groupby("vessel") if name in VESSELS]


def _thin(axis: "Axes") -> None:
    axis.axvspan(0, THICK, color="0.93", lw=0, zorder=0)
    axis.text(THICK * 0.5, 0.03, "thin", transform=axis.get_xaxis_transform(), ha="center", fontsize=6)
    axis.set_xlim(left=0.0)


def _named(axis: "Axes", names: list[str]) -> None:
    axis.set_yticks(range(len(names)), [name.replace("_", " ") for name in names])
    axis.set_ylim(-0.7, len(names) - 0.3)
