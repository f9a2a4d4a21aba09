"""Where the robot believes the lip of the held cup and the opening of the second container to be, by each feature set."""

import numpy as np
import pandas as pd

from pipeline.errors import PipelineError
from pipeline.execute.task import Task

STANDARD = "standard"


def task(
    parameters: pd.DataFrame, features: str, held: str, target: str, demonstrated: tuple[str, str]
) -> Task:
    """Return the task frame of a pair as a feature set has it.

    Warped sets read lip and opening off the pair's own warps. The standard set knows where the objects' centres are and nothing of
    their shape: lip and opening are where they are, from the centres, in the demonstrated pair.
    """
    if features == STANDARD:
        cup, bowl = (_row(parameters, name, "label_mapping") for name in demonstrated)
        lip = _at(_row(parameters, held, "label_mapping"), "centre") + _at(cup, "lip") - _at(cup, "centre")
        opening = _at(_row(parameters, target, "label_mapping"), "centre")
        opening = opening + _at(bowl, "opening") - _at(bowl, "centre")
        out = _at(cup, "lip") - _at(cup, "opening")
    else:
        cup = _row(parameters, held, features)
        lip, opening = _at(cup, "lip"), _at(_row(parameters, target, features), "opening")
        out = lip - _at(cup, "opening")
    return Task(lip, float(np.arctan2(out[1], out[0])), opening)


def _row(parameters: pd.DataFrame, name: str, mapping: str) -> pd.Series:
    found = parameters[(parameters["object"] == name) & (parameters["mapping"] == mapping)]
    if len(found) != 1:
        raise PipelineError(
            f"{name}: expected its warped parameters by {mapping}, found {len(found)} rows; is it an object in data/raw?"
        )
    return found.iloc[0]


def _at(row: pd.Series, what: str) -> np.ndarray:
    return row[[f"{what}_{axis}_m" for axis in "xyz"]].to_numpy(float)
