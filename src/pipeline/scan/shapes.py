"""The ten demonstration objects: closed bodies whose geometry is known exactly. Object frame, upright, z up, underside on z = 0."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, cKDTree

from pipeline.errors import PipelineError
from pipeline.scan import lofts

RIM_M = 0.004  # the rim is the surface within this distance of the lip's edge, on both sides


@dataclass(frozen=True)
class Shape:
    """A container with known parts. Lengths in metres, object frame.

    vertices_m (V, 3) and triangles (F, 3): a watertight mesh oriented outwards. handle, inner (F,) bool: triangles of the
    handle, and of the container's side that faces the cavity (from the crest of the lip inwards). lip_edge_m (M, 3): the
    crest of the rounded lip, that is its highest line, midway between the wall's two sides, ordered by azimuth.
    """

    name: str
    vertices_m: np.ndarray
    triangles: np.ndarray
    handle: np.ndarray
    inner: np.ndarray
    lip_edge_m: np.ndarray
    wall_m: float
    capacity_m3: float
    roll_symmetric: bool

    @property
    def has_handle(self) -> bool:
        """Whether any triangle belongs to a handle."""
        return bool(self.handle.any())

    @property
    def height_m(self) -> float:
        """The extent above z = 0."""
        return float(self.vertices_m[:, 2].max())

    @property
    def hull_volume_m3(self) -> float:
        """The volume of the container's convex hull, its handle left out."""
        return float(ConvexHull(self.vertices_m[np.unique(self.triangles[~self.handle])]).volume)

    def parts(self, points_m: np.ndarray, triangle: np.ndarray) -> dict[str, np.ndarray]:
        """Return the masks (N,) `container rim handle inner` of points (N, 3) that lie on the triangles (N,)."""
        container = ~self.handle[triangle]
        rim = container & (lip_distance(self.lip_edge_m, points_m) <= RIM_M)
        return {
            "container": container,
            "rim": rim,
            "handle": self.handle[triangle],
            "inner": self.inner[triangle],
        }


def lip_distance(lip_edge_m: np.ndarray, points_m: np.ndarray) -> np.ndarray:
    """Return the distance (N,) of points (N, 3) to the closed curve through `lip_edge_m` (M, 3), to about 0.01 mm."""
    following = np.roll(lip_edge_m, -1, axis=0)
    share = np.linspace(0, 1, 16, endpoint=False)[:, None, None]
    return cKDTree(((1 - share) * lip_edge_m + share * following).reshape(-1, 3)).query(points_m)[0]


@dataclass(frozen=True)
class _Handle:
    low_m: float
    high_m: float
    reach_m: float
    radius_m: float


@dataclass(frozen=True)
class _Design:
    controls_mm: tuple[tuple[float, float], ...]
    wall_mm: float
    section: Callable = lofts.round_section
    handle: _Handle | None = None


def _cup(foot: float, lip: float, height: float, wall: float, **more) -> _Design:
    """A cup with straight sides: outer radii at foot and lip, height and wall in mm."""
    low, top, foot, lip = wall / 2, height - wall / 2, foot - wall / 2, lip - wall / 2
    rows = [(0.45, low), (0.8, low)]
    side = [0.0, 0.1, 0.25, 0.5, 0.75, 1.0]
    controls = [(0.0, low), *((foot * s, z) for s, z in rows)]
    controls += [(foot + (lip - foot) * s, low + (top - low) * s) for s in side]
    return _Design(tuple(controls), wall, **more)


# Middle of the wall, (r, z) in mm, from the axis to the lip.
_JUG = (
    *((0.0, 2.0), (16.0, 2.0), (30.0, 2.0), (38.0, 2.0), (40.5, 20.0), (41.0, 50.0)),
    *((36.0, 76.0), (32.5, 92.0), (33.5, 106.0), (35.5, 118.0)),
)
_WIDE_BOWL = ((0.0, 1.75), (15.0, 1.75), (28.0, 1.75), (45.0, 6.0), (62.0, 18.0), (71.0, 35.0), (73.0, 53.25))
_BIG_BOWL = ((0.0, 2.0), (18.0, 2.0), (32.0, 2.0), (56.0, 9.0), (72.0, 28.0), (79.0, 52.0), (80.5, 73.0))
_SQUARE_BOWL = (
    (0.0, 2.25),
    (20.0, 2.25),
    (36.0, 2.25),
    (46.0, 2.25),
    (50.0, 10.0),
    (54.0, 28.0),
    (57.75, 52.75),
)

_DESIGNS = {
    "mug": _cup(40.0, 40.0, 95.0, 3.5, handle=_Handle(0.024, 0.072, 0.036, 0.0050)),
    "tall_cup": _cup(36.0, 37.5, 130.0, 3.0),
    "short_cup": _cup(38.0, 40.0, 70.0, 3.0),
    "small_cup": _cup(25.0, 27.5, 60.0, 2.5),
    "tumbler": _cup(30.0, 40.0, 110.0, 2.5),
    "espresso_cup": _cup(25.0, 27.5, 55.0, 4.0, handle=_Handle(0.016, 0.040, 0.024, 0.0040)),
    "jug": _Design(
        _JUG, 4.0, lofts.spouted(0.118, 0.080, 0.011, 0.003), _Handle(0.035, 0.092, 0.042, 0.0055)
    ),
    "wide_bowl": _Design(_WIDE_BOWL, 3.5),
    "big_bowl": _Design(_BIG_BOWL, 4.0),
    "square_bowl": _Design(_SQUARE_BOWL, 4.5, lofts.square_section),
}
NAMES = tuple(_DESIGNS)


