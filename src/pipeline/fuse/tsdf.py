"""Depth images to one closed surface: a truncated signed distance in Open3D's VoxelBlockGrid, and marching cubes."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_dilation, gaussian_filter, minimum_filter

from pipeline.errors import PipelineError
from pipeline.fuse.layouts import Views
from pipeline.fuse.table import Placement
from pipeline.geometry import frames

BLOCK = 8
# Depth is smoothed over 5×5 pixels, within 4 mm: three times the noise of a Kinect at 0.6 m.
SMOOTH_PIXELS, SMOOTH_DEPTH_M, SMOOTH_SIGMA_PX = 5, 0.004, 1.5
# Pixels this far behind a neighbour are dropped: near an edge the sensor mixes up who is in front, and what is
# wrongly seen behind a lip would carve the lip away.
EDGE_JUMP_M = 0.010
# The table's own surface, fused, stays below this height: what is lower counts as table.
TABLE_M = 0.0006
LEAST_VOTES, PRIOR_VOTES, UNSEEN_VOTE = 0.5, 2.0, 0.5
FREE_STRIDE = 3  # of the views that measure blocks without a surface: whether they are free is soon known
SMOOTHINGS, TAUBIN = 10, (0.5, -0.53)
_LEAST_VALUE = 0.02  # of the truncation: keeps vertices apart from grid points, so that no triangle is empty


@dataclass(frozen=True)
class Surface:
    """vertices_m (V, 3), object frame; triangles (F, 3) oriented outwards; seen (V,): by a camera, not closed by us."""

    vertices_m: np.ndarray
    triangles: np.ndarray
    seen: np.ndarray


def fuse(views: Views, placement: Placement, voxel_m: float, truncation_m: float, name: str) -> Surface:
    """Fuse the views (Curless & Levoy 1996) in the object frame into a closed surface that stands on z = 0.

    Space that no camera saw free counts as solid, down to the table: this closes the underside and the inside of the
    wall. The truncation should be less than the walls' thickness, else their two sides eat each other.
    """
    if not 0 < voxel_m <= truncation_m / 2:
        raise PipelineError(
            f"--truncation-m: expected at least two voxels of {voxel_m} m, found {truncation_m}; set fuse.truncation_m"
        )
    grid, keys = _grid(placement, voxel_m)
    near = _near(keys, placement.points_m, voxel_m)
    cameras = zip(views.depths_m, views.intrinsics, views.T_world_cameras, strict=True)
    for i, (depth, K, T_world_camera) in enumerate(cameras):
        T_camera_object = frames.inverse(placement.T_object_world @ T_world_camera)
        blocks = keys if i % FREE_STRIDE == 0 else keys[near]
        _integrate(grid, blocks, depth, K, T_camera_object, truncation_m / voxel_m)
    measured, lowest = _close(grid, placement, voxel_m, truncation_m)
    mesh = grid.extract_triangle_mesh(0.5, -1)
    if mesh.is_empty() or len(mesh.triangle.indices) == 0:
        raise PipelineError(
            f"{name}: expected a surface from {len(views.depths_m)} views, found none; check poses and units"
        )
    vertices, triangles = canonical(
        mesh.vertex.positions.numpy().astype(float), mesh.triangle.indices.numpy()
    )
    vertices, triangles = largest_component(vertices, triangles)
    seen = _seen(vertices, measured, lowest, voxel_m)
    base = vertices[:, 2] < _table_layers(voxel_m) * voxel_m
    vertices[base, 2] = 0.0
    return Surface(smoothed(vertices, triangles, ~base), triangles, seen & ~base)


def _grid(placement: Placement, voxel_m: float):  # type: ignore[no-untyped-def]
    """Return a grid and the keys of all its blocks: above the footprint, and one layer below the table."""
    import open3d as o3d

    edge = voxel_m * BLOCK
    low = np.floor(placement.bounds_m[0] / edge).astype(int) - [0, 0, 1]
    high = np.floor(placement.bounds_m[1] / edge).astype(int)
    axes = [np.arange(a, b + 1) for a, b in zip(low, high, strict=True)]
    keys = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.int32)
    within = np.arange(BLOCK) * voxel_m
    x = keys[:, 0, None, None] * edge + within[:, None]
    y = keys[:, 1, None, None] * edge + within
    keys = keys[placement.covers(*np.broadcast_arrays(x, y)).any(axis=(1, 2))]
    real = o3d.core.float32
    device = o3d.core.Device("CPU:0")
    grid = o3d.t.geometry.VoxelBlockGrid(
        ("tsdf", "weight"), (real, real), [o3d.core.SizeVector([1])] * 2, voxel_m, BLOCK, len(keys), device
    )
    return grid, keys


def _near(keys: np.ndarray, points_m: np.ndarray, voxel_m: float) -> np.ndarray:
    """Return which blocks (N,) hold a measured point or touch one that does."""
    cells = np.floor(points_m / (voxel_m * BLOCK)).astype(int) - keys.min(axis=0) + 1
    held = np.zeros(np.ptp(keys, axis=0) + 3, bool)
    held[tuple(cells.T)] = True
    return binary_dilation(held, np.ones((3, 3, 3)))[tuple((keys - keys.min(axis=0) + 1).T)]


def _integrate(grid, keys, depth_m, K, T_camera_object, truncation_voxels) -> None:  # type: ignore[no-untyped-def]
    import open3d as o3d

    smooth = o3d.t.geometry.Image(o3d.core.Tensor.from_numpy(depth_m))
    smooth = smooth.filter_bilateral(SMOOTH_PIXELS, SMOOTH_DEPTH_M, SMOOTH_SIGMA_PX).as_tensor().numpy()
    usable = (depth_m > 0) & ~behind_edge(depth_m)
    depth = np.where(usable, smooth.reshape(depth_m.shape), 0).astype(np.float32)
    # Open3D truncates projected coordinates: without half a pixel everything would be seen half a pixel off.
    K = K + [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]
    image = o3d.t.geometry.Image(o3d.core.Tensor.from_numpy(depth))
    far = float(depth.max()) + 1.0
    blocks, K, T = (o3d.core.Tensor.from_numpy(array) for array in (keys, K, T_camera_object))
    grid.integrate(blocks, image, K, T, 1.0, far, truncation_voxels)


def behind_edge(depth_m: np.ndarray) -> np.ndarray:
    """Return where (H, W) a pixel lies far behind one of its eight neighbours."""
    return depth_m - minimum_filter(np.where(depth_m > 0, depth_m, np.inf), 3) > EDGE_JUMP_M


def _table_layers(voxel_m: float) -> int:
    return int(np.ceil(TABLE_M / voxel_m))


def _close(grid, placement, voxel_m, truncation_m):  # type: ignore[no-untyped-def]
    """Decide every voxel: seen ones keep their value, unseen ones are solid, beyond footprint, top and table is free.

    Return which voxels were seen as a dense array (nx, ny, nz) and the coordinates (3,) of its first voxel.
    """
    points, flat = (t.numpy() for t in grid.voxel_coordinates_and_flattened_indices())
    value, weight = (grid.attribute(name).reshape((-1,)).numpy() for name in ("tsdf", "weight"))
    coordinates = np.round(points / voxel_m).astype(np.int32)
    lowest = coordinates.min(axis=0)
    place = tuple((coordinates - lowest).T)
    dense = np.zeros((2, *(coordinates.max(axis=0) - lowest + 1)), np.float32)
    dense[0][place], dense[1][place] = value[flat], weight[flat]
    solid, seen = regularised(*dense)
    solid = solid[place]
    beyond = ~placement.covers(points[:, 0], points[:, 1]) | (points[:, 2] > placement.bounds_m[1, 2])
    table = coordinates[:, 2] < _table_layers(voxel_m)
    solid[beyond | table] = 1.0
    value[flat] = np.where(np.abs(solid) < _LEAST_VALUE, np.copysign(_LEAST_VALUE, solid), solid)
    weight[flat] = 1.0
    return seen, lowest


def regularised(value: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the values (nx, ny, nz) drawn to their neighbourhood where measured rarely, and which count as seen.

    Normalised convolution (Knutsson & Westin 1993): the mean around a voxel, in which a measured voxel counts once and an
    unseen one half as solid, counts as `PRIOR_VOTES` measurements. Without it a few wrong depths leave bubbles inside the
    walls. Unseen voxels are solid.
    """

    def around(field: np.ndarray) -> np.ndarray:
        return gaussian_filter(field.astype(np.float32), 1.0, truncate=2.0, mode="constant")

    measured = weight > 0
    share = around(np.where(measured, 1.0, UNSEEN_VOTE))
    mean = around(np.where(measured, value, -UNSEEN_VOTE)) / share
    drawn = (weight * value + PRIOR_VOTES * mean) / (weight + PRIOR_VOTES)
    seen = around(weight) >= LEAST_VOTES
    return np.where(seen, drawn, -1.0), seen


