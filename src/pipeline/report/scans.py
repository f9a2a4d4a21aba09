"""Draw one object's scan on a page: its surface from four sides, sections through the walls, the views, the residuals, and what
fuse complains of."""

import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline import command

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Azimuth and elevation in degrees, and what the panel is called.
SIDES = (
    (-60.0, 25.0, "front"),
    (120.0, 25.0, "back"),
    (-60.0, 70.0, "from above"),
    (-60.0, -35.0, "from below"),
)
PIXELS, CHARACTERS = 260, 165  # of a side's edge; of a line of text
SEEN_RGB, UNSEEN_RGB = (0.34, 0.71, 0.91), (0.90, 0.62, 0.0)  # Okabe and Ito's sky blue and orange
LINE, MARK, TOLD = "#0072B2", "#D55E00", "#8A3A00"


def main() -> None:
    """Read what fuse made of one object; write the page."""
    parser = command.parser(__doc__)
    parser.add_argument("--mesh", type=Path, required=True)
    parser.add_argument("--cloud", type=Path, required=True)
    parser.add_argument("--fusion", type=Path, required=True, help="its fusion.json")
    parser.add_argument("--output", type=Path, required=True, help="page to write, PNG")
    options = parser.parse_args()

    from pipeline.artefacts import points, read_json, read_mesh, read_table, replacing

    cloud = read_table(options.cloud, "cloud")
    name = options.fusion.parent.name
    mesh, facts = read_mesh(options.mesh), read_json(options.fusion)
    with command.steps(f"page on the scan of {name}", 3) as tell, replacing(options.output) as temporary:
        figure = draw(name, mesh, points(cloud), cloud["seen"].to_numpy(bool), facts, tell)
        tell("writing")
        figure.savefig(temporary, dpi=110, metadata={"Software": None})


def draw(
    name: str,
    mesh: "tuple[np.ndarray, np.ndarray]",
    points_m: "np.ndarray",
    seen: "np.ndarray",
    facts: dict[str, Any],
    tell: Callable[[str], None] = command.untold,
) -> "Figure":
    """Return the page of an object: its mesh, cloud points (N, 3), which of them were seen (N,), content of fusion.json."""
    import matplotlib.pyplot as plt
    from scipy.spatial import cKDTree

    from pipeline.geometry.surface import Surface
    from pipeline.report.style import RC

    with plt.rc_context(RC):
        figure = plt.figure(figsize=(10.5, 5.6), layout="constrained")
        grid = figure.add_gridspec(2, 4, height_ratios=(1.0, 1.1))
        tell("sides")
        surface, tree = Surface(*mesh), cKDTree(points_m)
        for k, (azimuth, elevation, title) in enumerate(SIDES):
            axis = figure.add_subplot(grid[0, k])
            axis.imshow(shaded(surface, mesh[0], tree, seen, azimuth, elevation))
            axis.set_axis_off()
            axis.set_title(title)
        tell("sections")
        for k, normal in enumerate(((0, 1, 0), (1, 0, 0))):
            _section(figure.add_subplot(grid[1, k]), mesh, normal)
        _views(figure.add_subplot(grid[1, 2], projection="polar"), facts)
        _residuals(figure.add_subplot(grid[1, 3]), facts)
        figure.suptitle(f"{name.replace('_', ' ')}: {summary(seen, facts)}", fontsize=9)
        told = [f"! {complaint}" for complaint in facts.get("complaints", [])]
        figure.supxlabel(
            "\n".join(textwrap.fill(line, CHARACTERS, subsequent_indent="  ") for line in told),
            **{"x": 0.01, "horizontalalignment": "left", "fontsize": 8.5, "color": TOLD},
        )
    return figure


def summary(seen: "np.ndarray", facts: dict[str, Any]) -> str:
    """Return in a line what the scan is and what of it was seen."""
    said = [f"layout {facts['layout']}"]
    if facts["n_views"]:
        said.append(f"{facts['n_views']} views, poses {facts.get('poses', 'given')}")
        said.append(f"{seen.mean():.0%} of the surface seen (orange: closed, not seen)")
    if facts.get("turns_given"):
        said.append("turns of the table as given")
    elif facts.get("roll_observable") is False:
        said.append("turn about the vertical not observable: round")
    if left_out := [*facts.get("views_left_out", []), *facts.get("views_without_object", [])]:
        said.append(f"{len(left_out)} views left out")
    said.append("closed" if facts["watertight"] else "NOT closed")
    return "; ".join(said)


