import numpy as np
import pytest

from pipeline.geometry.surface import Surface, longest_edges, subdivided
from pipeline.scan.shapes import shape

CELL_M = 0.002


@pytest.mark.parametrize("edge_cells", [1.0, 3.0, 8.0])
def test_free_cells_are_those_further_than_a_cell_however_long_the_edges(edge_cells):
    mug = shape("mug")
    vertices_m, triangles = subdivided(mug.vertices_m, mug.triangles, edge_cells * CELL_M)
    assert longest_edges(vertices_m, triangles).max() <= edge_cells * CELL_M
    axes = [
        np.arange(low - 8 * CELL_M, high + 8 * CELL_M, CELL_M)
        for low, high in zip(vertices_m.min(axis=0), vertices_m.max(axis=0), strict=True)
    ]
    centres_m = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    for some in (triangles, triangles[::3]):  # vertices that no triangle has do not count
        surface = Surface(vertices_m, some)
        expected = surface.distance(centres_m) > CELL_M
        np.testing.assert_array_equal(surface.free_on_grid(centres_m, CELL_M), expected)
