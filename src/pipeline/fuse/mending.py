"""Meshes of others: cleaned, holes closed, hidden and double parts removed, oriented outwards; or refused with the reason."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import ndimage

from pipeline.errors import PipelineError
from pipeline.fuse import crumbs, parts
from pipeline.fuse.wrapping import Field, Mesh, thickness_m, wrapped
from pipeline.geometry import sampling
from pipeline.geometry.cavity import cavity
from pipeline.geometry.surface import Surface

MOST_TRIANGLES = 3_000_000
BASE_SHARE = 0.06  # of the height: holes whose edge is lower are closed by the table
LARGEST_HOLE = 0.15  # of the size: a wider hole would be a guess
ENCLOSED = 0.99  # of the area is the solid's, or in it, where nothing was reached through a hole
MOST_SHEET = 0.2  # of the area may be seen from both sides
SEEN = 0.04  # of the directions from a point lead outside, where it counts as seen
SAMPLES, DIRECTIONS = 1500, 48
FURTHEST = 1e6  # of a vertex, in the file's units: what is further is damage
FIN_ROUNDS = 3  # what is left of double triangles goes layer by layer


@dataclass(frozen=True)
class Hole:
    """Edges (E, 2) that have one triangle and hang together: their middle (3,), width and highest point in metres."""

    edges: np.ndarray
    centre_m: np.ndarray
    width_m: float
    high_m: float


class Certain(PipelineError):
    """What is wrong is known, however closely the object was scanned."""


def mended(
    mesh: Any, wall_m: float | None, file: str, rng: np.random.Generator, is_filled: bool = False
) -> tuple[Mesh, dict[str, Any]]:
    """Return a trimesh (object frame, metres) as a closed mesh, oriented outwards, and what was done to it.

    With `is_filled` no sheet is taken for one on the wall. A `PipelineError` names the file when the surface has no thickness
    or a hole too large to guess what was there.
    """
    mesh = cleaned(mesh, file)
    facts: dict[str, Any] = {"components": int(mesh.body_count), "holes_closed": 0, "remeshed": False}
    mesh, facts["crumbs_dropped"] = crumbs.without(mesh)
    sheet = seen_from_both_sides(mesh, rng)
    if sheet > MOST_SHEET and wall_m is None:
        raise PipelineError(
            f"{file}: expected a wall with two sides, found a surface without thickness ({sheet:.0%} of it can be seen from "
            "both sides); give it thickness, or write `wall_mm:` into scan.yaml beside it"
        )
    if wall_m is not None and sheet <= MOST_SHEET:
        raise PipelineError(
            f"{file}: expected a surface without thickness, as scan.yaml gives `wall_mm`, found a wall with two sides "
            f"({sheet:.0%} of it can be seen from both sides); remove `wall_mm`"
        )
    if sheet > MOST_SHEET:
        result = wrapped(*arrays(mesh), wall_m).surface()
        _check_alone(result, file)
        return result, facts | {"remeshed": True, "thickened_m": wall_m}
    found = holes(mesh)
    wide = [hole for hole in found if _is_wide(hole, mesh)]
    closed = [hole for hole in found if not _is_wide(hole, mesh)]
    if closed:
        mesh = _filled(mesh, closed)
        facts["holes_closed"] = len(closed)
    if wide and is_filled:
        raise PipelineError(_wide_hole(wide[0], mesh, file))
    if not wide and sound(mesh):
        return arrays(mesh), facts
    whole = None if wide else parts.united(mesh)
    if whole is not None:
        return whole, facts
    field = wrapped(*arrays(mesh))
    result = field.surface()
    if wide:
        _check_enclosed(wide[0], mesh, field, result, file)
    _check_kept(mesh, result, file)
    _check_alone(result, file)
    _check_thick(mesh, result, field.cell_m, file)
    return result, facts | {"remeshed": True}


def arrays(mesh: Any) -> Mesh:
    """Return vertices (V, 3) and triangles (F, 3) of a trimesh."""
    return np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)


def cleaned(mesh: Any, file: str) -> Any:
    """Return the mesh with equal vertices merged and without infinite, empty and double triangles."""
    import trimesh

    if len(mesh.faces) > MOST_TRIANGLES:
        raise PipelineError(
            f"{file}: expected at most {MOST_TRIANGLES} triangles, found {len(mesh.faces)}; make the mesh coarser"
        )
    vertices = np.asarray(mesh.vertices, float)
    if len(mesh.faces) and not 0 <= mesh.faces.min() <= mesh.faces.max() < len(vertices):
        raise PipelineError(
            f"{file}: expected triangles of its {len(vertices)} vertices, found others; the file is damaged: export it again"
        )
    finite = (np.abs(vertices) < FURTHEST).all(axis=1)  # NaN is not less
    mesh = trimesh.Trimesh(np.where(finite[:, None], vertices, 0.0), mesh.faces, process=False)
    mesh.update_faces(finite[mesh.faces].all(axis=1))
    mesh.remove_unreferenced_vertices()
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    mesh.update_faces(_with_three_corners(mesh))
    mesh.update_faces(mesh.unique_faces())
    for _ in range(FIN_ROUNDS):
        fins = _fins(mesh)
        if not fins.any():
            break
        mesh.update_faces(~fins)
    mesh.remove_unreferenced_vertices()
    if len(mesh.faces) == 0:
        raise PipelineError(f"{file}: expected a mesh with faces, found only empty ones; export it again")
    return mesh


def _with_three_corners(mesh: Any) -> np.ndarray:
    """Return which triangles (F,) have three different corners; thin ones stay, as without them there is a gap."""
    a, b, c = mesh.faces.T
    return (a != b) & (b != c) & (c != a)


def _edges(mesh: Any) -> np.ndarray:
    """Return the three edges of each triangle (3 F,) as one number each, the same in both directions: sorted faster than pairs."""
    a, b = np.sort(mesh.edges, axis=1).astype(np.int64).T
    return a * len(mesh.vertices) + b


def _fins(mesh: Any) -> np.ndarray:
    """Return which triangles (F,) stand off the surface: a free edge, and another that two others share already."""
    _, index, count = np.unique(_edges(mesh), return_inverse=True, return_counts=True)
    shared = count[index].reshape(-1, 3)
    return (shared == 1).any(axis=1) & (shared > 2).any(axis=1)


def sound(mesh: Any) -> bool:
    """Return whether the mesh is one closed body; it is then oriented outwards."""
    import trimesh

    if not mesh.is_watertight or mesh.body_count != 1:
        return False
    trimesh.repair.fix_normals(mesh)
    return bool(mesh.is_winding_consistent and mesh.volume > 0)


def holes(mesh: Any) -> list[Hole]:
    """Return the holes of the mesh, the widest first."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    unique, count = np.unique(_edges(mesh), return_counts=True)
    border = np.stack(np.divmod(unique[count == 1], len(mesh.vertices)), axis=1)
    if len(border) == 0:
        return []
    used, index = np.unique(border, return_inverse=True)
    index = index.reshape(-1, 2)
    graph = coo_matrix((np.ones(len(index)), index.T), shape=(len(used), len(used)))
    n, part = connected_components(graph, directed=False)
    points = np.asarray(mesh.vertices, float)[used]
    found = []
    for k in range(n):
        own = points[part == k]
        width = float(np.linalg.norm(np.ptp(own, axis=0)))
        found.append(Hole(border[part[index[:, 0]] == k], own.mean(axis=0), width, float(own[:, 2].max())))
    return sorted(found, key=lambda hole: -hole.width_m)


