"""Point clouds: read, normals oriented by what can be reached from outside, meshed by Poisson reconstruction (Open3D)."""

from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage
from scipy.spatial import ConvexHull, Delaunay, cKDTree

from pipeline.errors import PipelineError
from pipeline.fuse.wrapping import Mesh

LEAST_POINTS, MOST_POINTS = 2000, 20_000_000
LEAST_TOLD = 0.5  # of the points have a normal, or else all are taken without
MARK = 100  # times as often as others: these points mark pixels without depth, by zeros mostly
FINEST = 110  # points along the longest side: more are averaged
NEIGHBOURS = 16
REACHES = (1.5, 2.0, 2.5, 3.0)  # spacings: what is further from every point can be passed
MOST_OPEN = 0.02  # of the points may be reached from both sides
BASE_M = 0.0015  # points lower than this above the lowest are the underside
BASE_SHARE = 0.5  # of the footprint must be covered by points of the underside, else it was not seen
DEPTH = 8  # of Poisson's octree
# A sound surface passes by the points within this many spacings, and has points everywhere within so many.
MOST_OFF, MOST_BARE, BARE = 1.0, 0.05, 4.0
# From the rest, and of the points: another thing, which the surface would be joined to.
APART_M, OTHER = 0.01, 0.05
WIDE_GAP_M = 0.015  # is said, if wide for the spacing, too: the surface bulges by a quarter; clouds without gaps have up to 0.012
# Beyond the box of the points, in spacings, and at least so much: sparse points of a lip let the surface balloon.
MOST_BULGE, SLIGHT_BULGE_M = 2.5, 0.004


def read(path: Path) -> tuple[np.ndarray, np.ndarray | None]:
    """Return points (N, 3) in the file's units and, where it has them, their normals (N, 3)."""
    points, normals = _arrays(path) if path.suffix.lower() == ".npz" else _open3d(path)
    finite = np.isfinite(points).all(axis=1)
    if normals is not None:
        told = finite & np.isfinite(normals).all(axis=1) & (np.abs(normals) > 1e-9).any(axis=1)
        if np.count_nonzero(told) < LEAST_TOLD * np.count_nonzero(finite):
            normals = None  # room for them was left
        else:
            finite = told
            normals = normals[finite] / np.linalg.norm(normals[finite], axis=1, keepdims=True)
    points, index, times = np.unique(points[finite], axis=0, return_index=True, return_counts=True)
    own = times < MARK * np.median(times) if len(times) else times > 0
    points, index = points[own], index[own]
    if not LEAST_POINTS <= len(points) <= MOST_POINTS:
        raise PipelineError(
            f"{path}: expected {LEAST_POINTS} to {MOST_POINTS} different points, found {len(points)}; export the cloud again"
        )
    return points, None if normals is None else normals[index]


def _arrays(path: Path) -> tuple[np.ndarray, np.ndarray | None]:
    import zipfile

    try:
        with np.load(path, allow_pickle=False) as archive:
            held = {
                name: np.asarray(archive[name]) for name in archive.files if name in ("points", "normals")
            }
            names = " ".join(archive.files)
    except (
        OSError,
        ValueError,
        EOFError,
        KeyError,
        MemoryError,
        NotImplementedError,
        zipfile.BadZipFile,
    ) as error:
        raise PipelineError(
            f"{path}: expected arrays `points` and perhaps `normals`, but it cannot be read: {error}; save it again"
        ) from error
    for name in ("points", *(["normals"] if "normals" in held else [])):
        array = held.get(name)
        if array is None or array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "fiu":
            found = (
                f"shape {array.shape} of {array.dtype}" if array is not None else f"the arrays {names:.60}"
            )
            raise PipelineError(
                f"{path}: expected an array `{name}` of N×3 numbers, found {found}; save it again"
            )
    normals = held.get("normals")
    if normals is not None and normals.shape != held["points"].shape:
        raise PipelineError(
            f"{path}: expected as many normals as points, found {len(normals)} and {len(held['points'])}; save it again"
        )
    return held["points"].astype(float), None if normals is None else normals.astype(float)


def _open3d(path: Path) -> tuple[np.ndarray, np.ndarray | None]:
    from pipeline.geometry.open3d_core import open3d as o3d

    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        try:
            cloud = o3d.io.read_point_cloud(path)
        except (RuntimeError, ValueError, MemoryError) as error:
            raise PipelineError(
                f"{path}: expected a point cloud, but it cannot be read: {error}; export it again"
            ) from error
    points = np.asarray(cloud.points).reshape(-1, 3)
    return points, np.asarray(cloud.normals) if cloud.has_normals() else None


