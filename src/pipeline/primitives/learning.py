"""From demonstrations of one pair to a primitive in the space of a feature set."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from pipeline.errors import PipelineError
from pipeline.motion import checks, phase, poses, scaling
from pipeline.motion.demonstrations import Demonstrations
from pipeline.motion.promp import DIMENSIONLESS, UNITS, ProMP


@dataclass(frozen=True)
class Learnt:
    """A primitive, the trajectories (T_i, 4) at phases (T_i,) that it was learnt from, in its units, and their references (4,)."""

    promp: ProMP
    trajectories: list[np.ndarray]
    phases: list[np.ndarray]
    references: np.ndarray


def task_space(
    shown: Demonstrations, parameters: pd.DataFrame, rims: pd.DataFrame, mapping: str
) -> list[np.ndarray]:
    """Return the demonstrations (T_i, 4) in the task space: lip x, y, z in metres, tilt in radians.

    parameters, rims: the tables `parameters` and `tilt_references`; they are needed where the files hold cup poses.
    """
    if not shown.poses or shown.target_pose is None:
        checks.together(shown.files, shown.values)
        return list(shown.values)
    names = {"held_object": shown.held_object, "target_object": shown.target_object}
    rim = rims[(rims["object"] == shown.held_object) & (rims["mapping"] == mapping)]
    bowl = parameters[(parameters["object"] == shown.target_object) & (parameters["mapping"] == mapping)]
    for (key, name), table in zip(names.items(), (rim, bowl), strict=True):
        if table.empty:
            raise PipelineError(
                f"pair.yaml: expected {key} to be an object with warped parameters, found '{name}'; correct it or scan it"
            )
    rim_m = rim[["x_m", "y_m", "z_m"]].to_numpy(float)
    opening_m = bowl[["opening_x_m", "opening_y_m", "opening_z_m"]].to_numpy(float)[0]
    T_world_second = poses.matrices(shown.target_pose[None])[0]
    found = []
    for name, recorded in zip(shown.files, shown.values, strict=True):
        one = poses.trajectory(poses.matrices(recorded), rim_m, T_world_second, opening_m, name)
        checks.tilts(name, one[:, 3])
        found.append(one)
    checks.together(shown.files, found)
    return found


def learn(
    shown: Demonstrations,
    parameters: pd.DataFrame,
    rims: pd.DataFrame,
    features: str,
    *,
    n_basis: int,
    prior_demonstrations: float,
) -> Learnt:
    """Return the primitive of a feature set: scaled by the pair's references, rests cut off, phases aligned."""
    mapping = "label_mapping" if features == "standard" else features
    references = scaling.factors(parameters, features, shown.held_object, shown.target_object)
    times_s, moving = without_rests(shown, task_space(shown, parameters, rims, mapping))
    trajectories = [scaling.to_dimensionless(one, references) for one in moving]
    phases = phase.aligned(times_s, [one[:, 3] for one in trajectories])
    promp = ProMP.fit(
        trajectories,
        phases,
        n_basis=n_basis,
        prior_demonstrations=prior_demonstrations,
        units=UNITS if features == "standard" else DIMENSIONLESS,
        duration_s=float(np.mean([t[-1] - t[0] for t in times_s])),
    )
    return Learnt(promp, trajectories, phases, references)


def without_rests(
    shown: Demonstrations, trajectories: list[np.ndarray]
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Return times (T_i,) and trajectories (T_i, 4) of demonstrations, from where they begin to move to where they end."""
    parts = [phase.moving(t_s, one) for t_s, one in zip(shown.times_s, trajectories, strict=True)]
    times_s = [t_s[part] for t_s, part in zip(shown.times_s, parts, strict=True)]
    return times_s, [one[part] for one, part in zip(trajectories, parts, strict=True)]
