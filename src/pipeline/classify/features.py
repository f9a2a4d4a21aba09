"""Features α/α_r of trials (section III-A): dimensionless by warped parameters, or standard (every α_r = 1)."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from pipeline.errors import PipelineError
from pipeline.geometry import frames

FEATURE_SETS = ("point_mapping", "label_mapping", "standard")
MAPPINGS = FEATURE_SETS[:2]


@dataclass(frozen=True)
class Parameters:
    """The warped parameters of all objects by one mapping, rows by name, and the tilt references of their rim points."""

    table: pd.DataFrame
    references: dict[str, pd.DataFrame]

    def of(self, names: pd.Series, column: str) -> np.ndarray:
        """Return one parameter for each named object (N,)."""
        return self.table[column].reindex(names).to_numpy(float)

    def vector(self, names: pd.Series, what: str) -> np.ndarray:
        """Return one point for each named object (N, 3), metres, object frame."""
        return np.column_stack([self.of(names, f"{what}_{axis}_m") for axis in "xyz"])

    def own_lip(self, names: pd.Series, lip_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the own rim point (N, 3) nearest to each lip (N, 3), both in the object's frame, and its tilt reference."""
        own, tilt_rad = np.zeros_like(lip_m), np.zeros(len(lip_m))
        for name in names.unique():
            rows, reference = (names == name).to_numpy(), self.references[name]
            rim_m = reference[["x_m", "y_m", "z_m"]].to_numpy()
            nearest = cKDTree(rim_m).query(lip_m[rows])[1]
            own[rows], tilt_rad[rows] = rim_m[nearest], reference["tilt_reference_rad"].to_numpy()[nearest]
        return own, tilt_rad


def parameters_of(parameters: pd.DataFrame, references: pd.DataFrame, mapping: str) -> Parameters:
    """Pick one mapping's rows out of the tables `parameters` and `tilt_references`."""
    table = parameters[parameters["mapping"] == mapping].set_index("object")
    rims = references[references["mapping"] == mapping]
    return Parameters(table, dict(tuple(rims.groupby("object", observed=True))))


def features(trials: pd.DataFrame, parameters: Parameters, *, standard: bool) -> np.ndarray:
    """Return the features of trials of one experiment: pouring (N, 2), filling (N, 6).

    Pouring: tilt, fill. Filling: tilt and fill of the held cup, fill of the second, height of the lip above the second,
    and its distance from the second along and across the pour. Standard features are in rad, m³ and m.
    """
    missing = set(trials["object"]) | set(trials["held_object"]) - {None}
    missing -= set(parameters.table.index)
    if missing:
        raise PipelineError(f"the trials' objects {' '.join(sorted(missing))} have no warped parameters")
    return (
        _pouring(trials, parameters, standard)
        if _is_pouring(trials)
        else _filling(trials, parameters, standard)
    )


def _is_pouring(trials: pd.DataFrame) -> bool:
    return bool((trials["experiment"] == "pouring").all())


def _lips(trials: pd.DataFrame) -> np.ndarray:
    return trials[["lip_x_m", "lip_y_m", "lip_z_m"]].to_numpy()


def _pouring(trials: pd.DataFrame, parameters: Parameters, standard: bool) -> np.ndarray:
    tilt, fill = trials["tilt_rad"].to_numpy(), trials["fill_m3"].to_numpy()
    if standard:
        return np.column_stack([tilt, fill])
    _, tilt_reference = parameters.own_lip(trials["object"], _lips(trials))
    return np.column_stack([tilt / tilt_reference, fill / parameters.of(trials["object"], "volume_m3")])


def _filling(trials: pd.DataFrame, parameters: Parameters, standard: bool) -> np.ndarray:
    held, second = trials["held_object"], trials["object"]
    quantities = trials[["tilt_rad", "fill_m3", "second_fill_m3"]].to_numpy()
    if standard:
        along, across, up = _offset(
            trials, parameters.vector(held, "centre"), parameters.vector(second, "centre")
        )
        return np.column_stack([quantities, up, np.abs(along), np.abs(across)])
    lip, tilt_reference = parameters.own_lip(held, _lips(trials))
    along, across, up = _offset(trials, lip, parameters.vector(second, "opening"))
    radius = parameters.of(second, "radius_m")
    volumes = parameters.of(held, "volume_m3"), parameters.of(second, "volume_m3")
    references = np.column_stack([tilt_reference, *volumes])
    place = [up / parameters.of(held, "height_m"), np.abs(along) / radius, np.abs(across) / radius]
    return np.column_stack([quantities / references, *place])


def _offset(trials: pd.DataFrame, held_point_m: np.ndarray, second_point_m: np.ndarray) -> np.ndarray:
    """Return along the pour, across it and up (3, N): held point minus second's point, before tilting, in the world."""
    offset = _in_world(trials["T_world_held"], held_point_m) - _in_world(
        trials["T_world_second"], second_point_m
    )
    axis = trials[["axis_x", "axis_y", "axis_z"]].to_numpy()
    along = np.cross(axis, [0.0, 0.0, 1.0])
    return np.stack([np.einsum("nc,nc->n", offset, along), np.einsum("nc,nc->n", offset, axis), offset[:, 2]])


def _in_world(poses: pd.Series, points_m: np.ndarray) -> np.ndarray:
    T_world_body = np.stack(poses.to_list()).reshape(-1, 4, 4)
    return np.stack([frames.apply(T, point) for T, point in zip(T_world_body, points_m, strict=True)])
