"""Parts of a mesh, as designers leave them: a handle that sticks in the wall, coffee in the mug."""

from typing import Any

import numpy as np

from pipeline.fuse.wrapping import Mesh

MOST_PARTS = 200
# A normal's z, and heights as a share of the mesh's size, of a liquid's top: menisci, foam.
LEVEL, FLAT = 0.9, 0.06
LEAST_WIDTH, LEAST_TOP = 0.4, 0.5  # of the mesh's width, and of the box around the top: a filling's


def united(mesh: Any) -> Mesh | None:
    """Return the union (vertices (V, 3), triangles (F, 3)) of a trimesh's parts, oriented outwards, without voids in the solid.

    None where a part is open, or where they do not hang together.
    """
    import manifold3d
    import trimesh

    labels = _labels(mesh)
    if labels.max() >= MOST_PARTS:
        return None
    solids = []
    for part in mesh.submesh([np.flatnonzero(labels == k) for k in range(labels.max() + 1)], repair=False):
        trimesh.repair.fix_winding(part)
        solid = _solid(part.vertices, part.faces)
        if solid.volume() < 0:
            solid = _solid(part.vertices, part.faces[:, ::-1])
        if solid.is_empty():
            return None
        solids.append(solid)
    union = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add)
    bodies = [body for body in union.decompose() if body.volume() > 0]
    if len(bodies) != 1:
        return None
    result = bodies[0].to_mesh64()
    return np.asarray(result.vert_properties, float)[:, :3], np.asarray(result.tri_verts, np.int64)


def _solid(vertices: np.ndarray, triangles: np.ndarray) -> Any:
    import manifold3d

    return manifold3d.Manifold(manifold3d.Mesh64(vertices, np.ascontiguousarray(triangles, np.uint64)))


def body_and_highest(mesh: Any) -> tuple[Any, np.ndarray] | None:
    """Return a trimesh's part of the largest area, and the corners (2, 3) of the box around the highest of the others."""
    labels = _labels(mesh)
    if not 0 < labels.max() < MOST_PARTS:
        return None
    body = labels == np.bincount(labels, mesh.area_faces).argmax()
    tops = np.where(body, -np.inf, mesh.triangles[..., 2].max(axis=1))
    corners = mesh.triangles[labels == labels[tops.argmax()]].reshape(-1, 3)
    return mesh.submesh([body], append=True, repair=False), np.stack(
        [corners.min(axis=0), corners.max(axis=0)]
    )


def filling(mesh: Any) -> np.ndarray | None:
    """Return which triangles (F,) of an upright trimesh are a part with a level top inside of the rest, as liquid is; or None.

    Of several, such as a floor made for itself, the highest.
    """
    labels = _labels(mesh)
    if not 0 < labels.max() < MOST_PARTS:
        return None
    found = {
        k: mesh.triangles[labels == k][..., 2].max()
        for k in range(labels.max() + 1)
        if _fills(mesh, labels == k)
    }
    return labels == max(found, key=found.__getitem__) if found else None


def _fills(mesh: Any, own: np.ndarray) -> bool:
    """Return whether the triangles (F,) lie inside of the rest, wide and with a nearly level top."""
    corners, (left, right) = mesh.triangles[own], mesh.bounds
    low, top = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    widths = (top - low)[:2]
    if (
        (low[:2] <= left[:2]).any()
        or (top >= right).any()
        or widths.min() < LEAST_WIDTH * (right - left)[:2].min()
    ):
        return False
    highest = (corners[..., 2] > top[2] - FLAT * (right - left).max()).all(axis=1)
    level = highest & (np.abs(mesh.face_normals[own, 2]) > LEVEL)
    return bool(mesh.area_faces[own][level].sum() > LEAST_TOP * widths.prod())


def _labels(mesh: Any) -> np.ndarray:
    """Return the part (F,) of each triangle: what hangs together by edges that two triangles share."""
    from trimesh.graph import connected_component_labels

    return connected_component_labels(mesh.face_adjacency, node_count=len(mesh.faces))
