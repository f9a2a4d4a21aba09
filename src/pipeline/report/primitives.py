"""Draw the distributions of pours, as the paper's Fig. 4: mean, two standard deviations, lines at one, where the lip is inside."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline import command
from pipeline.artefacts import read_json, read_table, write_json

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pipeline.motion.promp import ProMP

PHASE = np.linspace(0.0, 1.0, 301)
INSIDE, SHOWN = "#CC79A7", "#7F7F7F"
NAMES = {"x": "X, along the pour", "y": "Y, across", "z": "Z, up", "tilt": "tilt"}


def main() -> None:
    """Read the primitives of all feature sets and their demonstrations; write a page and the numbers of each."""
    parser = command.parser(__doc__)
    for option in ("--primitives", "--trajectories"):
        parser.add_argument(option, type=Path, nargs="+", required=True, help="one file a feature set")
    parser.add_argument("--prior-demonstrations", type=float, default=5.0, help="as the primitives have it")
    parser.add_argument("--conditioned", type=Path, help="the primitive that is conditioned on the pair")
    parser.add_argument("--parameters", type=Path, help="warped parameters of all objects, for that one")
    parser.add_argument("--pairs", nargs="*", default=[], metavar="HELD/TARGET", help="that it is shown for")
    parser.add_argument("--pages", type=Path, required=True)
    parser.add_argument("--numbers", type=Path, required=True)
    options = parser.parse_args()

    from pipeline.motion.promp import ProMP
    from pipeline.report.style import save

    contents = [read_json(path) for path in options.primitives]
    about = [content["learnt_from"] for content in contents]
    primitives = [
        ProMP.from_json(content, str(path))
        for content, path in zip(contents, options.primitives, strict=True)
    ]
    tables = [read_table(path, "demonstrations") for path in options.trajectories]
    # The lines at one, for features that are metres and radians: one by label mapping.
    ruler = {one["features"]: np.array(one["references"]) for one in about}["label_mapping"]
    pages: list[Figure] = []
    found: dict[str, Any] = {}
    with command.steps("motor primitives", len(primitives) + 2) as tell:
        for learnt, promp, table in zip(about, primitives, tables, strict=True):
            tell(learnt["features"].replace("_", " "))
            ones = ruler if learnt["features"] == "standard" else np.ones(4)
            pages.append(draw(promp, table, learnt, ones))
            found |= numbers(promp, table, learnt, options.prior_demonstrations)
        tell("conditioned on the pair")
        if options.conditioned:
            by_features = {one["features"]: promp for one, promp in zip(about, primitives, strict=True)}
            pages.append(_conditioned(options, by_features["label_mapping"]))
        tell("writing")
        save(pages, options.pages)
    write_json(options.numbers, found)


def _conditioned(options: argparse.Namespace, scaled: "ProMP") -> "Figure":
    from pipeline.motion.conditioned import ConditionedProMP
    from pipeline.report import conditioned_page

    learnt = ConditionedProMP.from_json(read_json(options.conditioned), str(options.conditioned))
    parameters = read_table(options.parameters, "parameters")
    pairs = [(held, target) for held, target in (pair.split("/") for pair in options.pairs)]
    return conditioned_page.draw(learnt, scaled, parameters, pairs)


def draw(promp: "ProMP", shown: "pd.DataFrame", about: dict[str, Any], ones: np.ndarray) -> "Figure":
    """Return the page of a primitive. shown: table `demonstrations`; ones (4,): what counts as one in its units."""
    import matplotlib.pyplot as plt

    from pipeline.report.style import RC, WORDS

    mean = promp.mean(PHASE)
    inside = np.hypot(mean[:, 0], mean[:, 1]) < ones[0]
    with plt.rc_context(RC):
        figure, axes = plt.subplots(2, 2, figsize=(7.0, 4.6), sharex=True)
        for number, axis in enumerate(axes.flat):
            _panel(axis, promp, shown, about["features"], number, ones[number])
            axis.fill_between(
                PHASE,
                0.0,
                1.0,
                where=inside,
                transform=axis.get_xaxis_transform(),
                color=INSIDE,
                alpha=0.15,
                lw=0,
            )
        for axis in axes[1]:
            axis.set(xlabel=f"phase (1 is {promp.duration_s:.1f} s on average)", xlim=(0.0, 1.0))
        held, target = (about[key].replace("_", " ") for key in ("held_object", "target_object"))
        figure.suptitle(
            f"{about['pours']} pours of the {held} into the {target}: {WORDS[about['features']]}", fontsize=9
        )
        _legend(figure, about["features"])
        figure.tight_layout(rect=(0.0, 0.05, 1.0, 1.0))
    return figure


def _panel(
    axis: "Axes", promp: "ProMP", shown: "pd.DataFrame", features: str, number: int, one: float
) -> None:
    from pipeline.report.style import COLOURS

    name, unit = promp.dimensions[number], promp.units[number]
    mean, deviation = promp.mean(PHASE)[:, number], promp.deviation(PHASE)[:, number]
    band = mean - 2.0 * deviation, mean + 2.0 * deviation
    axis.fill_between(PHASE, *band, color=COLOURS[features], alpha=0.25, lw=0)
    for _, pour in shown.groupby("pour"):
        axis.plot(pour["phase"], pour[name], color=SHOWN, lw=0.4)
    axis.plot(PHASE, mean, color=COLOURS[features], lw=1.6)
    for level in (one, -one) if name in ("x", "y") else (one,):
        # The paper's lines; where nothing comes near, they would flatten what there is to see.
        if min(band[0].min(), -0.1 * one) <= level * 1.02 and level <= max(band[1].max(), 0.98 * one):
            axis.axhline(level, color="black", lw=0.8)
    references = {"x": "radius", "y": "radius", "z": "height", "tilt": "tilt reference"}
    axis.set_ylabel(f"{NAMES[name]} ({unit})" if unit != "1" else f"{NAMES[name]} ÷ {references[name]}")


def _legend(figure: "Figure", features: str) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    from pipeline.report.style import COLOURS

    colour = COLOURS[features]
    handles = [
        Line2D([], [], color=colour, lw=1.6, label="mean"),
        Patch(color=colour, alpha=0.25, lw=0, label="± 2 standard deviations"),
        Line2D([], [], color=SHOWN, lw=0.6, label="demonstrations"),
        Line2D([], [], color="black", lw=0.8, label="one reference (±1 of X, Y)"),
        Patch(color=INSIDE, alpha=0.15, lw=0, label="mean lip within one radius"),
    ]
    figure.legend(
        handles=handles, loc="lower center", ncols=5, frameon=False, columnspacing=1.2, handlelength=1.6
    )


def left_out(shown: "pd.DataFrame", n_basis: int, prior_demonstrations: float) -> float:
    """Return the share of the values of pours, each left out in its turn, in the 95 % bands learnt from the others."""
    from pipeline.motion.promp import ProMP

    pours = [pour for _, pour in shown.groupby("pour")]
    values = [pour[["x", "y", "z", "tilt"]].to_numpy() for pour in pours]
    phases = [pour["phase"].to_numpy() for pour in pours]
    held = []
    for out in range(len(pours)):
        others = [number for number in range(len(pours)) if number != out]
        promp = ProMP.fit(
            [values[number] for number in others],
            [phases[number] for number in others],
            **{"n_basis": n_basis, "prior_demonstrations": prior_demonstrations},
        )
        off = np.abs(values[out] - promp.mean(phases[out])) / promp.deviation(phases[out])
        held.append(float((off < 1.959964).mean()))
    return float(np.mean(held))


def numbers(promp: "ProMP", shown: "pd.DataFrame", about: dict[str, Any], prior: float) -> dict[str, Any]:
    """Return the headline numbers of a primitive, flat: primitives.<features>.…"""
    key = f"primitives.{about['features']}"
    found = {f"{key}.pours": about["pours"], f"{key}.duration_s": promp.duration_s}
    found |= {f"{key}.tilted_outside.{name}": value for name, value in about["tilted_outside"].items()}
    noise = zip(promp.dimensions, promp.noise_variance, strict=True)
    found |= {f"{key}.noise.{name}": float(np.sqrt(variance)) for name, variance in noise}
    if about["pours"] > 2:
        found[f"{key}.left_out_coverage"] = left_out(shown, promp.n_basis, prior)
    return found


if __name__ == "__main__":
    command.run(main)
