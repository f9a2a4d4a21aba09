"""An object for the browser: its surface thinned, its parts at the vertices, its marks. Object frame, metres."""

from typing import Any

import numpy as np

from pipeline.artefacts import Mesh
from pipeline.geometry.surface import subdivided
from pipeline.scene.packing import pack

TRIANGLES = 7000
LONGEST_EDGE_M = 0.006  # so that the parts' borders, drawn between vertices, are where they belong
NEIGHBOURS = 5


def surface(
    mesh: Mesh, points_m: np.ndarray, parts: np.ndarray, neighbours: int = NEIGHBOURS
) -> dict[str, Any]:
    """Return the part of the viewer's object that tells of its surface.

    mesh: vertices (V, 3), triangles (F, 3). points_m (N, 3) with parts (N, 3 bool: container, rim, handle); a vertex has the
    mean of the parts of its nearest points. `nearest` holds each vertex's nearest point.
    """
    from scipy.spatial import cKDTree

    vertices, triangles = thinned(mesh)
    _, index = cKDTree(points_m).query(vertices, k=min(neighbours, len(points_m)), workers=1)
    index = index.reshape(len(vertices), -1)
    shares = np.asarray(parts, float)[index].mean(axis=1)
    low, span = vertices.min(axis=0), np.maximum(np.ptp(vertices, axis=0), 1e-6)
    arrays = {
        "positions": np.rint((vertices - low) / span * 65535).astype(np.uint16),
        "normals": np.rint(127 * vertex_normals(vertices, triangles)).astype(np.int8),
        "parts": np.rint(255 * shares).astype(np.uint8),
        "nearest": index[:, 0].astype(np.uint16 if len(points_m) < 65536 else np.uint32),
        "triangles": triangles.astype(np.uint16 if len(vertices) < 65536 else np.uint32),
    }
    return {"low_m": low.tolist(), "span_m": span.tolist(), "surface": pack(arrays)}


def thinned(mesh: Mesh, triangles: int = TRIANGLES, longest_m: float = LONGEST_EDGE_M) -> Mesh:
    """Return a mesh of about so many triangles, by quadrics, before its longest edges are split."""
    from pipeline.geometry.open3d_core import open3d as o3d

    full = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(np.array(mesh[0])), o3d.utility.Vector3iVector(mesh[1].astype(np.int32))
    )
    few = full.simplify_quadric_decimation(triangles) if len(mesh[1]) > triangles else full
    return subdivided(np.asarray(few.vertices), np.asarray(few.triangles, dtype=np.int64), longest_m)


def vertex_normals(vertices_m: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return unit normals (V, 3): the means of the faces around each vertex, by area."""
    corners = vertices_m[triangles]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.zeros_like(vertices_m)
    for corner in range(3):
        np.add.at(total, triangles[:, corner], face)
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-30)
