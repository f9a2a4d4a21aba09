"""Every demonstration object as the source for every other: how well parameters and rims are found (sources.pdf)."""

from pathlib import Path
from typing import TYPE_CHECKING

from pipeline import command
from pipeline.artefacts import read_table, write_json

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# What is shown: words, factor to the unit shown, where the colours end, decimals.
PANELS = {
    "radius": ("radius: error, %", 100.0, 5.0, 1),
    "height": ("height: error, %", 100.0, 5.0, 1),
    "hull_volume": ("hull volume: error, %", 100.0, 5.0, 1),
    "capacity": ("capacity: error, %", 100.0, 5.0, 1),
    "tilt_reference_deg": ("tilt reference: error, °", 1.0, 2.0, 1),
    "rim_missed": ("rim: 1 − IoU, %", 100.0, 50.0, 0),
}

# What is worked out: that, and what the spreads are set beside.
ERRORS = (*PANELS, "opening_mm")


def main() -> None:
    """Read the parameters and labels by all sources and by several k; write the pages and their numbers."""
    parser = command.parser(__doc__)
    parser.add_argument("--processed", type=Path, required=True, help="folder of the stages' artefacts")
    parser.add_argument("--objects", nargs="+", required=True, help="names of the demonstration objects")
    parser.add_argument(
        "--adopted", nargs="*", default=[], help="sources with the labels that the first gave them"
    )
    parser.add_argument("--source", required=True, help="name of the first source")
    parser.add_argument(
        "--by-k", nargs="+", required=True, help="<method>_k<k>: folders with that many neighbours"
    )
    parser.add_argument("--page", type=Path, required=True)
    parser.add_argument("--numbers", type=Path, required=True)
    options = parser.parse_args()

    from pipeline.report.spreads import draw_spreads, spread_numbers, spreads
    from pipeline.report.style import save

    errors = matrices(options.processed, options.objects)
    spread = spreads(options.processed, options.source, options.objects, options.by_k, errors)
    ks = [by.rpartition("_k")[2] for by in options.by_k]
    pages = [
        draw(errors, options.objects, options.source, options.adopted),
        draw_spreads(spread, options.source, ks),
    ]
    save(pages, options.page)
    write_json(options.numbers, numbers(errors, options.objects) | spread_numbers(spread))


def matrices(processed: Path, names: list[str]) -> "dict[str, np.ndarray]":
    """Return error → (sources, targets), absolute, by label mapping."""
    import numpy as np

    from pipeline.report.accuracy import label_scores, parameter_errors, read_truth, true_parts

    found = {key: np.zeros((len(names), len(names))) for key in ERRORS}
    for column, target in enumerate(names):
        truth = read_truth(processed, target)
        parts = true_parts(read_table(processed / "fuse" / target / "cloud.parquet", "cloud"), truth)
        for row, source in enumerate(names):
            table = read_table(processed / "parametrise" / source / f"{target}.parquet", "parameters")
            values = table.set_index("mapping").loc["label_mapping"]
            errors = parameter_errors(values, truth)
            mapped = read_table(processed / "warp" / source / target / "label_mapping.parquet", "mapping")
            errors["rim_missed"] = 1.0 - label_scores(mapped, parts)["rim.iou"]
            for key, matrix in found.items():
                matrix[row, column] = abs(errors[key])
    return found


def numbers(errors: "dict[str, np.ndarray]", names: list[str]) -> dict[str, float]:
    """Return the errors of each source: mean and worst over the other objects as targets."""
    import numpy as np

    others = ~np.eye(len(names), dtype=bool)
    return {
        f"sources.{name}.{key}.{what}": float(of(matrix[row][others[row]]))
        for key, matrix in errors.items()
        for row, name in enumerate(names)
        for what, of in (("error_mean", np.mean), ("error_max", np.max))
    }


def draw(errors: "dict[str, np.ndarray]", names: list[str], source: str, adopted: list[str]) -> "Figure":
    """Return the page: one matrix an error, a row a source, a column a target."""
    import matplotlib.pyplot as plt

    from pipeline.report.style import RC

    with plt.rc_context(RC):
        figure, axes = plt.subplots(2, 3, figsize=(11.0, 7.6), layout="constrained")
        for axis, key in zip(axes.flat, PANELS, strict=True):
            _matrix(axis, errors[key], names, key)
        for axis in axes[:, 0]:
            axis.set_ylabel("source")
        for axis in axes[1]:
            axis.set_xlabel("target")
        words = " ".join(name.replace("_", " ") + "," for name in adopted).rstrip(",")
        figure.suptitle(
            f"Every object as the source for every other, label mapping. A human annotated the {source.replace('_', ' ')}; "
            f"others ({words or 'none'})\nare annotated by the labels that it gave them, so that its errors are in theirs. "
            "Initial labels are learnt from each source alone. Framed: the source itself.",
            fontsize=8,
        )
    return figure


def _matrix(axis: "Axes", matrix: "np.ndarray", names: list[str], key: str) -> None:
    import numpy as np
    from matplotlib.patches import Rectangle

    from pipeline.report.matrices import draw_matrix

    title, factor, end, decimals = PANELS[key]
    shown = matrix * factor
    draw_matrix(axis, shown, names, names, end=end, decimals=decimals)
    for i in range(len(names)):
        axis.add_patch(Rectangle((i, i), 1, 1, fill=False, edgecolor="black", lw=0.8))
    axis.set_aspect("equal")
    mean = float(np.mean(shown[~np.eye(len(names), dtype=bool)]))
    axis.set_title(f"{title} (mean {mean:.{decimals + 1}f})", fontsize=8)


if __name__ == "__main__":
    command.run(main)
