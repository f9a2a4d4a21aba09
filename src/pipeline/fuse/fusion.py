"""From a raw folder to the surface, the cloud and the report of what was found."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.artefacts import Mesh
from pipeline.columns import Columns
from pipeline.command import untold
from pipeline.errors import PipelineError
from pipeline.fuse import coverage, dropped, layouts, recorded, tsdf
from pipeline.fuse.cloud import cloud
from pipeline.geometry.sampling import triangle_areas_and_normals
from pipeline.geometry.surface import Surface, is_closed

LEAST_POINTS = 5000
# A surface further than this from half of its own measurements was fused from views that do not fit together.
LARGEST_RESIDUAL_M = 0.003
_RESIDUAL_POINTS = 8_000


@dataclass(frozen=True)
class Fused:
    """mesh: vertices (V, 3) and triangles (F, 3), object frame; cloud: table `cloud`; report: content of fusion.json."""

    mesh: Mesh
    cloud: Columns
    report: dict[str, Any]

    @property
    def complaints(self) -> tuple[str, ...]:
        """What a user should know of the scan, a sentence each."""
        return tuple(self.report["complaints"])


def fused(
    folder: Path,
    *,
    voxel_m: float,
    truncation_m: float,
    n_points: int,
    seed: int,
    tell: Callable[[str], None] = untold,
) -> Fused:
    """Fuse data/raw/<object>/; a `PipelineError` names the folder or file that is wrong. `tell` is told each step."""
    if n_points < LEAST_POINTS:
        raise PipelineError(f"--points: expected at least {LEAST_POINTS}, found {n_points}; set fuse.points")
    rng = np.random.default_rng(seed)
    tell("reading")
    raw = layouts.read(folder)
    if isinstance(raw, layouts.DroppedMesh):
        tell("mending and measuring the mesh")
        vertices, triangles, T_object_world, facts = dropped.read(raw, rng)
        every = np.ones(len(vertices), bool)
        surface = tsdf.Surface(vertices, triangles, every, ~every)
        facts |= {"complaints": dropped.complaints(facts)}
        return _result(surface, n_points, False, rng, facts | _mesh_facts(T_object_world, raw))
    tell("poses, table and object")
    scan = recorded.located(raw, str(folder), rng)
    tell("the surface")
    surface = tsdf.fuse(scan.views, scan.placement, voxel_m, truncation_m, str(folder), scan.seen_by)
    recorded.check_registered(scan, surface.vertices_m, surface.seen, str(folder))
    tell("how well it fits, points on it")
    shares = coverage.shares_seen(surface)
    facts = scan.facts() | _residuals(scan, surface, str(folder), rng)
    facts |= {
        "seen": shares,
        "floor_closed_by_table_m2": surface.table_closed_m2,
        "wall_thickened_share": surface.thickened_share,
        "open_below_m": surface.open_below_m,
    }
    told = recorded.complaints(facts) + coverage.complaints(
        shares,
        thickened_share=surface.thickened_share,
        lowest_m=float(surface.vertices_m[:, 2].min()),
        stepped_m=coverage.step_m(surface),
        table_closed_m2=surface.table_closed_m2,
        open_below_m=surface.open_below_m,
    )
    return _result(surface, n_points, True, rng, facts | {"complaints": told})


def _result(
    surface: tsdf.Surface, n_points: int, was_fused: bool, rng: np.random.Generator, facts: dict[str, Any]
) -> Fused:
    points = cloud(surface.vertices_m, surface.triangles, surface.seen, n_points, was_fused, rng)
    report = {
        "share_seen": float(points["seen"].mean()),
        "watertight": is_closed(surface.triangles),
        "n_triangles": len(surface.triangles),
        "area_m2": float(triangle_areas_and_normals(surface.vertices_m, surface.triangles)[0].sum()),
    }
    return Fused((surface.vertices_m, surface.triangles), points, facts | report)


def _mesh_facts(T_object_world: np.ndarray, raw: layouts.DroppedMesh) -> dict[str, Any]:
    facts = {
        "unit_m": raw.options.unit_m or 1.0,
        "table_plane_world": None,
        "table_rms_m": None,
        "residual_m": None,
    }
    return facts | {"T_object_world": T_object_world.tolist()}


def _residuals(
    scan: recorded.Located, surface: tsdf.Surface, name: str, rng: np.random.Generator
) -> dict[str, Any]:
    points = scan.placement.points_m
    measured = points[rng.integers(len(points), size=_RESIDUAL_POINTS)]
    residual = Surface(surface.vertices_m, surface.triangles).distance(measured)
    median, high = np.quantile(residual, [0.5, 0.95])
    largest = max(LARGEST_RESIDUAL_M, scan.spread_m)
    if median > largest:
        raise PipelineError(
            f"{name}: expected measured points within {largest * 1e3:.1f} mm of the fused surface, found half of them "
            f"beyond {median * 1e3:.1f} mm; the poses do not fit the images (camera→world, in metres?)"
        )
    twentieths = np.quantile(residual, np.linspace(0, 1, 21)).tolist()
    return {"residual_m": {"median": float(median), "quantile_95": float(high), "twentieths": twentieths}}
