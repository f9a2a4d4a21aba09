"""Learn to predict pouring or filling from 50 trials of one object, and test on its others and on other objects."""

from pathlib import Path

from pipeline import command
from pipeline.artefacts import read_table, write_table

LABELS = {"pouring": "poured", "filling": "filled"}


def main() -> None:
    """Read all objects' trials and warped parameters; write predictions, scores, ROC curves and the classifiers."""
    parser = command.parser(__doc__)
    parser.add_argument("--experiment", choices=list(LABELS), required=True)
    parser.add_argument("--trials", type=Path, nargs="+", required=True, help="one table an object")
    for option in ("--parameters", "--tilt-references", "--predictions", "--scores", "--curves", "--models"):
        parser.add_argument(option, type=Path, required=True)
    parser.add_argument("--samples", type=int, default=50, help="trials a classifier is trained on")
    parser.add_argument("--draws", type=int, default=20, help="training sets an object")
    parser.add_argument("--ridge", type=float, default=1.0, help="weight of the squared standardised weights")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    import pandas as pd

    from pipeline.classify.features import FEATURE_SETS, MAPPINGS, features, parameters_of
    from pipeline.classify.protocol import ceiling, evaluate
    from pipeline.models import write_models

    trials = pd.concat([read_table(path, "trials") for path in options.trials], ignore_index=True)
    trials = trials[~trials["failed"]].reset_index(drop=True)
    parameters = read_table(options.parameters, "parameters")
    references = read_table(options.tilt_references, "tilt_references")
    mappings = {mapping: parameters_of(parameters, references, mapping) for mapping in MAPPINGS}
    feature_sets = {
        name: features(trials, mappings.get(name, mappings["label_mapping"]), standard=name not in mappings)
        for name in FEATURE_SETS
    }
    label = LABELS[options.experiment]
    results = evaluate(
        trials,
        label,
        feature_sets,
        samples=options.samples,
        draws=options.draws,
        ridge=options.ridge,
        seed=options.seed,
    )
    ceiling(trials, label, results)
    write_table(options.predictions, pd.concat(results.predictions, ignore_index=True), "predictions")
    write_table(options.scores, pd.DataFrame(results.scores), "scores")
    write_table(options.curves, pd.concat(results.curves, ignore_index=True), "curves")
    write_models(options.models, results.models)


if __name__ == "__main__":
    command.run(main)