def _seen(vertices: np.ndarray, seen: np.ndarray, lowest: np.ndarray, voxel_m: float) -> np.ndarray:
    """Return which vertices (V, 3) lie between two voxels that both count as seen."""
    place = vertices / voxel_m - lowest
    ends = np.floor(place + 1e-3).astype(int), np.ceil(place - 1e-3).astype(int)
    return seen[tuple(ends[0].T)] & seen[tuple(ends[1].T)]


def canonical(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the same mesh in one order: Open3D's depends on its hash map and its threads."""
    order = np.lexsort(vertices.T)
    rank = np.zeros(len(order), np.int64)
    rank[order] = np.arange(len(order))
    triangles = rank[triangles]
    first = triangles.argmin(axis=1)[:, None]
    triangles = np.take_along_axis(triangles, (first + np.arange(3)) % 3, axis=1)
    return vertices[order], triangles[np.lexsort(triangles.T[::-1])]


def largest_component(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the connected part with the most triangles, unused vertices removed."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    edges = np.concatenate([triangles[:, :2], triangles[:, 1:]])
    shape = (len(vertices), len(vertices))
    part = connected_components(coo_matrix((np.ones(len(edges)), edges.T), shape=shape), directed=False)[1]
    triangles = triangles[part[triangles[:, 0]] == np.bincount(part[triangles[:, 0]]).argmax()]
    used, triangles = np.unique(triangles, return_inverse=True)
    return vertices[used], triangles.reshape(-1, 3)


def smoothed(vertices: np.ndarray, triangles: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return vertices (V, 3) with the voxels' jitter smoothed away and volumes kept (Taubin 1995); `free` (V,) may move."""
    from scipy.sparse import coo_matrix, diags

    n, rows, columns = len(vertices), triangles.ravel(), np.roll(triangles, 1, axis=1).ravel()
    # Every edge of a closed surface belongs to two triangles, which run it in opposite directions.
    neighbours = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(n, n)).tocsr()
    mean = diags(1 / np.asarray(neighbours.sum(axis=1)).ravel()) @ neighbours
    for _ in range(SMOOTHINGS):
        for factor in TAUBIN:
            vertices = vertices + factor * (mean @ vertices - vertices) * free[:, None]
    return vertices
