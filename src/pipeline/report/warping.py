"""Every method of warping on every target: how near, with which labels and parameters, at what price (warping.pdf)."""

from pathlib import Path
from typing import TYPE_CHECKING

from pipeline import command
from pipeline.artefacts import read_json, read_table, write_json

if TYPE_CHECKING:
    from pipeline.report.accuracy import Truth
    from pipeline.report.warping_page import Scores

PARAMETERS = ("radius", "opening_mm", "height", "hull_volume", "capacity", "tilt_reference_deg")
NEEDED = ["radius_m", "volume_m3", "capacity_m3"]  # without these a mapping had no container or rim


def main() -> None:
    """Read the warps and parameters by all methods; write the pages and their numbers."""
    parser = command.parser(__doc__)
    parser.add_argument("--processed", type=Path, required=True, help="folder of the stages' artefacts")
    parser.add_argument("--source", required=True, help="name of the annotated object")
    parser.add_argument("--targets", nargs="+", required=True, help="names of demonstration objects")
    parser.add_argument("--methods", nargs="+", required=True, help="names of methods")
    parser.add_argument("--k", type=int, required=True, help="neighbours a point was mapped to")
    parser.add_argument("--page", type=Path, required=True)
    parser.add_argument("--numbers", type=Path, required=True)
    options = parser.parse_args()

    from pipeline.report.accuracy import read_truth
    from pipeline.report.style import save
    from pipeline.report.warping_page import matrices, overview

    truths = {target: read_truth(options.processed, target) for target in options.targets}
    found: Scores = {
        method: {
            target: scores(options.processed, options.source, target, f"{method}_k{options.k}", truth)
            for target, truth in truths.items()
        }
        for method in options.methods
    }
    save([overview(found, options.source), matrices(found)], options.page)
    write_json(options.numbers, numbers(found))


def scores(processed: Path, source: str, target: str, by: str, truth: "Truth") -> dict[str, float]:
    """Return what a warp says of itself, and its labels and parameters against the truth, absolute; nan where there is none."""
    import math

    from pipeline.report.accuracy import label_scores, parameter_errors, true_parts

    warp = processed / "warp" / source / "by" / by / target
    alignment, fit_s = read_json(warp / "alignment.json"), read_json(warp / "cpu.json")["fit_s"]
    mapped = read_table(warp / "label_mapping.parquet", "mapping")
    labels = label_scores(mapped, true_parts(mapped, truth))
    table = read_table(processed / "parametrise" / source / "by" / by / f"{target}.parquet", "parameters")
    row = table.set_index("mapping").loc["label_mapping"]
    errors = {} if row[NEEDED].isna().any() else parameter_errors(row, truth)
    own = alignment["label_mapping"]
    return {
        "residual_mm": 1e3 * own["residual_m"],
        "share_without_candidate": own["share_without_candidate"],
        "wall_side_flips": own["wall_side_flips"],
        "wall_side_flips_without_check": alignment["wall_side_flips_without_check"],
        "balanced_accuracy": labels["balanced_accuracy"],
        "rim_iou": labels["rim.iou"],
        "handle_iou": labels.get("handle.iou", math.nan),
        **{key: abs(errors.get(key, math.nan)) for key in PARAMETERS},
        "fit_s": fit_s,
    }


def numbers(found: "Scores") -> dict[str, float]:
    """Return every score by method and target, and by method the mean, the worst and how many bars of the page are met."""
    import math

    from pipeline.report.warping_page import MEASURES, bars_met, over_targets

    flat: dict[str, float] = {}
    for method, by_target in found.items():
        for target, own in by_target.items():
            flat |= {f"warping.{method}.{target}.{key}": value for key, value in own.items()}
        for key in MEASURES:
            flat |= {
                f"warping.{method}.{key}.{what}": value
                for what, value in over_targets(by_target, key).items()
            }
        flat[f"warping.{method}.bars_met"] = float(bars_met(by_target))
    return {key: value for key, value in flat.items() if math.isfinite(value)}


if __name__ == "__main__":
    command.run(main)
