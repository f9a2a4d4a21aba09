"""How much of each part of a container was seen by a camera: inner wall, floor, rim, outer wall."""

import numpy as np
from scipy.spatial import cKDTree

from pipeline.fuse import walls
from pipeline.fuse.smoothing import vertex_normals
from pipeline.fuse.tsdf import Surface
from pipeline.geometry.sampling import triangle_areas_and_normals

RIM_M = 0.004  # from the edge between inside and outside, as everywhere
# Such an edge so far below the highest in its direction is no rim, but where an unseen wall is ragged.
BELOW_RIM_M = 0.02
FLOOR_COSINE = 0.7  # what faces up within 45° is floor
MUCH_THICKENED = 0.01  # of the outside: is named
POOR = 0.8  # a part of which less was seen is named
GUESSED = 0.3  # of the inner wall or of the floor: with less of it seen the capacity is a guess
# A step round the foot: so low, faces up within 25°, on so much of the way round.
STEP_M, LOW_SHARE, LEVEL_COSINE, ROUND_SHARE = (0.0015, 0.06), 0.5, 0.9, 0.6
# A stem rises from it, as a goblet's from its own foot: of so small a radius, and share of it, at these heights above it.
STEM_RADIUS_M, STEM_SHARE, STEM_M = 0.012, 0.45, (0.004, 0.012)
FLOATS_M = 0.005  # above the table: what a foot's shadow and noise leave open is less
DRAIN_M2 = 0.0001  # of the table seen through the floor: of the demonstration objects it is none
NO_INSIDE = (
    "its inside was poorly seen: no inside that is open upwards was found; it is dark or shiny, no view looked in, or the object "
    "has a lid, lies on its side or stands upside down; stand it upright and open, and look from above 60°"
)
BLIND = (
    "its capacity is a guess, as too little of its inside was seen; look from above 60°, make it matt where it is dark, shiny or "
    "clear, or, where the neck is too narrow to look in, drop a mesh of it with its inside"
)


def parts(surface: Surface) -> dict[str, np.ndarray]:
    """Return the vertices (V,) of each part; what stands on the table belongs to none. No inside: all is outer wall."""
    above = surface.vertices_m[:, 2] > 0
    inner = surface.inner & above
    edge = _highest(surface.vertices_m, _border(surface.triangles, inner) & above)
    rim = np.zeros(len(above), bool)
    if edge.any():
        rim = above & np.isfinite(
            cKDTree(surface.vertices_m[edge]).query(surface.vertices_m, distance_upper_bound=RIM_M)[0]
        )
    level = vertex_normals(surface.vertices_m, surface.triangles, 1)[:, 2] > FLOOR_COSINE
    return {
        "inner_wall": inner & ~rim & ~level,
        "floor": inner & ~rim & level,
        "rim": rim,
        "outer_wall": above & ~inner & ~rim,
    }


def shares_seen(surface: Surface) -> dict[str, float | None]:
    """Return which share of each part's area was seen; None where there is no such part."""
    area, _ = triangle_areas_and_normals(surface.vertices_m, surface.triangles)
    weight = np.bincount(surface.triangles.ravel(), np.repeat(area, 3), len(surface.vertices_m))
    shares: dict[str, float | None] = {}
    for name, part in parts(surface).items():
        total = weight[part].sum()
        shares[name] = float(weight[part & surface.seen].sum() / total) if total > 0 else None
    return shares


def step_m(surface: Surface) -> float | None:
    """Return the height above the table of what is level all round the foot, as a board or a saucer under it is; or None.

    A goblet's own foot, from which a stem rises, is none.
    """
    if not surface.inner.any():
        return None
    x, y, z = surface.vertices_m.T
    low = (z > STEP_M[0]) & (z < min(STEP_M[1], LOW_SHARE * z.max())) & ~surface.inner
    level = low & (vertex_normals(surface.vertices_m, surface.triangles, 1)[:, 2] > LEVEL_COSINE)
    directions = np.unique(np.floor(np.degrees(np.arctan2(y[level], x[level])) / 5))
    if len(directions) <= ROUND_SHARE * 72:
        return None
    step, out = np.median(z[level]), np.hypot(x, y)
    above = (z > step + STEM_M[0]) & (z < step + STEM_M[1])
    has_stem = above.any() and out[above].max() < min(STEM_RADIUS_M, STEM_SHARE * out[level].max())
    return None if has_stem else float(step)


