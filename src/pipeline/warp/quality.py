"""How well a warp lies on its target."""

import numpy as np
from scipy.spatial import cKDTree

from pipeline.warp.alignment import PartFrame
from pipeline.warp.clouds import Cloud, Mapped
from pipeline.warp.warp import Warp

WALL_COSINE = (
    0.8  # a point is on a wall, not on a lip or floor, where its normal is this near to the horizontal
)


def quality(warp: Warp, mapped: Mapped) -> dict[str, float]:
    """Return mean distance of the pairs (m), shares without candidate, of flipped walls, and of the target reached."""
    counted = mapped.valid & warp.is_known[mapped.target_index]
    return {
        "residual_m": float(np.mean(mapped.distance_m[counted])),
        "share_without_candidate": float(np.mean(~mapped.valid)),
        "wall_side_flips": wall_side_flips(warp, mapped.source_index, mapped.target_index),
        "share_of_target_reached": len(np.unique(mapped.target_index[mapped.valid]))
        / len(warp.target.points_m),
    }


def wall_side_flips(warp: Warp, source_index: np.ndarray, target_index: np.ndarray) -> float:
    """Return the share of pairs on the wall whose points face opposite ways from the axis of the container.

    Indices (N,) are rows of source and target; pairs with −1 do not count.
    """
    paired = (source_index >= 0) & (target_index >= 0)
    here = _facing_outward(warp.aligned, warp.target_frame)[source_index[paired]]
    there = _facing_outward(warp.target, warp.target_frame)[target_index[paired]]
    on_wall = (np.abs(here) > WALL_COSINE) & (np.abs(there) > WALL_COSINE)
    return float(np.mean(here[on_wall] * there[on_wall] < 0.0)) if on_wall.any() else 0.0


def unchecked_flips(warp: Warp) -> float:
    """Return the share of wall points that would change sides if the nearest point were taken whatever its normal."""
    _, nearest = cKDTree(warp.aligned.points_m).query(warp.target.points_m)
    return wall_side_flips(warp, nearest, np.arange(len(nearest)))


def _facing_outward(cloud: Cloud, frame: PartFrame) -> np.ndarray:
    radial = cloud.points_m[:, :2] - frame.T_object_part[:2, 3]
    radial = radial / np.maximum(np.linalg.norm(radial, axis=1, keepdims=True), 1e-9)
    return np.einsum("nc,nc->n", radial, cloud.normals[:, :2])
