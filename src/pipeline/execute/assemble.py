"""Put what the arms did and what was poured together: one row an execution, with the verdict."""

from pathlib import Path

from pipeline import command
from pipeline.artefacts import read_table, write_table


def main() -> None:
    """Write the executions, and all trajectories, of all pairs."""
    parser = command.parser(__doc__)
    parser.add_argument("--source", required=True, help="the annotated object that all are warped from")
    for name in ("--attempts", "--outcomes"):
        parser.add_argument(name, nargs="+", type=Path, required=True, help="tables of all pairs")
    parser.add_argument("--trajectory-tables", nargs="*", type=Path, help="those of all pairs")
    parser.add_argument("--parameters", type=Path, required=True, help="warped parameters of all objects")
    parser.add_argument("--fill", type=float, default=0.5, help="share of the held cup's capacity")
    parser.add_argument("--liquid", action="store_true", help="judge as a liquid, not as gel balls")
    parser.add_argument("--executions", type=Path, required=True, help="where they are written")
    parser.add_argument("--trajectories", type=Path, help="where they are written, if at all")
    options = parser.parse_args()

    import pandas as pd

    from pipeline.execute import verdict

    tables = (("attempts", options.attempts), ("carried", options.outcomes))
    attempts, carried = (pd.concat([read_table(p, name) for p in paths]) for name, paths in tables)
    rows = verdict.executions(attempts, carried, options.liquid)
    capacity = read_table(options.parameters, "parameters").query("mapping == 'label_mapping'")
    capacity_m3 = capacity.set_index("object")["capacity_m3"]
    rows["fill_m3"] = options.fill * rows["held_object"].map(capacity_m3)
    rows["target_capacity_m3"] = rows["target_object"].map(capacity_m3)
    rows["fits"] = rows["fill_m3"] <= verdict.FITS * rows["target_capacity_m3"]
    write_table(options.executions, rows.assign(source=options.source), "executions")
    if options.trajectories:
        together = pd.concat([read_table(path, "trajectories") for path in options.trajectory_tables])
        write_table(options.trajectories, together, "trajectories")


if __name__ == "__main__":
    command.run(main)