def complaints(
    shares: dict[str, float | None],
    thickened_share: float = 0.0,
    lowest_m: float = 0.0,
    stepped_m: float | None = None,
    table_closed_m2: float = 0.0,
    open_below_m: float | None = None,
) -> list[str]:
    """Return a sentence for each part that was poorly seen or not at all, a wall that was thickened, a foot that is missing, a
    step round the foot, a floor that is the table, and one that is missing."""
    inside = [shares.get("inner_wall"), shares.get("floor")]
    told = [NO_INSIDE] if shares and inside == [None, None] else _poor(shares)
    if any(share is not None and share < GUESSED for share in inside):
        told.append(BLIND)
    if thickened_share > MUCH_THICKENED:
        told.append(
            f"the wall is too thin for this camera: {thickened_share:.0%} of the outside was moved to be "
            f"{walls.LEAST_WALL_M * 1e3:.1f} mm from the inside"
        )
    if lowest_m > FLOATS_M:
        told.append(
            f"nothing of it was seen between the table and {lowest_m * 1e3:.0f} mm above: its foot is clear, dark or shiny, or it "
            "stands on something that is; heights are counted from the table"
        )
    if stepped_m is not None:
        told.append(
            f"something level, {stepped_m * 1e3:.0f} mm above the table, is all round its foot and was fused with it: "
            "if that is a board, a coaster or a saucer, and not its own foot, take it away"
        )
    if table_closed_m2 > DRAIN_M2:
        told.append(
            f"{1e4 * table_closed_m2:.1f} cm² of its floor are as low as the table, which closes it there: if it has holes, as a "
            "colander or the tube of a cake tin, it holds less than is found or nothing; if its floor is clear, less by it; if "
            "it is very thin, all is well; if not, the camera measures its inside too deep, as those by time of flight do, and it "
            "holds less than is found"
        )
    if open_below_m is not None:
        told.append(
            f"it may be found to hold nothing, as its inside is open to the side below {open_below_m * 1e3:.0f} mm above the "
            "table: it has holes, or its wall is too thin for this camera there; record more views, from nearer and with the "
            "camera's filling of holes off, or drop a mesh of it"
        )
    return told


def _poor(shares: dict[str, float | None]) -> list[str]:
    told = []
    for name, share in shares.items():
        what = name.replace("_", " ")
        if share is None and name == "inner_wall":
            continue  # a saucer, all floor
        if share is None:
            told.append(f"the {what} was not seen at all: dark or shiny, or no view from high enough")
        elif share < POOR:
            told.append(
                f"the {what} was poorly seen, {share:.0%} of it; the rest is closed by guess: look from more sides, or from higher"
            )
    return told


def _highest(vertices: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """Return which vertices (V,) of the edge are as high as others in their direction from its middle, but for `BELOW_RIM_M`."""
    if not edge.any():
        return edge
    x, y = (vertices[:, :2] - vertices[edge, :2].mean(axis=0)).T
    direction = np.floor(np.degrees(np.arctan2(y, x)) / 10).astype(int) + 18
    top = np.full(37, -np.inf)
    np.maximum.at(top, direction[edge], vertices[edge, 2])
    return edge & (vertices[:, 2] > top[direction] - BELOW_RIM_M)


def _border(triangles: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """Return the vertices (V,) with an edge from inside to outside."""
    edges = np.concatenate([triangles[:, :2], triangles[:, 1:], triangles[:, ::2]])
    border = np.zeros(len(inner), bool)
    border[edges[inner[edges[:, 0]] != inner[edges[:, 1]]].ravel()] = True
    return border