def _is_wide(hole: Hole, mesh: Any) -> bool:
    """Return whether a hole is too wide to guess what was there."""
    low, high = np.asarray(mesh.bounds, float)
    at_base = hole.high_m < low[2] + BASE_SHARE * (high[2] - low[2])
    return hole.width_m > LARGEST_HOLE * float((high - low).max()) and not at_base


def _check_enclosed(hole: Hole, mesh: Any, field: Field, result: Mesh, file: str) -> None:
    """Refuse when the inside of the wall was reached through a hole; cracks and the edges of a sheet on the wall are none."""
    points, _ = sampling.uniform_points(*arrays(mesh), SAMPLES, np.random.default_rng(0))
    index = np.rint((points - field.low_m) / field.cell_m).astype(int)
    at_solid = ndimage.binary_dilation(field.value_m > 0, iterations=2)[tuple(index.T)]
    if at_solid.mean() < ENCLOSED or not holds(result):
        raise PipelineError(_wide_hole(hole, mesh, file))


def _wide_hole(hole: Hole, mesh: Any, file: str) -> str:
    x, y, z = (f"{v:.0f}" for v in 1000 * (hole.centre_m - [0, 0, mesh.bounds[0, 2]]))
    return (
        f"{file}: expected a closed surface, found a hole {1000 * hole.width_m:.0f} mm wide at ({x}, {y}, {z}) mm "
        "of the upright object; close it where you made the mesh"
    )


