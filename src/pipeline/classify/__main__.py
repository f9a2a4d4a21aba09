"""Learn to predict pouring or filling from 50 trials of one object, and test on its others and on other objects."""

from pathlib import Path

from pipeline import command
from pipeline.artefacts import write_table
from pipeline.classify import inputs


def main() -> None:
    """Read all objects' trials and warped parameters; write how well classifiers do, and the classifiers themselves."""
    parser = inputs.parser(__doc__)
    for option in ("--scores", "--replicates"):
        parser.add_argument(option, type=Path, required=True)
    for option in ("--predictions", "--curves", "--models", "--pairs"):
        parser.add_argument(option, type=Path, help="left out when not named")
    options = parser.parse_args()

    import pandas as pd

    from pipeline.classify.protocol import Results, ceiling, evaluate
    from pipeline.models import write_models
    from pipeline.statistics.resampling import Resampled, object_weights

    given, protocol = inputs.read(options), inputs.protocol(options)
    names = [str(name) for name in pd.unique(given.trials["object"])]
    resampled = Resampled(names, object_weights(len(names), options.resamples, options.seed))
    results = Results(resampled, keep_predictions=options.predictions is not None)
    told = f"training sets, {options.experiment}"
    evaluate(given.trials, given.labels, given.feature_sets, protocol, results, told)
    ceiling(given.trials, given.labels, results)
    head = {"experiment": options.experiment, "samples": protocol.samples}
    write_table(options.scores, pd.DataFrame(results.scores), "scores")
    write_table(options.replicates, resampled.table("features", "split").assign(**head), "replicates")
    if options.predictions:
        write_table(options.predictions, results.predictions(given.trials, given.labels), "predictions")
    if options.curves:
        write_table(options.curves, results.curves(), "curves")
    if options.models:
        write_models(options.models, results.models)
    if options.pairs:
        write_table(options.pairs, resampled.pairs("features", "split").assign(**head), "pairs")


if __name__ == "__main__":
    command.run(main)
