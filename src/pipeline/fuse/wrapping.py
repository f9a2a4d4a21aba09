"""A closed surface around any triangles: what cannot be reached from outside is solid. Windings do not matter."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from pipeline.geometry.sampling import triangle_areas_and_normals, uniform_points
from pipeline.geometry.surface import Surface, subdivided

LEAST_CELL_M, CELLS = 0.0006, 160  # along the longest side
MOST_CELLS = 16e6  # where the wall is thin
OF_WALL, SAMPLES = 0.6, 2000  # a wall that is thinner than a cell is lost; points tell how thick it is
_NEIGHBOURS = sorted(
    (offset for offset in np.ndindex(3, 3, 3) if offset != (1, 1, 1)),
    key=lambda o: (np.abs(np.array(o) - 1).sum(), o),
)

Mesh = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Field:
    """Signed distances (nx, ny, nz) to a surface in metres, positive inside the solid; low_m (3,): the first cell's centre."""

    value_m: np.ndarray
    low_m: np.ndarray
    cell_m: float

    def surface(self) -> Mesh:
        """Return the closed mesh where the values change their sign, oriented outwards."""
        from pipeline.geometry.open3d_core import open3d as o3d

        least = 0.02 * self.cell_m  # keeps vertices apart from cells' centres, so that no triangle is empty
        value = np.where(np.abs(self.value_m) < least, np.copysign(least, self.value_m), self.value_m)
        # VTK's order: x runs fastest. It joins what is negative at cells that touch in an edge: the solid, so that no wall leaks.
        volume = o3d.core.Tensor.from_numpy(np.ascontiguousarray(-value.transpose(2, 1, 0), np.float32))
        mesh = o3d.t.geometry.TriangleMesh.create_isosurfaces(volume, [0.0])
        vertices = mesh.vertex.positions.numpy().astype(float) * self.cell_m + self.low_m
        return vertices, mesh.triangle.indices.numpy()[:, ::-1].astype(np.int64, order="C")


def wrapped(vertices_m: np.ndarray, triangles: np.ndarray, wall_m: float | None = None) -> Field:
    """Return the distances to the outer triangles (F, 3) of vertices (V, 3): what cannot be reached from outside is solid.

    Parts that overlap become one, what is hidden goes, holes narrower than a cell close. With `wall_m`, the triangles are
    the middle of a wall of this thickness.
    """
    size_m = np.ptp(vertices_m, axis=0)
    cell = max(LEAST_CELL_M, float(size_m.max()) / CELLS)
    if wall_m is not None:
        cell = min(cell, wall_m / 2.5)
    else:
        thick = thickness_m(vertices_m, triangles)
        fine = max(OF_WALL * thick, float(np.cbrt(size_m.prod() / MOST_CELLS)))
        cell = min(cell, fine) if fine < thick else cell
    vertices_m, triangles = subdivided(vertices_m, triangles, 3 * cell)
    margin = (wall_m or 0.0) / 2 + 3 * cell
    low, high = vertices_m.min(axis=0) - margin, vertices_m.max(axis=0) + margin
    axes = [a + cell * np.arange(int(np.ceil((b - a) / cell)) + 1) for a, b in zip(low, high, strict=True)]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    surface = Surface(vertices_m, triangles)
    distance = surface.distance_on_grid(centres, cell)
    if wall_m is None:
        return Field(np.where(_outside(surface, centres, distance, cell), -distance, distance), low, cell)
    value = wall_m / 2 - distance
    labels, _ = ndimage.label(value < 0)
    return Field(np.where((value < 0) & (labels != labels[0, 0, 0]), cell, value), low, cell)


def thickness_m(vertices_m: np.ndarray, triangles: np.ndarray) -> float:
    """Return how thick the wall of vertices (V, 3) and triangles (F, 3) is: how near another triangle is, as a median."""
    points, triangle = uniform_points(vertices_m, triangles, SAMPLES, np.random.default_rng(0))
    normals = triangle_areas_and_normals(vertices_m, triangles)[1][triangle]
    surface, off_m = Surface(vertices_m, triangles), 1e-5
    sides = [surface.hit(points + side * off_m * normals, side * normals) for side in (1.0, -1.0)]
    return float(np.median(np.minimum(*sides))) + off_m


def _outside(surface: Surface, centres: np.ndarray, distance: np.ndarray, cell: float) -> np.ndarray:
    """Return which cells (nx, ny, nz) can be reached from the first one without passing the surface."""
    free = distance > cell / 2
    labels, _ = ndimage.label(free)
    reached = labels == labels[0, 0, 0]
    outside, asking = reached.copy(), np.argwhere(~free)
    nearest = ndimage.distance_transform_edt(~reached, return_distances=False, return_indices=True)
    for offset in (None, *_NEIGHBOURS):
        goals = nearest[:, *asking.T].T if offset is None else asking + np.array(offset) - 1
        # Cells at the surface ask none of their like: one that looks through a pinhole would let all others in.
        asked = reached[tuple(goals.T)]
        seen = np.zeros(len(asking), bool)
        seen[asked] = surface.sees(centres[tuple(asking[asked].T)], centres[tuple(goals[asked].T)])
        outside[tuple(asking[seen].T)] = True
        asking = asking[~seen]
    return outside
