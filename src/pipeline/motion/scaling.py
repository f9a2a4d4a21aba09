"""What a trajectory of the task space is divided by (section III-B), so that it fits another pair of containers."""

import numpy as np
import pandas as pd

from pipeline.errors import PipelineError

FEATURE_SETS = ("label_mapping", "point_mapping", "standard")


def factors(parameters: pd.DataFrame, features: str, held: str, target: str) -> np.ndarray:
    """Return the references (4,) of x, y, z (metres) and tilt (radians) of a pair by a feature set.

    x and y: radius of the second's opening; z: height of the held; tilt: tilt reference of the held. Standard: all are one, and
    metres and radians stay what they are. parameters: the table `parameters`.
    """
    if features == "standard":
        return np.ones(4)
    cup, bowl = (_row(parameters, name, features) for name in (held, target))
    return np.array([bowl["radius_m"], bowl["radius_m"], cup["height_m"], cup["tilt_reference_rad"]], float)


def to_dimensionless(trajectory: np.ndarray, references: np.ndarray) -> np.ndarray:
    """Return a trajectory (T, 4) of metres and radians divided by `factors` (4,)."""
    return trajectory / references


def from_dimensionless(trajectory: np.ndarray, references: np.ndarray) -> np.ndarray:
    """Return a dimensionless trajectory (T, 4) in metres and radians of the pair with these `factors` (4,)."""
    return trajectory * references


def _row(parameters: pd.DataFrame, name: str, mapping: str) -> pd.Series:
    found = parameters[(parameters["object"] == name) & (parameters["mapping"] == mapping)]
    if len(found) != 1:
        known = " ".join(sorted(set(parameters["object"])))
        raise PipelineError(
            f"{name}: expected one row of warped parameters by {mapping}, found {len(found)}; there are {known}"
        )
    return found.iloc[0]
