"""Collect every headline number into one flat JSON object: fusion, labels, parameters, trials, classifiers, the paper's claims."""

from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline import command
from pipeline.artefacts import read_json, read_table, write_json

if TYPE_CHECKING:
    import pandas as pd

EXPERIMENTS = {"pouring": "poured", "filling": "filled"}
MAPPINGS = ("label_mapping", "point_mapping")

Metrics = dict[str, float]


def main() -> None:
    """Read the processed artefacts of all objects; write the metrics."""
    parser = command.parser(__doc__)
    parser.add_argument("--processed", type=Path, required=True, help="folder of the stages' artefacts")
    parser.add_argument("--source", required=True, help="name of the annotated object")
    parser.add_argument("--objects", nargs="+", required=True, help="names of all objects that take part")
    parser.add_argument(
        "--accuracy", type=Path, nargs="*", default=[], help="errors of the demonstration objects"
    )
    parser.add_argument("--output", type=Path, required=True)
    options = parser.parse_args()

    from pipeline.report.claims import claims

    processed, source = options.processed, options.source
    metrics = accuracy_metrics({path.stem: read_json(path) for path in options.accuracy})
    metrics |= warp_metrics(processed, source, options.objects)
    for experiment in EXPERIMENTS:
        metrics |= trial_metrics(processed, experiment, options.objects)
        metrics |= score_metrics(
            experiment, read_table(processed / "classify" / experiment / "scores.parquet", "scores")
        )
    metrics |= claims(metrics)
    write_json(options.output, {name: value for name, value in metrics.items() if value == value})


def accuracy_metrics(of_objects: Mapping[str, Metrics]) -> Metrics:
    """Return the errors of the demonstration objects against their truth, of each (`accuracy`'s) and over all of them."""
    found: dict[str, list[float]] = defaultdict(list)
    metrics: Metrics = {}
    for name, errors in of_objects.items():
        for key, value in errors.items():
            stage, *mapping, what = key.split(".", 2 if key.startswith("parametrise") else 1)
            end = "_error" if stage == "parametrise" else ""
            metrics[".".join([stage, *mapping, name, f"{what}{end}"])] = value
            found[key].append(value)
    return metrics | _headlines(found) if found else metrics


def _headlines(found: dict[str, list[float]]) -> Metrics:
    """Return means and worst cases over the objects."""
    metrics: Metrics = {}
    for key, values in found.items():
        mean, worst = sum(values) / len(values), max(map(abs, values))
        stage = key.split(".")[0]
        if stage == "parametrise":
            tail = {
                "opening_mm": "opening.error_mm_max",
                "tilt_reference_deg": "tilt_reference.error_deg_max",
                "tilt_reference_cavity_deg": "tilt_reference_cavity.error_deg_max",
            }
            mapping, what = key.split(".")[1:]
            metrics[f"parametrise.{mapping}.{tail.get(what, f'{what}.relative_error_max')}"] = worst
        elif key == "fuse.capacity_relative_error":
            metrics["fuse.capacity.relative_error_max"] = worst
        elif stage == "fuse":
            metrics[key] = mean
            least = key.endswith("_share") and "flipped" not in key
            metrics |= {f"{key}_min": min(values)} if least else {f"{key}_max": worst}
        else:
            metrics[key.replace("warp_label_mapping", "warp.label_mapping")] = mean
    sides = [value for side in ("inner", "outer") for value in found[f"fuse.{side}_error_mm_mean"]]
    metrics["fuse.surface_error_mm_mean"] = sum(sides) / len(sides)
    return metrics


def warp_metrics(processed: Path, source: str, objects: list[str]) -> Metrics:
    """Return mean residual, share without candidate and wall-side flips of both mappings, over the targets."""
    targets = [name for name in objects if name != source]
    alignments = [read_json(processed / "warp" / source / name / "alignment.json") for name in targets]
    return {
        f"warp.{mapping}.{key}": sum(alignment[mapping][key] for alignment in alignments) / len(alignments)
        for mapping in MAPPINGS
        for key in ("residual_m", "share_without_candidate", "wall_side_flips", "share_of_target_reached")
        if alignments
    }


def trial_metrics(processed: Path, experiment: str, objects: list[str]) -> Metrics:
    """Return what the trials say of themselves: leaks, failures, voids, density, class shares."""
    import pandas as pd

    path = processed / "simulate" / experiment
    trials = pd.concat([read_table(path / name / "trials.parquet", "trials") for name in objects])
    well = trials[~trials["failed"]]
    label, head = EXPERIMENTS[experiment], f"simulate.{experiment}"
    metrics = {
        f"{head}.trials": len(trials),
        f"{head}.leaked": int(trials["n_leaked"].sum()),
        f"{head}.failed": int(trials["failed"].sum()),
        f"{head}.void_share": float(trials["n_void"].sum() / (trials["n_void"].sum() + len(trials))),
        f"{head}.density_error_mean": float(trials["density_error"].mean()),
        f"{head}.agreement_with_hydrostatics": float(
            ((well["hydrostatic_margin"] > 0.0) == well[label]).mean()
        ),
    }
    shares = well.groupby("object", observed=True)[label].mean()
    metrics |= {f"{head}.{name}.positive_share": float(share) for name, share in shares.items()}
    if experiment == "filling":
        halves = well.groupby("half", observed=True)[label].mean()
        metrics |= {f"{head}.{half}.positive_share": float(share) for half, share in halves.items()}
    return metrics


def score_metrics(experiment: str, scores: "pd.DataFrame") -> Metrics:
    """Return means over training objects and draws of the scores of each feature set and split."""
    head = f"classify.{experiment}"
    columns = ["auc", "tpr_at_fpr_00", "tpr_at_fpr_01", "tpr_at_fpr_05", "brier"]
    means = scores.groupby(["features", "split"], observed=True)[columns].mean()
    metrics = {
        f"{head}.{features}.{split}.{column}": float(value)
        for (features, split), row in means.iterrows()
        for column, value in row.items()
    }
    trained = scores[scores["features"] != "hydrostatic"]
    metrics[f"{head}.separable_share"] = float(trained["separable"].mean())
    metrics[f"{head}.converged_share"] = float(trained["converged"].mean())
    metrics[f"{head}.redrawn"] = int(trained.drop_duplicates(["training_object", "draw"])["n_redrawn"].sum())
    same = scores[scores["split"] == "same"].pivot_table(
        index=["training_object", "draw"], columns="features", values="auc"
    )
    learnt = same[[name for name in same if name != "hydrostatic"]].dropna()
    metrics[f"{head}.same_auc_difference_max"] = float((learnt.max(axis=1) - learnt.min(axis=1)).max())
    return metrics


if __name__ == "__main__":
    command.run(main)
