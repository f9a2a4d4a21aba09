"""Learning curve: how well classifiers do that were trained on fewer or more trials."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline import command
from pipeline.artefacts import write_table
from pipeline.classify import inputs

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.classify.protocol import Protocol
    from pipeline.statistics.resampling import Resampled


def main() -> None:
    """Read all objects' trials and warped parameters; write the resampled scores for each number of samples."""
    parser = inputs.parser(__doc__)
    parser.add_argument("--learning", type=Path, required=True)
    parser.add_argument(
        "--learning-samples", type=int, nargs="+", required=True, help="trials in a training set"
    )
    parser.add_argument("--learning-draws", type=int, default=5, help="training sets an object and number")
    options = parser.parse_args()

    import pandas as pd

    from pipeline.statistics.resampling import Resampled, object_weights

    given = inputs.read(options)
    names = [str(name) for name in pd.unique(given.trials["object"])]
    weights = object_weights(len(names), options.resamples, options.seed)
    sizes, tables = sorted(options.learning_samples), []
    for samples in sizes:
        protocol = replace(inputs.protocol(options), samples=samples, draws=options.learning_draws)
        tables.append(_point(given, protocol, Resampled(names, weights)))
    write_table(options.learning, pd.concat(tables).assign(experiment=options.experiment), "learning")


def _point(given: inputs.Inputs, protocol: "Protocol", resampled: "Resampled") -> "pd.DataFrame":
    """Return the rows of one number of samples."""
    import pandas as pd

    from pipeline.classify.protocol import Results, evaluate

    results = Results(resampled, keep_predictions=False)
    told = f"sets of {protocol.samples} trials, {given.trials['experiment'].iloc[0]}"
    evaluate(given.trials, given.labels, given.feature_sets, protocol, results, told)
    fits = pd.DataFrame(results.scores).drop_duplicates(["features", "training_object", "draw"])
    told = fits.groupby("features").agg(
        separable_share=("separable", "mean"),
        converged_share=("converged", "mean"),
        n_redrawn=("n_redrawn", "sum"),
    )
    return resampled.table("features", "split").assign(samples=protocol.samples).join(told, on="features")


if __name__ == "__main__":
    command.run(main)