def shaded(
    surface: Any, vertices_m: "np.ndarray", tree: Any, seen: "np.ndarray", azimuth: float, elevation: float
):  # type: ignore[no-untyped-def]
    """Return an image (H, W, 3) of the surface in parallel projection, lit from the camera, in the colour of seen or unseen."""
    import numpy as np

    a, e = np.deg2rad([azimuth, elevation])
    back = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    up = np.cross(back, right)
    centre = (vertices_m.min(axis=0) + vertices_m.max(axis=0)) / 2
    reach = 1.05 * np.linalg.norm(vertices_m - centre, axis=1).max()
    across = np.linspace(-reach, reach, PIXELS)
    origins = centre + 2 * reach * back + across[None, :, None] * right - across[:, None, None] * up
    depth = surface.hit(origins, np.broadcast_to(-back, origins.shape))
    hit = np.isfinite(depth)
    slope = np.gradient(np.where(hit, depth, np.nan), across[1] - across[0])
    light = 1 / np.sqrt(1 + np.nan_to_num(slope[0], nan=1.0) ** 2 + np.nan_to_num(slope[1], nan=1.0) ** 2)
    image = np.ones((*depth.shape, 3))
    nearest = tree.query(origins[hit] - depth[hit][:, None] * back)[1]
    colour = np.where(seen[nearest][:, None], SEEN_RGB, UNSEEN_RGB)
    image[hit] = colour * (0.25 + 0.75 * light[hit])[:, None]
    return image


def _section(axis: "Axes", mesh: "tuple[np.ndarray, np.ndarray]", normal: tuple[int, int, int]) -> None:
    """Draw where a vertical plane through the axis cuts the walls."""
    import numpy as np
    import trimesh
    from matplotlib.collections import LineCollection

    cut = trimesh.intersections.mesh_plane(
        trimesh.Trimesh(*mesh, process=False), np.array(normal, float), np.array([1e-6, 1e-6, 0.0])
    )
    along = 0 if normal[1] else 1
    axis.add_collection(LineCollection(1e3 * cut[:, :, [along, 2]], colors=LINE, linewidths=0.9))
    axis.autoscale()
    axis.set_aspect("equal")
    axis.set_xlabel(f"{'xy'[along]} / mm")
    axis.set_ylabel("z / mm")
    axis.set_title(f"section at {'yx'[along]} = 0")


def _views(axis: Any, facts: dict[str, Any]) -> None:
    """Draw from where the cameras looked: azimuth round, elevation from the rim (level) to the middle (from above)."""
    import numpy as np

    axis.set_title("views: 90° is from above")
    axis.set_ylim(0, 90)
    axis.set_yticks([0, 30, 60], ["90°", "60°", "30°"], fontsize=6)
    axis.tick_params(axis="x", labelsize=6)
    if not facts.get("eyes_object_m"):
        axis.text(0, 0, "no views: the file is the surface", ha="center", va="center")
        return
    eyes = np.array(facts["eyes_object_m"])
    elevation = np.degrees(np.arctan2(eyes[:, 2], np.hypot(eyes[:, 0], eyes[:, 1])))
    axis.plot(np.arctan2(eyes[:, 1], eyes[:, 0]), 90 - elevation, "o", ms=3.5, color=MARK)


def _residuals(axis: "Axes", facts: dict[str, Any]) -> None:
    """Draw how near the measured points are to the surface."""
    import numpy as np

    residual = facts.get("residual_m") or {}
    axis.set_title("measured points to surface")
    if "twentieths" not in residual:
        axis.set_axis_off()
        axis.text(0.5, 0.5, "no measured points", ha="center", va="center", transform=axis.transAxes)
        return
    mm = 1e3 * np.array(residual["twentieths"])
    axis.plot(mm[:-1], np.linspace(0, 95, 20), color=LINE)
    for share, value in ((50, 1e3 * residual["median"]), (95, 1e3 * residual["quantile_95"])):
        axis.plot([value], [share], "o", ms=4, color=MARK)
        axis.annotate(f" {share} % within {value:.2f} mm", (value, share), va="top", fontsize=7)
    axis.set_xlim(0, 1.6 * mm[-2])
    axis.set_xlabel("distance / mm")
    axis.set_ylabel("share of the points / %")


if __name__ == "__main__":
    command.run(main)
