"""A mesh or a point cloud that a user dropped: read, repaired, put upright on z = 0."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import PipelineError
from pipeline.fuse import clouds, crumbs, drains, mending, parts, raw, standing
from pipeline.fuse.layouts import CLOUDS
from pipeline.fuse.raw import UPS, DroppedMesh
from pipeline.fuse.table import Placement
from pipeline.fuse.wrapping import Mesh, wrapped
from pipeline.geometry import frames
from pipeline.geometry.cavity import cavity
from pipeline.geometry.sampling import uniform_points
from pipeline.geometry.surface import Surface

LARGEST_M, SMALLEST_M = 2.0, 0.005
LARGEST_UNTOLD_M = 0.6  # without `units`: a mesh of unit size is as likely one that was normalised
LEAST_IN_MM, MOST_IN_CM = 30.0, 60.0  # between them both may be meant
MORE_WITHOUT = 1.1  # times as much goes in without a part that may be liquid
TABLE_SAMPLES = 100_000
_OF_IMAGES = {"depth_scale": "it has no depth images", "turntable_deg": "it has no views"}


def read(
    dropped: DroppedMesh, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
    """Return vertices (V, 3) in metres, object frame, triangles (F, 3) oriented outwards, T_object_world and what was done.

    The world is the file's own frame in metres. The mesh stands with its lowest point on z = 0, over the origin.
    """
    raw.refuse(dropped.options, dropped.path.parent / "scan.yaml", "a mesh or a point cloud", **_OF_IMAGES)
    mesh = None if dropped.path.suffix.lower() in CLOUDS else _load(dropped.path)
    if mesh is None:
        (vertices, triangles), T_object_world, facts = _from_points(dropped, rng)
    else:
        (vertices, triangles), T_object_world, facts = _from_mesh(mesh, dropped, rng)
    T_stood = upright(vertices, "z")
    return frames.apply(T_stood, vertices), triangles, T_stood @ T_object_world, facts


def _from_mesh(
    mesh: Any, dropped: DroppedMesh, rng: np.random.Generator
) -> tuple[Mesh, np.ndarray, dict[str, Any]]:
    file, options = str(dropped.path), dropped.options
    mesh.vertices = np.asarray(mesh.vertices, float) * (options.unit_m or 1.0)
    mesh = mending.cleaned(mesh, file)
    _check_size(mesh.vertices, dropped, LARGEST_M)
    up = options.up or "z"
    T_object_world = upright(mesh.vertices, up)
    place = _on_table(mesh, dropped, rng)
    if place is not None:
        _refuse_up(dropped)
        mesh, T_object_world, up = standing.cut(mesh, place), place.T_object_world, "z"
    mesh.vertices = frames.apply(T_object_world, mesh.vertices)
    mesh = mending.cleaned(mesh, file)
    _check_size(mesh.vertices, dropped, LARGEST_UNTOLD_M)
    emptied = _without_filling(mesh, options.wall_m, file)
    try:
        whole, facts = mending.mended(mesh, options.wall_m, file, rng, emptied is not None)
    except PipelineError as error:
        if emptied is None:
            raise
        raise PipelineError(
            f"{file}: expected a container alone, found a part with a level top in it, as of liquid, "
            f"{1000 * emptied.level_m:.0f} mm above its base; remove it where you made the mesh"
        ) from error
    if not mending.holds(whole):
        _check_body_alone(mesh, options.wall_m, file)
    whole, done = _holding(whole, up, file)
    facts |= done | ({} if emptied is None else emptied.facts(whole))
    return whole, T_object_world, {"layout": "mesh", "n_views": 0, "mended": facts}


@dataclass(frozen=True)
class _Emptied:
    """What a mesh holds (m³) without a part whose level top is in it, level_m above its base."""

    level_m: float
    capacity_m3: float

    def facts(self, whole: Mesh) -> dict[str, Any]:
        """Return the level, and what goes in with and without the part, where that is a difference."""
        try:
            with_m3 = cavity(*whole, name="").capacity_m3
        except PipelineError:
            with_m3 = 0.0
        if self.capacity_m3 < MORE_WITHOUT * with_m3:
            return {}
        return {"filled_to_m": self.level_m, "capacity_m3": with_m3, "capacity_without_m3": self.capacity_m3}


def _without_filling(mesh: Any, wall_m: float | None, file: str) -> _Emptied | None:
    """Return what an upright trimesh holds without what fills it, where there is such a part and the rest is a container."""
    filling = parts.filling(mesh)
    if filling is None:
        return None
    rest = mesh.submesh([~filling], append=True, repair=False)
    try:
        whole, _ = mending.mended(rest, wall_m, file, np.random.default_rng(0))
        capacity_m3 = cavity(*whole, name="").capacity_m3
    except PipelineError:
        return None
    return _Emptied(float(mesh.triangles[filling][..., 2].max()), capacity_m3)


def _check_body_alone(mesh: Any, wall_m: float | None, file: str) -> None:
    """Refuse an upright trimesh that holds nothing with its parts, as a spoon in it or a lid, and does without them."""
    found = parts.body_and_highest(crumbs.without(mesh.copy())[0])
    if found is None:
        return
    body, other = found
    try:
        whole, _ = mending.mended(body, wall_m, file, np.random.default_rng(0))
    except PipelineError:
        return
    if mending.holds(whole):
        raise mending.Certain(crumbs.alone(file, other, "in it or over its opening", "remove it"))


def complaints(facts: dict[str, Any]) -> list[str]:
    """Return what a user should know of a dropped mesh or cloud, a sentence each, from what was found."""
    told = clouds.complaints(facts["cloud"]) if "cloud" in facts else []
    mended = facts["mended"]
    if "filled_to_m" in mended:
        ml = 1e6 * np.array([mended["capacity_without_m3"], mended["capacity_m3"]])
        told.append(
            f"a part of the mesh with a level top {1000 * mended['filled_to_m']:.0f} mm above the base is taken for the floor; "
            f"without it {ml[0]:.0f} ml go in instead of {ml[1]:.0f}: if it is liquid, remove it where you made the mesh"
        )
    if n := mended.get("drains_closed"):
        told.append(
            f"{'a hole' if n == 1 else f'{n} holes'} through which liquid would leave, about {1000 * drains.WIDEST_M:.0f} mm wide "
            "at most, taken for gaps of its scan and closed; if they are its own, as a colander's or a flower pot's, exclude it"
        )
    return told


def _on_table(mesh: Any, dropped: DroppedMesh, rng: np.random.Generator) -> Placement | None:
    """Return where the object stands on a table that the mesh holds as well; refuse one that scan.yaml does not speak of."""
    on_table = dropped.options.on_table
    if on_table is False:
        return None
    aside = rng.spawn(1)[0]  # the points of a mesh without a table stay as they are
    sample, _ = uniform_points(*mending.arrays(mesh), TABLE_SAMPLES, aside)
    if on_table:
        sample = sample[standing.open_above(sample, Surface(*mending.arrays(mesh)), str(dropped.path), aside)]
    place = standing.found(sample, on_table, str(dropped.path), aside)
    if place is not None and on_table is None:
        raise PipelineError(
            f"{dropped.path}: expected a container alone, found it on a plane much larger than itself; write `on_table: true` into "
            "scan.yaml beside it to have that cut away, or `on_table: false` if it is part of the container"
        )
    return place


def _from_points(dropped: DroppedMesh, rng: np.random.Generator) -> tuple[Mesh, np.ndarray, dict[str, Any]]:
    import trimesh

    file, options = str(dropped.path), dropped.options
    reason = "its points show both sides of the wall"
    raw.refuse(options, dropped.path.parent / "scan.yaml", "a point cloud", wall_mm=reason)
    points, normals = clouds.read(dropped.path)
    points = points * (options.unit_m or 1.0)
    _check_size(points, dropped, LARGEST_M)
    up, place = options.up or "z", standing.found(points, options.on_table, file, rng)
    T_object_world = upright(points, up)
    if place is not None:
        _refuse_up(dropped)
        own = standing.belongs(points, place)
        points, normals = points[own], None if normals is None else normals[own]
        T_object_world, up = place.T_object_world, "z"
    _check_size(points, dropped, LARGEST_UNTOLD_M)
    points = frames.apply(T_object_world, points)
    normals = None if normals is None else frames.rotate(T_object_world, normals)
    surface, found = clouds.meshed(points, normals, file)
    try:
        mesh = mending.cleaned(trimesh.Trimesh(*surface, process=False), file)
        whole, facts = mending.mended(mesh, None, file, rng)
        whole, done = _holding(whole, up, file)
        sound = mending.holds(whole)
    except mending.Certain:
        raise
    except PipelineError:
        sound = False
    if not sound:
        raise PipelineError(
            f"{file}: expected points of a container, found a surface through them that is not closed or holds no liquid "
            f"(points every {found['spacing_m'] * 1e3:.1f} mm); scan it more closely, the inside as well"
        )
    clouds.check_bulge(whole[0], points, found["spacing_m"], file)
    facts = {"layout": "cloud", "n_views": 0, "cloud": found, "mended": facts | done}
    return whole, T_object_world, facts | {"table_cut_away": place is not None}


def _refuse_up(dropped: DroppedMesh) -> None:
    file = dropped.path.parent / "scan.yaml"
    raw.refuse(dropped.options, file, "a scan that holds its table", up="up comes from the table")


def _load(path: Path) -> Any:
    """Return the mesh, or None when the file holds points without faces."""
    import trimesh

    # It logs a missing texture with a traceback; none is needed.
    trimesh.util.log.setLevel("CRITICAL")
    try:
        mesh = trimesh.load(path, force="mesh" if path.suffix.lower() != ".ply" else None, process=False)
    except Exception as error:  # each reader of trimesh has errors of its own
        is_missing = isinstance(error, FileNotFoundError)
        cure = "put that file beside it" if is_missing else "export it again, with triangles alone"
        raise PipelineError(
            f"{path}: expected a mesh, but it cannot be read: {' '.join(str(error).split()):.200}; {cure}"
        ) from error
    if isinstance(mesh, trimesh.PointCloud):
        return None
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise PipelineError(
            f"{path}: expected a mesh with faces, found none; export the surface, not its points"
        )
    return mesh


def _holding(mesh: Mesh, up: str, file: str) -> tuple[Mesh, dict[str, Any]]:
    """Return the mesh with small holes closed if it leaks; refuse it when its opening points elsewhere."""
    if mending.holds(mesh):
        return mesh, {"drains_closed": 0}
    field, n = drains.plugged(wrapped(*mesh))
    if n and mending.holds(field.surface()):
        return field.surface(), {"drains_closed": n, "remeshed": True}
    turned = {other: frames.apply(upright(mesh[0], other), mesh[0]) for other in UPS if other != "z"}
    for axis, vertices in turned.items():
        if mending.holds((vertices, mesh[1])):
            raise mending.Certain(
                f"{file}: expected a container whose opening points along {up}, found that it points along {_named(up, axis)}; "
                f"write `up: {_named(up, axis)}` into scan.yaml beside it"
            )
    return mesh, {"drains_closed": 0}  # no container at all: the stages that need one say so


def _named(up: str, axis: str) -> str:
    """Return which axis of the file is `axis` of a frame in which `up` became z."""
    direction = _rotation(up).T @ _rotation(axis).T[:, 2]
    k = int(np.argmax(np.abs(direction)))
    return ("-" if direction[k] < 0 else "") + "xyz"[k]


def _check_size(vertices_m: np.ndarray, dropped: DroppedMesh, largest_m: float) -> None:
    """Refuse what is too small, and too large: more than `largest_m` where scan.yaml gives no units."""
    size = float(np.ptp(vertices_m, axis=0).max()) if len(vertices_m) else 0.0
    path, file = dropped.path, dropped.path.parent / "scan.yaml"
    is_told = dropped.options.unit_m is not None
    largest_m = LARGEST_M if is_told else largest_m
    if size > largest_m:
        cure = f"correct `units` in {file} (m, cm or mm)" if is_told else f"{_cure(size)} into {file}"
        raise PipelineError(
            f"{path}: expected a container of at most {largest_m:g} m, found one of {size:.3g} m; {cure}"
        )
    if size < SMALLEST_M:
        raise PipelineError(
            f"{path}: expected a container of at least {SMALLEST_M * 1e3:g} mm, found one of {size * 1e3:.3g} mm; "
            f"correct `units` in {file} (m, cm or mm)"
        )


def _cure(size: float) -> str:
    """Return what to do with a mesh of `size` where metres were expected."""
    if size > MOST_IN_CM:
        return "looks like millimetres: write `units: mm`"
    if size > LEAST_IN_MM:
        return (
            "looks like millimetres or, if it is a large one, centimetres: write `units: mm` or `units: cm`"
        )
    if size > LARGEST_M:
        return "looks like centimetres or inches: write `units: cm` (inches: times 2.54 before)"
    return "scale it to its true size, or, if it is that large, write `units: m`"


def _rotation(up: str) -> np.ndarray:
    """Return the rotation (3, 3) that turns the axis `up` to z."""
    R = np.roll(np.eye(3), 2 - "xyz".index(up[-1]), axis=0)
    return np.diag([1.0, -1.0, -1.0]) @ R if up.startswith("-") else R


def upright(vertices_m: np.ndarray, up: str) -> np.ndarray:
    """Return T_object_world that turns the axis `up` to z and stands the vertices (V, 3) on z = 0 over the origin."""
    R = _rotation(up)
    turned = vertices_m @ R.T
    low, high = turned.min(axis=0), turned.max(axis=0)
    return frames.transform(R, -np.array([*(low + high)[:2] / 2, low[2]]))