def shape(name: str) -> Shape:
    """Build the demonstration object `name` (one of `NAMES`)."""
    if name not in _DESIGNS:
        raise PipelineError(
            f"{name}: expected a demonstration object, one of {' '.join(NAMES)}; correct scan.objects"
        )
    design = _DESIGNS[name]
    body = lofts.wall(
        [(r * 1e-3, z * 1e-3) for r, z in design.controls_mm], design.wall_mm * 1e-3, design.section
    )
    capacity = volume_below(body.vertices_m, body.triangles[body.inner], body.lip_edge_m[:, 2].min())
    vertices, triangles, handle, inner = _with_handle(body, design.handle)
    round_about_z = design.section is lofts.round_section and design.handle is None
    lip, wall_m = body.lip_edge_m, design.wall_mm * 1e-3
    return Shape(name, vertices, triangles, handle, inner, lip, wall_m, capacity, round_about_z)


def _with_handle(body: lofts.Wall, handle: _Handle | None) -> tuple[np.ndarray, ...]:
    """Return vertices, triangles and the masks (F,) of handle and inner side of the body united with its handle."""
    if handle is None:
        return body.vertices_m, body.triangles, np.zeros(len(body.triangles), bool), body.inner
    vertices, triangles, origin, source = _union(
        (body.vertices_m, body.triangles), _handle_tube(body, handle)
    )
    is_handle = origin == 1
    inner = np.zeros(len(triangles), bool)
    inner[~is_handle] = body.inner[source[~is_handle]]
    return vertices, triangles, is_handle, inner


def _handle_tube(body: lofts.Wall, handle: _Handle) -> lofts.Mesh:
    """A tube on the -x side from the middle of the wall to the middle of the wall: its ends stay inside the wall."""
    ends = [_wall_at(body, z) for z in (handle.low_m, handle.high_m)]
    (low, low_out), (high, high_out) = ends
    reach = (
        handle.reach_m * 4 / 3
    )  # a cubic Bézier curve with level ends reaches 3/4 of its inner control points
    controls = np.stack([low, low + reach * low_out, high + reach * high_out, high])
    t = np.linspace(0, 1, 64)[:, None]
    weights = np.hstack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3])
    return lofts.tube(weights @ controls, handle.radius_m)


def _wall_at(body: lofts.Wall, z_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the middle of the wall at azimuth 180° and height z, and the outward direction there, both in y = 0."""
    on_side = (np.abs(body.vertices_m[:, 1]) < 1e-9) & (body.vertices_m[:, 0] < -0.005)
    inner_rows = np.zeros(len(body.vertices_m), bool)
    inner_rows[np.unique(body.triangles[body.inner])] = True
    sides = [body.vertices_m[on_side & mask] for mask in (~inner_rows, inner_rows)]
    found = []
    for side in sides:
        side = side[np.argsort(side[:, 2], kind="stable")]
        found.append(np.array([np.interp(z_m, side[:, 2], side[:, 0]), 0.0, z_m]))
    outer, inner = found
    return (outer + inner) / 2, (outer - inner) / np.linalg.norm(outer - inner)


def _union(first: lofts.Mesh, second: lofts.Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices and triangles of the union, and for each triangle which mesh (0, 1) and triangle it comes from."""
    import manifold3d

    first_id = manifold3d.Manifold.reserve_ids(2)
    parts = []
    for number, (vertices, triangles) in enumerate((first, second)):
        ids = np.arange(len(triangles), dtype=np.uint64)
        mesh = manifold3d.Mesh64(
            vertices,
            triangles.astype(np.uint64),
            run_index=np.array([0, triangles.size], np.uint64),
            run_original_id=np.array([first_id + number], np.uint32),
            face_id=ids,
        )
        parts.append(manifold3d.Manifold(mesh))
    result = (parts[0] + parts[1]).to_mesh64()
    runs = np.asarray(result.run_index, int) // 3
    origin = np.zeros(len(result.tri_verts), int)
    for start, end, original in zip(runs[:-1], runs[1:], result.run_original_id, strict=True):
        origin[start:end] = original - first_id
    vertices, triangles = (
        np.asarray(result.vert_properties, float)[:, :3],
        np.asarray(result.tri_verts, np.int64),
    )
    return vertices, triangles, origin, np.asarray(result.face_id, np.int64)


def volume_below(vertices_m: np.ndarray, inner_triangles: np.ndarray, level_m: float) -> float:
    """Return the volume between the level z and the inner triangles (F, 3) below it, by the divergence theorem.

    The triangles' normals point into the cavity; those across the level are cut exactly, overhangs count negative.
    """
    corners = vertices_m[inner_triangles]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    plan_area = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2
    depth = np.sort(level_m - corners[:, :, 2], axis=1)
    return float(np.sum(plan_area * _mean_positive_part(depth)))


def _mean_positive_part(depth: np.ndarray) -> np.ndarray:
    """Return the mean over a triangle of max(d, 0) for d linear with the sorted corner values (F, 3)."""
    low, middle, high = depth.T
    mean = depth.mean(axis=1)
    top = np.zeros_like(mean)
    one = (middle <= 0) & (high > 0)
    top[one] = high[one] ** 3 / ((high[one] - low[one]) * (high[one] - middle[one])) / 3
    two = (low < 0) & (middle > 0)
    below = low[two] ** 3 / ((low[two] - middle[two]) * (low[two] - high[two])) / 3
    top[two] = mean[two] - below
    top[low >= 0] = mean[low >= 0]
    return top