def meshed(points: np.ndarray, normals: np.ndarray | None, file: str) -> tuple[Mesh, dict[str, Any]]:
    """Return a closed mesh through the points (N, 3) of an upright object, in metres, and what was found of them.

    The underside is closed where the table closes it. A `PipelineError` names the file when the surface is not sound:
    when it passes the points by, or has to bridge gaps between them.
    """
    points, normals = _thinned(points, normals)
    spacing = float(np.median(cKDTree(points).query(points, k=7)[0][:, 6])) / 1.5
    _check_alone(points, spacing, file)
    base = _base(points, spacing)
    given = normals is not None
    normals = normals if given else _axes(points)
    down = np.tile([0.0, 0.0, -1.0], (len(base), 1))
    whole, axes = np.concatenate([points, base]), np.concatenate([normals, down])
    facing = _outwards(whole, axes, spacing)
    if given:  # all of them the same way round, or else as they are found to be
        agree = np.einsum("nc,nc->n", facing, axes)[: len(points)]
        facing = axes if (agree > 0).mean() > 0.95 else -axes if (agree < 0).mean() > 0.95 else facing
    facing[len(points) :] = down
    mesh = _poisson(whole, facing)
    facts = {
        "points": len(points),
        "spacing_m": spacing,
        "normals_given": given,
        "underside_closed": len(base) > 0,
    }
    return mesh, facts | _checked(mesh, whole, spacing, file)


