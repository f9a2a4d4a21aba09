"""Report what the robot poured: reports/execution.pdf (Fig. 5 and rates), a film, and the numbers."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipeline import command
from pipeline.artefacts import read_arrays, read_table, write_film, write_json

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.report.execution_page import Film

_WIDTH_PX = 360  # of each picture in the film


def main() -> None:
    """Read executions, trajectories and films; write the pages, the film and the numbers."""
    parser = command.parser(__doc__)
    parser.add_argument("--executions", type=Path, required=True)
    parser.add_argument("--trajectories", type=Path, required=True)
    parser.add_argument("--parameters", type=Path, required=True, help="warped parameters of all objects")
    parser.add_argument(
        "--safety", type=Path, required=True, help="of drawn trajectories, by the stage execute"
    )
    parser.add_argument("--demonstration", type=Path, required=True, help="pair.yaml of the demonstrations")
    parser.add_argument(
        "--films", nargs="+", required=True, type=command.name_and_path, metavar="HELD/TARGET=FILE"
    )
    for name in ("--pages", "--film", "--numbers"):
        parser.add_argument(name, type=Path, required=True)
    options = parser.parse_args()

    from pipeline.motion.demonstrations import read_pair
    from pipeline.report import execution_numbers, execution_page, robot_claims
    from pipeline.report.claims_page import claims_page
    from pipeline.report.style import save

    shown = read_pair(options.demonstration)
    demonstrated = shown["held_object"], shown["target_object"]
    executions = read_table(options.executions, "executions")
    trajectories = read_table(options.trajectories, "trajectories")
    parameters, drawn = read_table(options.parameters, "parameters"), read_table(options.safety, "safety")
    safety = execution_numbers.with_drawn(execution_numbers.unsafe(trajectories, parameters), drawn)
    claims = robot_claims.claim_rows(executions, trajectories, drawn, parameters, demonstrated)
    films = [film(pair, path, executions, demonstrated) for pair, path in options.films]
    with command.steps("what the robot poured", 4) as tell:
        tell("pages")
        pages = [execution_page.pictures(films), execution_page.rates(executions, safety)]
        pages += [execution_page.safety_table(safety), claims_page(claims, robot_claims.NOTE)]
        save(pages, options.pages)
        write_gif(options.film, films, tell)
    found = execution_numbers.numbers(executions, safety, demonstrated)
    write_json(options.numbers, found | {"claims": claims.to_dict("records")})


def film(pair: str, path: Path, executions: "pd.DataFrame", demonstrated: tuple[str, str]) -> "Film":
    """Return the film of a pair, with the counts of the execution that it shows."""
    from pipeline.report.execution_page import Film

    arrays = read_arrays(path)
    held, target = pair.split("/")
    rows = executions[
        (executions["held_object"] == held)
        & (executions["target_object"] == target)
        & (executions["features"] == "label_mapping")
        & (executions["draw"] == int(arrays["draw"]))
    ]
    title = f"{held.replace('_', ' ')} into\n{target.replace('_', ' ')}"
    if (held, target) == demonstrated:
        title += "\n(demonstrated)"
    caption, drop_s = "the arm could follow no sample", np.nan
    for row in rows.itertuples():
        caption = f"{row.n_in_target} of {row.n_balls} balls in the target, {row.n_spilled} beside it"
        drop_s = float(row.first_drop_s)
    return Film(title, caption, arrays["images"], float(arrays["every_s"]), drop_s)


def write_gif(path: Path, films: "list[Film]", tell: Callable[[str], None] = command.untold) -> None:
    """Write the films side by side, two in a row, as an animated GIF; the shorter ones wait at their end."""
    from PIL import Image

    tell("films side by side")
    length = max(len(film.images) for film in films)
    frames = [
        Image.fromarray(_mosaic([film.images[min(number, len(film.images) - 1)] for film in films]))
        for number in range(length)
    ]
    tell("making them smaller")
    width = _WIDTH_PX * min(len(films), 2)
    size = width, round(frames[0].height * width / frames[0].width)
    small = [np.asarray(frame.resize(size, Image.Resampling.LANCZOS)) for frame in frames]
    tell("writing the film")
    write_film(path, small, films[0].every_s)


def _mosaic(images: list[np.ndarray]) -> np.ndarray:
    columns = min(len(images), 2)
    blank = np.full_like(images[0], 255)
    filled = [*images, *([blank] * (-len(images) % columns))]
    rows = [np.concatenate(filled[k : k + columns], axis=1) for k in range(0, len(filled), columns)]
    return np.concatenate(rows, axis=0)


if __name__ == "__main__":
    command.run(main)
