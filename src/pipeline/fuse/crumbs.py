"""Pieces of a mesh that touch nothing else: crumbs of a scan, which go, and other things beside the object, which are found."""

from typing import Any

import numpy as np

from pipeline.geometry.surface import Surface

SMALL = 0.25  # of the widest piece
# Of the widest piece: what is nearer to the rest is a part of it, as a handle modelled for itself.
APART = 0.01
MOST_HALVED = 20


def without(mesh: Any) -> tuple[Any, int]:
    """Return the trimesh without its crumbs, small pieces that hang in the air, and how many there were."""
    pieces, low, high = _pieces(mesh)
    width = np.linalg.norm(high - low, axis=1)
    kept = _with_near(mesh, pieces, width >= SMALL * width.max(), APART * width.max())
    if not kept.all():
        mesh.update_faces(kept[pieces])
        mesh.remove_unreferenced_vertices()
    return mesh, int(np.count_nonzero(~kept))


def beside(mesh: Any) -> np.ndarray | None:
    """Return the corners (2, 3) of a wide thing that stands apart from the largest piece of a trimesh; None without one."""
    pieces, low, high = _pieces(mesh)
    width = np.linalg.norm(high - low, axis=1)
    body = np.bincount(pieces, mesh.area_faces).argmax()  # a spoon in a cup is wider
    own = _with_near(mesh, pieces, np.arange(len(width)) == body, APART * width.max())
    other = int(np.where(own, 0.0, width).argmax())
    return None if own[other] or width[other] < SMALL * width.max() else np.stack([low[other], high[other]])


def alone(file: str, other: np.ndarray, where: str, cure: str) -> str:
    """Return the sentence that names another thing, by the corners (2, 3) of the box around it."""
    x, y, z = (f"{v:.0f}" for v in 1000 * other.mean(axis=0))
    return (
        f"{file}: expected a container alone, found something {1000 * np.ptp(other, axis=0).max():.0f} mm wide {where} at "
        f"({x}, {y}, {z}) mm of the upright object; {cure} where you made the file"
    )


def _pieces(mesh: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the piece (F,) of each triangle, and the corners (P, 3), (P, 3) of the box around each."""
    from trimesh.graph import connected_component_labels

    labels = connected_component_labels(mesh.edges, node_count=len(mesh.vertices))
    used, piece = np.unique(labels[mesh.faces[:, 0]], return_inverse=True)
    low, high = np.full((len(used), 3), np.inf), np.full((len(used), 3), -np.inf)
    np.minimum.at(low, piece, mesh.triangles.min(axis=1))
    np.maximum.at(high, piece, mesh.triangles.max(axis=1))
    return piece, low, high


def _with_near(mesh: Any, pieces: np.ndarray, kept: np.ndarray, apart_m: float) -> np.ndarray:
    """Return the pieces (P,) that are kept, with those that are near to them, those near to these, and so on."""
    from trimesh.remesh import subdivide_to_size

    new = kept
    while new.any() and not kept.all():
        surface = Surface(np.asarray(mesh.vertices, float), np.asarray(mesh.faces)[new[pieces]])
        asked = np.flatnonzero(~kept[pieces])
        # Points all over: a piece that sticks in the rest may have no corner near its surface.
        points, faces, of = subdivide_to_size(
            mesh.vertices, mesh.faces[asked], apart_m, MOST_HALVED, return_index=True
        )
        near = (surface.distance(points) < apart_m)[faces].any(axis=1)
        new = np.zeros(len(kept), bool)
        new[pieces[asked[of[near]]]] = True
        kept = kept | new
    return kept
