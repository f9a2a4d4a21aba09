"""Put what was measured of the liquid on two pages, reports/physics.pdf, and into numbers, reports/physics.json."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline import command
from pipeline.artefacts import read_table, write_json

if TYPE_CHECKING:
    import pandas as pd


def main() -> None:
    """Read measurements and trials; write the pages and the numbers."""
    parser = command.parser(__doc__)
    parser.add_argument("--measurements", type=Path, nargs="+", required=True, help="tables of checks")
    parser.add_argument("--trials", type=Path, nargs="+", required=True, help="all trials of an engine")
    parser.add_argument("--engine", default="liquid", help="what ran --trials")
    parser.add_argument(
        "--other-trials",
        nargs="*",
        default=[],
        metavar="ENGINE=TABLE",
        help="some of them by the other engines",
    )
    parser.add_argument("--page", type=Path, required=True)
    parser.add_argument("--numbers", type=Path, required=True)
    options = parser.parse_args()

    import pandas as pd

    from pipeline.report import engines_page, physics_page
    from pipeline.report.engines import compared, engine_numbers
    from pipeline.report.physics_numbers import check_numbers, trial_numbers
    from pipeline.report.style import save

    checks = pd.concat([read_table(path, "physics") for path in options.measurements], ignore_index=True)
    trials = pd.concat([read_table(path, "trials") for path in options.trials], ignore_index=True)
    others = tables(map(command.name_and_path, options.other_trials))
    engines = {options.engine: trials, **others}
    liquid = engines.pop("liquid", trials.iloc[:0])
    both = compared(liquid, engines)
    numbers = check_numbers(checks) | trial_numbers(liquid) | engine_numbers(both, engines)
    write_json(options.numbers, {key: value for key, value in numbers.items() if value == value})
    pages = [physics_page.draw(checks, liquid)]
    save(pages + [engines_page.draw(both)] if len(both) else pages, options.page)


def tables(named: "Iterable[tuple[str, Path]]") -> "dict[str, pd.DataFrame]":
    """Return each engine's trials, read from its tables."""
    import pandas as pd

    read: dict[str, list[pd.DataFrame]] = {}
    for engine, path in named:
        read.setdefault(engine, []).append(read_table(path, "trials"))
    return {engine: pd.concat(parts, ignore_index=True) for engine, parts in read.items()}


if __name__ == "__main__":
    command.run(main)