def _thinned(points: np.ndarray, normals: np.ndarray | None) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the points without stray ones (Open3D's statistical filter), and not more of them than needed."""
    from pipeline.geometry.open3d_core import open3d as o3d

    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    if normals is not None:
        cloud.normals = o3d.utility.Vector3dVector(normals)
    cloud = cloud.voxel_down_sample(float(np.ptp(points, axis=0).max()) / FINEST)
    cloud, _ = cloud.remove_statistical_outlier(20, 3.0)
    return np.asarray(cloud.points), np.asarray(cloud.normals) if normals is not None else None


def _base(points: np.ndarray, spacing: float) -> np.ndarray:
    """Return points (M, 3) of the underside on z = 0 when it was not seen: none if it was."""
    low = points[points[:, 2] < points[:, 2].min() + BASE_M][:, :2]
    if len(low) < 10 or np.any(np.ptp(low, axis=0) < 3 * spacing):
        return np.zeros((0, 3))
    hull = ConvexHull(low)
    axes = [np.arange(a, b, spacing) for a, b in zip(hull.min_bound, hull.max_bound, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    grid = grid[Delaunay(low[hull.vertices]).find_simplex(grid) >= 0]
    covered = cKDTree(low).query(grid)[0] < 2 * spacing
    if covered.mean() > BASE_SHARE:
        return np.zeros((0, 3))
    return np.column_stack([grid, np.zeros(len(grid))])


def _axes(points: np.ndarray) -> np.ndarray:
    """Return unit normals (N, 3) of planes through each point's neighbours, either way round."""
    from pipeline.geometry.open3d_core import open3d as o3d

    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(NEIGHBOURS))
    return np.asarray(cloud.normals).copy()


def _outwards(points: np.ndarray, axes: np.ndarray, spacing: float) -> np.ndarray:
    """Return the normals (N, 3) turned to the side from which one gets outside without passing between the points."""
    for reach in REACHES:
        ahead, behind = _far_m(points, axes, reach * spacing)
        if np.mean(np.maximum(ahead, behind) <= 0) < MOST_OPEN:
            break
    return np.where((ahead > behind)[:, None], -axes, axes)


def _far_m(points: np.ndarray, axes: np.ndarray, reach: float) -> list[np.ndarray]:
    """Return how far (N,) the outside is from a place ahead of each point along its axis, and from one behind it.

    Outside is what can be reached while staying further than `reach` from every point.
    """
    cell = max(reach / 2, float(np.ptp(points, axis=0).max()) / 250)
    low = points.min(axis=0) - 4 * reach - 2 * cell
    shape = np.ceil((points.max(axis=0) + 4 * reach + 2 * cell - low) / cell).astype(int) + 1
    held = np.zeros(shape, bool)
    held[tuple(np.rint((points - low) / cell).astype(int).T)] = True
    labels, _ = ndimage.label(ndimage.distance_transform_edt(~held) * cell > reach)
    far = ndimage.distance_transform_edt(labels != labels[0, 0, 0]) * cell
    places = [(points + side * 1.5 * reach * axes - low) / cell for side in (1, -1)]
    return [ndimage.map_coordinates(far, place.T, order=1) for place in places]


def _poisson(points: np.ndarray, normals: np.ndarray) -> Mesh:
    from pipeline.geometry.open3d_core import open3d as o3d

    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.normals = o3d.utility.Vector3dVector(normals)
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        # One thread: with more, the mesh differs from call to call.
        mesh, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=DEPTH, n_threads=1)
    return np.asarray(mesh.vertices), np.asarray(mesh.triangles).astype(np.int64)


def _checked(mesh: Mesh, points: np.ndarray, spacing: float, file: str) -> dict[str, Any]:
    """Refuse a surface that passes the points by or has to bridge gaps; else return how near it is."""
    from pipeline.geometry.surface import Surface

    if len(mesh[1]) == 0:
        raise PipelineError(f"{file}: expected points of a surface, found none through them; scan it again")
    off = float(np.quantile(Surface(*mesh).distance(points), 0.95))
    nearest = cKDTree(points).query(mesh[0])[0]
    bare = float((nearest > BARE * spacing).mean())
    if off > MOST_OFF * spacing:
        raise PipelineError(
            f"{file}: expected points whose surface is clear, found a surface that passes 5% of them by at {off * 1e3:.1f} mm; "
            f"their spacing of {spacing * 1e3:.1f} mm is too wide for the walls, or they are too noisy; scan it more closely"
        )
    gap_m = 2 * float(nearest.max())
    if bare > MOST_BARE:
        raise PipelineError(
            f"{file}: expected points all over the object, found gaps of up to {gap_m * 1e3:.0f} mm over {bare:.0%} of its "
            "surface; scan what is missing, the inside as well"
        )
    return {"point_distance_m": off, "share_without_points": bare, "widest_gap_m": gap_m}


def _check_alone(points: np.ndarray, spacing: float, file: str) -> None:
    cells = np.floor((points - points.min(axis=0)) / max(APART_M, BARE * spacing)).astype(int)
    held = np.zeros(cells.max(axis=0) + 1, bool)
    held[tuple(cells.T)] = True
    label = ndimage.label(held, np.ones((3, 3, 3)))[0][tuple(cells.T)]
    count = np.bincount(label)
    other = points[label == np.argsort(count)[-2]]
    if len(other) > OTHER * len(points):
        x, y, z = (f"{v:.0f}" for v in 1e3 * (other.min(axis=0) + other.max(axis=0)) / 2)
        width_mm = 1e3 * np.ptp(other, axis=0).max()
        raise PipelineError(
            f"{file}: expected points of one container, found something {width_mm:.0f} mm wide apart from it at ({x}, {y}, {z}) mm "
            "of the upright object; remove its points"
        )


def check_bulge(vertices: np.ndarray, points: np.ndarray, spacing: float, file: str) -> None:
    """Refuse a surface with vertices (V, 3) that balloons beyond the box of the points (N, 3)."""
    bulge = float(np.abs(vertices - np.clip(vertices, points.min(axis=0), points.max(axis=0))).max())
    if bulge > max(MOST_BULGE * spacing, SLIGHT_BULGE_M):
        raise PipelineError(
            f"{file}: expected points whose surface is clear, found a surface that reaches {bulge * 1e3:.0f} mm beyond them; one "
            f"every {spacing * 1e3:.1f} mm is too few for the walls, or a side is missing; scan it more closely, the inside as well"
        )


def complaints(found: dict[str, Any]) -> list[str]:
    """Return a sentence when the surface bridges gaps between the points, by what `meshed` found."""
    bare, gap_mm = found["share_without_points"], 1e3 * found["widest_gap_m"]
    if gap_mm < 1e3 * max(WIDE_GAP_M, 2 * BARE * found["spacing_m"]):
        return []
    return [
        f"the points have gaps of up to {gap_mm:.0f} mm, over {bare:.1%} of the surface, which bulges there: where they are in the "
        "floor or the inner wall, the capacity is a guess; scan what is missing"
    ]
