"""What was run, and where MLflow tells more of it."""

import argparse
from urllib.parse import quote

# Where MLflow's page is by itself; 1 is the first experiment that a new store is given, 0 is MLflow's own.
ADDRESS = "http://127.0.0.1:5000/#/experiments/1?workflowType=machine_learning"


def settings(options: argparse.Namespace, numbers: dict[str, float]) -> list[tuple[str, str]]:
    """Return pairs of a name and a value."""
    trials = {name: numbers.get(f"simulate.{name}.trials") for name in ("pouring", "filling")}
    told = [f"{count:,.0f} {name}" for name, count in trials.items() if count]
    return [
        ("Known object", options.source.replace("_", " ")),
        ("Objects", str(len(options.objects))),
        ("Trials", ", ".join(told) or "none"),
        ("Engine", f"{options.engine.replace('_', ' ')}, {1e3 * float(options.spacing_m):.0f} mm particles"),
        ("Classifiers", f"{options.samples} samples, {options.draws} draws an object"),
    ]


def runs() -> list[tuple[str, str]]:
    """Return names and addresses of the runs, all of them and those of each experiment, where MLflow shows them."""
    filters = {
        "all runs": "",
        "pouring": "tags.experiment = 'pouring'",
        "filling": "tags.experiment = 'filling'",
    }
    return [
        (name, ADDRESS + (f"&searchFilter={quote(words)}" if words else ""))
        for name, words in filters.items()
    ]