def _filled(mesh: Any, found: list[Hole]) -> Any:
    """Return the mesh with each hole filled by triangles about its middle."""
    import trimesh

    n = len(mesh.vertices)
    fans = [np.column_stack([hole.edges, np.full(len(hole.edges), n + k)]) for k, hole in enumerate(found)]
    middles = np.array([hole.centre_m for hole in found])
    filled = trimesh.Trimesh(
        np.concatenate([mesh.vertices, middles]), np.concatenate([mesh.faces, *fans]), process=False
    )
    filled.merge_vertices()
    filled.update_faces(_with_three_corners(filled))
    return filled


def seen_from_both_sides(mesh: Any, rng: np.random.Generator) -> float:
    """Return the share of the area of which both sides can be seen from outside: a surface without thickness.

    The table hides what could be seen from below.
    """
    vertices, triangles = np.asarray(mesh.vertices, float), np.asarray(mesh.faces)
    points, triangle = sampling.uniform_points(vertices, triangles, SAMPLES, rng)
    normals = sampling.triangle_areas_and_normals(vertices, triangles)[1][triangle]
    size = float(np.ptp(vertices, axis=0).max())
    surface = _on_table(vertices, triangles, size)
    directions = rng.normal(size=(DIRECTIONS, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    seen = []
    for side in (1.0, -1.0):
        origins = np.broadcast_to(
            points[:, None] + side * 1e-4 * size * normals[:, None], (SAMPLES, DIRECTIONS, 3)
        )
        ahead = side * np.einsum("nc,dc->nd", normals, directions) > 0
        free = np.isinf(surface.hit(origins, np.broadcast_to(directions, origins.shape))) & ahead
        seen.append(free.sum(axis=1) > SEEN * DIRECTIONS / 2)
    return float((seen[0] & seen[1]).mean())


def _on_table(vertices: np.ndarray, triangles: np.ndarray, size: float) -> Surface:
    """Return the surface with a table under it."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    corners = [[x, y] for x in (low[0] - size, high[0] + size) for y in (low[1] - size, high[1] + size)]
    table = np.column_stack([corners, np.full(4, low[2] - 1e-3 * size)])
    n = len(vertices)
    return Surface(
        np.concatenate([vertices, table]), np.concatenate([triangles, [[n, n + 1, n + 3], [n, n + 3, n + 2]]])
    )


def _check_kept(mesh: Any, result: Mesh, file: str) -> None:
    """Refuse when what was reached from outside includes the inside of the wall."""
    kept = np.ptp(result[0], axis=0) if len(result[0]) else np.zeros(3)
    if np.any(kept < 0.9 * np.ptp(np.asarray(mesh.vertices, float), axis=0)):
        raise PipelineError(
            f"{file}: expected a surface that encloses a solid, found {mesh.body_count} parts that do not; "
            "make it one closed mesh where you made it"
        )


def holds(mesh: Mesh) -> bool:
    """Return whether an upright mesh (vertices (V, 3), triangles (F, 3)) holds liquid."""
    try:
        cavity(*mesh, name="")
    except PipelineError:
        return False
    return True


def _check_thick(mesh: Any, result: Mesh, cell_m: float, file: str) -> None:
    """Refuse when the wall was lost between cells, so that nothing goes in."""
    wall_m = thickness_m(*arrays(mesh))
    if wall_m < cell_m and not holds(result):
        raise Certain(
            f"{file}: expected a closed mesh, or a wall of at least {1000 * cell_m:.1f} mm, found open parts with a wall of "
            f"{1000 * wall_m:.1f} mm, too thin to be closed here; join the parts to one closed mesh where you made the file"
        )


def _check_alone(result: Mesh, file: str) -> None:
    import trimesh

    other = crumbs.beside(trimesh.Trimesh(*result, process=False))
    if other is not None:
        raise Certain(crumbs.alone(file, other, "apart from it", "remove it, or join them,"))
