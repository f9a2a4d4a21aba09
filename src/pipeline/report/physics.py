"""Put what was measured of the liquid on one page, reports/physics.pdf, and into numbers, reports/physics.json."""

from pathlib import Path
from typing import TYPE_CHECKING

from pipeline import command
from pipeline.artefacts import read_table, write_json

if TYPE_CHECKING:
    import pandas as pd


def main() -> None:
    """Read measurements and trials; write the page and the numbers."""
    parser = command.parser(__doc__)
    parser.add_argument("--measurements", type=Path, nargs="+", required=True, help="tables of checks")
    parser.add_argument("--trials", type=Path, nargs="+", required=True, help="all trials of an engine")
    parser.add_argument("--engine", default="liquid", help="what ran --trials")
    parser.add_argument(
        "--other-trials", type=Path, nargs="*", default=[], help="some of them by the other engine"
    )
    parser.add_argument("--page", type=Path, required=True)
    parser.add_argument("--numbers", type=Path, required=True)
    options = parser.parse_args()

    import pandas as pd

    from pipeline.report.physics_numbers import check_numbers, engine_numbers, trial_numbers
    from pipeline.report.physics_page import draw
    from pipeline.report.style import save

    checks = pd.concat([read_table(path, "physics") for path in options.measurements], ignore_index=True)
    trials = pd.concat([read_table(path, "trials") for path in options.trials], ignore_index=True)
    others = [trials.iloc[:0], *(read_table(path, "trials") for path in options.other_trials)]
    others = pd.concat([table for table in others if len(table)] or others, ignore_index=True)
    first, second = (trials, others) if options.engine == "liquid" else (others, trials)
    both = compared(first, second)
    numbers = check_numbers(checks) | trial_numbers(first) | engine_numbers(both)
    write_json(options.numbers, {key: value for key, value in numbers.items() if value == value})
    save(draw(checks, first, both), options.page)


def compared(liquid: "pd.DataFrame", bullet: "pd.DataFrame") -> "pd.DataFrame":
    """Return the trials that both engines ran: label_liquid, label_bullet, tilt and hydrostatic margin.

    The same draw of the same trial: a draw that is void for one engine alone is another trial for the other.
    """
    import pandas as pd

    keys = ["experiment", "object", "trial", "seed", "n_void"]
    merged = liquid.merge(bullet, on=keys, suffixes=("_liquid", "_bullet"))
    merged = merged[~merged["failed_liquid"] & ~merged["failed_bullet"]]
    pouring = merged["experiment"] == "pouring"
    labels = {
        f"label_{engine}": merged[f"poured_{engine}"].where(pouring, merged[f"filled_{engine}"])
        for engine in ("liquid", "bullet")
    }
    margin = merged["hydrostatic_margin_liquid"]
    return pd.DataFrame(
        {
            **{key: merged[key] for key in keys},
            **labels,
            "tilt_rad": merged["tilt_rad_liquid"],
            "margin": margin,
        }
    )


if __name__ == "__main__":
    command.run(main)
