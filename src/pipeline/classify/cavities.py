"""Other readings of how much a container holds: the scanned cavity instead of the hull, and what is left in a tilted hull."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd

from pipeline.artefacts import Mesh, points
from pipeline.classify.features import Parameters
from pipeline.geometry import hulls
from pipeline.geometry.cavity import cavity, quadrature

HULL_POINTS = 20000


def with_cavities(parameters: Parameters, meshes: Mapping[str, Mesh]) -> Parameters:
    """Return parameters whose volume and tilt references are those of the scanned cavities instead of the warped hulls.

    `meshes` are the fused ones by object, as everything in the object's frame; rim points and openings stay warped.
    """
    table, references = parameters.table.copy(), {}
    for name, mesh in meshes.items():
        room = cavity(*mesh, name=name)
        inside_m, weights, _ = quadrature(room)
        table.loc[name, "volume_m3"] = room.capacity_m3
        opening = table.loc[name, ["opening_x_m", "opening_y_m", "opening_z_m"]].to_numpy(float)
        rim = parameters.references[name]
        tilts = [
            _weighted_median(hulls.raising_tilt_rad(inside_m, lip, opening), weights) for lip in points(rim)
        ]
        references[name] = rim.assign(tilt_reference_rad=tilts)
    return replace(parameters, table=table, references=references)


def _weighted_median(values: np.ndarray, weights: np.ndarray) -> float:
    order = np.argsort(values)
    below = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(below, below[-1] / 2.0)])


def margins(trials: pd.DataFrame, parameters: Parameters, clouds: Mapping[str, pd.DataFrame]) -> np.ndarray:
    """Return (fill - V(θ)) / V(0) of pouring trials (N,): V(θ) is what of the warped hull is below its lip at the trial's tilt.

    `clouds` are the objects' warped points, table `mapping`.
    """
    own_m, _ = parameters.own_lip(trials["object"], trials[["lip_x_m", "lip_y_m", "lip_z_m"]].to_numpy())
    fill = trials["fill_m3"].to_numpy() / parameters.of(trials["object"], "volume_m3")
    found = np.zeros(len(trials))
    for name in pd.unique(trials["object"]):
        cloud, rows = clouds[name], (trials["object"] == name).to_numpy()
        container_m = points(cloud[cloud["valid"] & cloud["container"]])
        inside_m = hulls.points_in_hull(container_m, HULL_POINTS)
        opening_m = parameters.vector(pd.Series([name]), "opening")[0]
        found[rows] = fill[rows] - _kept(
            inside_m, own_m[rows], opening_m, trials["tilt_rad"].to_numpy()[rows]
        )
    return found


def _kept(inside_m: np.ndarray, lips_m: np.ndarray, opening_m: np.ndarray, tilts: np.ndarray) -> np.ndarray:
    """Return the share (N,) of points (M, 3) that are below the lip (N, 3) of their trial after its tilt (N,)."""
    kept = np.zeros(len(tilts))
    for lip in np.unique(lips_m, axis=0):
        rows = (lips_m == lip).all(axis=1)
        rising = np.sort(hulls.raising_tilt_rad(inside_m, lip, opening_m))
        kept[rows] = 1.0 - np.searchsorted(rising, tilts[rows]) / len(rising)
    return kept
