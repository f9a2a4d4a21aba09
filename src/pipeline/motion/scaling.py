"""What a trajectory of the task space is divided by (section III-B), so that it fits another pair of containers."""

import numpy as np
import pandas as pd

from pipeline.errors import PipelineError

FEATURE_SETS = ("label_mapping", "point_mapping", "standard")
GRAVITY_M_S2 = 9.81


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


def pouring_s(parameters: pd.DataFrame, features: str, held: str, target: str) -> float:
    """Return the reference of time: T = V / √(g r⁵), how long the held's volume V takes into an opening of radius r.

    A flow of V / T is as deep and as fast, for such an opening, with one pair as with another (Froude).
    """
    cup, bowl = (_row(parameters, name, features) for name in (held, target))
    return float(cup["volume_m3"] / np.sqrt(GRAVITY_M_S2 * bowl["radius_m"] ** 5))


def emptied_rad(parameters: pd.DataFrame, features: str, held: str) -> float:
    """Return the tilt at which a container's wall is level under its lip: that of the frustum of its radius, height and volume."""
    cup = _row(parameters, held, features)
    top, height = float(cup["radius_m"]), float(cup["height_m"])
    # V = π h (r² + r s + s²) / 3, for the radius s of the foot; one wider than the opening is a straight wall's.
    rest = 3.0 * float(cup["volume_m3"]) / (np.pi * height) - top**2
    foot = (np.sqrt(max(top**2 + 4.0 * rest, 0.0)) - top) / 2.0
    return float(np.arctan2(height, np.clip(top - foot, 0.0, top)))


def _row(parameters: pd.DataFrame, name: str, mapping: str) -> pd.Series:
    found = parameters[(parameters["object"] == name) & (parameters["mapping"] == mapping)]
    if len(found) != 1:
        known = " ".join(sorted(set(parameters["object"])))
        raise PipelineError(
            f"{name}: expected one row of warped parameters by {mapping}, found {len(found)}; there are {known}"
        )
    return found.iloc[0]
