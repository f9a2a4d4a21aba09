"""What a human says of the source's parts, carried to the points of its fused cloud."""

from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from pipeline.artefacts import points, read_columns, read_json
from pipeline.errors import PipelineError
from pipeline.geometry import frames
from pipeline.label.classifier import PARTS

NEIGHBOURS, STEADIER = 12, 0.01


def source_parts(annotation: Path, fusion: Path, points_m: np.ndarray) -> np.ndarray:
    """Return the annotated parts (N, 3 bool) of the source's points (N, 3), object frame; `fusion` tells where that is."""
    painted = read_columns(annotation, "annotation")
    T_object_world = np.array(read_json(fusion)["T_object_world"])
    painted_m = frames.apply(T_object_world, points(painted))
    return transfer_annotation(
        painted_m, np.column_stack([painted[part] for part in PARTS]), points_m, name=str(annotation)
    )


def transfer_annotation(
    painted_m: np.ndarray,
    painted_parts: np.ndarray,
    points_m: np.ndarray,
    *,
    name: str,
    reach_m: float = 0.01,
) -> np.ndarray:
    """Return the parts (N, 3) of points (N, 3) by the painted points (M, 3), (M, 3 bool) that are nearest.

    The nearest alone would leave borders as ragged as the painted points lie. A border runs straight between them instead: the
    labels of some neighbours, 0 or 1, nearer ones weighing more, are fitted by a plane over their places, and a point has a part
    where that is above a half.

    Raises PipelineError where the annotation and the scan do not lie on each other (median distance over `reach_m`).
    """
    distance_m, index = cKDTree(painted_m).query(points_m, k=range(1, min(NEIGHBOURS, len(painted_m)) + 1))
    apart_m = np.median(distance_m[:, 0])
    if apart_m > reach_m:
        raise PipelineError(
            f"{name}: the annotated points should lie on the scan of the source, but are {apart_m:.3f} m away "
            "(median); annotate this scan, in its own world frame and in metres"
        )
    reach = np.maximum(distance_m[:, -1:], 1e-9)
    offset = (painted_m[index] - points_m[:, None]) / reach[..., None]
    return (
        _fitted_here(offset, painted_parts[index].astype(float), np.exp(-2.0 * (distance_m / reach) ** 2))
        > 0.5
    )


def _fitted_here(offset: np.ndarray, values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return what linear fits to values (N, K, P) at offsets (N, K, 3) by weights (N, K) have at the origin (N, P).

    Slopes are held back a little, so that neighbours on one line or plane do for a fit.
    """
    terms = np.concatenate([np.ones((*offset.shape[:2], 1)), offset], axis=2)
    weighted = (terms * weight[..., None]).transpose(0, 2, 1)
    held = STEADIER * weight.sum(axis=1)[:, None, None] * np.diag([0.0, 1.0, 1.0, 1.0])
    return np.linalg.solve(weighted @ terms + held, weighted @ values)[:, 0]
