"""Rigid bodies for Bullet: shapes of scanned containers, and poses as Bullet wants them.

Bullet cannot collide two concave meshes: a container that stands is its mesh, one that moves a compound of convex pieces.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pybullet


def concave(vertices_m: np.ndarray, triangles: np.ndarray, client: int) -> int:
    """Return Bullet's number of the shape of a mesh (V, 3), (F, 3) that will not move."""
    return pybullet.createCollisionShape(
        pybullet.GEOM_MESH,
        vertices=vertices_m.tolist(),
        indices=triangles.ravel().tolist(),
        flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
        physicsClientId=client,
    )


def compound(pieces: list[np.ndarray], client: int) -> int:
    """Return Bullet's number of the shape of convex pieces, each given by its extreme points (N, 3)."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "pieces.obj"
        path.write_text(_obj(pieces))
        return pybullet.createCollisionShape(pybullet.GEOM_MESH, fileName=str(path), physicsClientId=client)


def place(body: int, T_world_body: np.ndarray, client: int) -> None:
    """Put a body at a pose (4, 4)."""
    pybullet.resetBasePositionAndOrientation(
        body, T_world_body[:3, 3].tolist(), quaternion(T_world_body[:3, :3]), physicsClientId=client
    )


def quaternion(R: np.ndarray) -> list[float]:
    """Return a rotation (3, 3) as x, y, z, w."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(R, assume_valid=True).as_quat().tolist()


def _obj(pieces: list[np.ndarray]) -> str:
    """Return an OBJ text with one object a piece; Bullet makes each a convex hull of its points (faces only list them)."""
    lines, first = [], 1
    for number, points in enumerate(pieces):
        lines.append(f"o piece{number}")
        lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points]
        lines += [f"f {first} {first + i} {first + (i + 1) % len(points)}" for i in range(len(points))]
        first += len(points)
    return "\n".join(lines) + "\n"
