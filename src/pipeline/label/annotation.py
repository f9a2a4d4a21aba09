"""What a human says of the source's parts, carried to the points of its fused cloud."""

from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from pipeline.artefacts import points, read_columns, read_json
from pipeline.errors import PipelineError
from pipeline.geometry import frames
from pipeline.label.classifier import PARTS


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
    """Return the parts (N, 3) of points (N, 3): those of the nearest painted point (M, 3), (M, 3 bool).

    Raises PipelineError where the annotation and the scan do not lie on each other (median distance over `reach_m`).
    """
    distance, index = cKDTree(painted_m).query(points_m)
    if np.median(distance) > reach_m:
        raise PipelineError(
            f"{name}: the annotated points should lie on the scan of the source, but are {np.median(distance):.3f} m away "
            "(median); annotate this scan, in its own world frame and in metres"
        )
    return painted_parts[index]
