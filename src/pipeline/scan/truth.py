"""What is true about a demonstration object, for the report and the tests alone: no stage reads it."""

from pathlib import Path

import numpy as np
import pandas as pd

from pipeline import artefacts
from pipeline.geometry.sampling import triangle_areas_and_normals, uniform_points
from pipeline.scan.shapes import Shape

POINTS = 40_000


def cloud(shape: Shape, n: int, rng: np.random.Generator) -> pd.DataFrame:
    """Return n uniform points of the true surface as table `truth`, object frame."""
    points, triangle = uniform_points(shape.vertices_m, shape.triangles, n, rng)
    _, normals = triangle_areas_and_normals(shape.vertices_m, shape.triangles)
    columns = np.hstack([points, normals[triangle]])
    frame = pd.DataFrame(columns, columns=["x_m", "y_m", "z_m", "nx", "ny", "nz"])
    return frame.assign(**shape.parts(points, triangle))


def radius_m(rim_points_m: np.ndarray) -> float:
    """Return the mean distance of the rim's points (N, 3) to their mean."""
    return float(np.linalg.norm(rim_points_m - rim_points_m.mean(axis=0), axis=1).mean())


def write(folder: Path, shape: Shape, T_world_object: np.ndarray, rng: np.random.Generator) -> None:
    """Write truth.ply, truth.parquet (object frame) and truth.json into `folder`."""
    points = cloud(shape, POINTS, rng)
    artefacts.write_mesh(folder / "truth.ply", (shape.vertices_m, shape.triangles))
    artefacts.write_table(folder / "truth.parquet", points, "truth")
    facts = {
        "T_world_object": T_world_object.tolist(),
        "radius_m": radius_m(artefacts.points(points[points.rim])),
        "height_m": shape.height_m,
        "hull_volume_m3": shape.hull_volume_m3,
        "capacity_m3": shape.capacity_m3,
        "wall_m": shape.wall_m,
        "has_handle": shape.has_handle,
        "roll_symmetric": shape.roll_symmetric,
    }
    artefacts.write_json(folder / "truth.json", facts)
