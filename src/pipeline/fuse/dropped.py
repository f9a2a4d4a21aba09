"""A mesh that a user dropped: read, repaired, put upright on z = 0."""

from pathlib import Path

import numpy as np

from pipeline.errors import PipelineError
from pipeline.fuse.layouts import DroppedMesh
from pipeline.geometry import frames

LARGEST_M, SMALLEST_M = 2.0, 0.005


def read(dropped: DroppedMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices (V, 3) in metres, object frame, triangles (F, 3) oriented outwards, and T_object_world.

    The world is the file's own frame in metres. The mesh stands with its lowest point on z = 0, over the origin.
    """
    mesh = _repaired(_load(dropped.path), dropped.path)
    world = np.asarray(mesh.vertices, float) * (dropped.options.unit_m or 1.0)
    _check_size(world, dropped.path)
    T_object_world = _upright(world, dropped.options.up or "z")
    return frames.apply(T_object_world, world), np.asarray(mesh.faces, np.int64), T_object_world


def _load(path: Path):  # type: ignore[no-untyped-def]
    import trimesh

    try:
        mesh = trimesh.load(path, force="mesh", process=False)
    except Exception as error:  # each reader of trimesh has errors of its own
        raise PipelineError(
            f"{path}: expected a mesh, but it cannot be read: {error}; export it again"
        ) from error
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise PipelineError(
            f"{path}: expected a mesh with faces, found none; export the surface, not its points"
        )
    return mesh


def _repaired(mesh, path: Path):  # type: ignore[no-untyped-def]
    """Merge equal vertices, drop empty and double faces, wind faces alike and outwards."""
    import trimesh

    finite = np.isfinite(mesh.vertices).all(axis=1)
    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    mesh.update_faces(finite[mesh.faces].all(axis=1))
    mesh.remove_unreferenced_vertices()
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    mesh.update_faces(mesh.nondegenerate_faces())
    mesh.update_faces(mesh.unique_faces())
    if len(mesh.faces) == 0:
        raise PipelineError(f"{path}: expected a mesh with faces, found only empty ones; export it again")
    trimesh.repair.fix_normals(mesh, multibody=True)
    trimesh.repair.fill_holes(mesh)
    mesh.remove_unreferenced_vertices()
    return mesh


def _check_size(vertices_m: np.ndarray, path: Path) -> None:
    size = float(np.ptp(vertices_m, axis=0).max())
    if size > LARGEST_M:
        raise PipelineError(
            f"{path}: expected a container of at most {LARGEST_M:g} m, found one of {size:.3g} m; "
            f"looks like millimetres: write `units: mm` into {path.parent / 'scan.yaml'}"
        )
    if size < SMALLEST_M:
        raise PipelineError(
            f"{path}: expected a container of at least {SMALLEST_M * 1e3:g} mm, found one of {size * 1e3:.3g} mm; "
            f"correct `units` in {path.parent / 'scan.yaml'} (m, cm or mm)"
        )


def _upright(vertices_m: np.ndarray, up: str) -> np.ndarray:
    """Return T_object_world that turns the axis `up` to z and stands the vertices (V, 3) on z = 0 over the origin."""
    axis = "xyz".index(up[-1])
    R = np.roll(np.eye(3), 2 - axis, axis=0)
    if up.startswith("-"):
        R = np.diag([1.0, -1.0, -1.0]) @ R
    turned = vertices_m @ R.T
    low, high = turned.min(axis=0), turned.max(axis=0)
    return frames.transform(R, -np.array([*(low + high)[:2] / 2, low[2]]))
