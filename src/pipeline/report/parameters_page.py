"""Each parameter drawn where it is: a cut through the object in the plane in which it pours."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.geometry.cavity import TIE_M

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ORANGE, BLUE, GREEN, PURPLE, GREY = "#D55E00", "#0072B2", "#009E73", "#CC79A7", "#7F7F7F"
COLUMNS = 4
POINTS = 1200
CUT_MM = 2.5  # half the thickness of the slice that is drawn dark
BESIDE_MM = 9.0  # a spout is less deep than the lip's mark is high: its depth is drawn beside it

Values = dict[str, float]


@dataclass(frozen=True)
class Drawn:
    """An object to draw: its points (N, 3) in metres, object frame, which are container (N,), its numbers and their std."""

    name: str
    points_m: np.ndarray
    container: np.ndarray
    values: Values
    std: Values

    def vector_mm(self, what: str) -> np.ndarray:
        """Return a point parameter (3,) in millimetres; a KeyError says that it is not listed."""
        return np.array([self.values[f"{what}_{axis}_m"] for axis in "xyz"]) * 1e3

    def in_plane_mm(self, points_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return points (N, 3) as distance towards the lip, distance from the plane, and height (N,) each."""
        opening, lip = self.vector_mm("opening"), self.vector_mm("lip")
        out = (lip - opening)[:2] / np.linalg.norm((lip - opening)[:2])
        offset = points_mm[..., :2] - opening[:2]
        return offset @ out, offset @ np.array([-out[1], out[0]]), points_mm[..., 2]


def drawings(objects: Sequence[Drawn]) -> "Figure":
    """Return the page with a panel an object, and one that says what is what."""
    import matplotlib.pyplot as plt

    from pipeline.report.style import RC

    rows = -(-(len(objects) + 1) // COLUMNS)
    with plt.rc_context(RC):
        figure, axes = plt.subplots(
            rows, COLUMNS, figsize=(2.6 * COLUMNS, 2.7 * rows), squeeze=False, layout="constrained"
        )
        for axis, drawn in zip(axes.flat, objects, strict=False):
            _panel(axis, drawn)
        for axis in axes.flat[len(objects) :]:
            axis.set_axis_off()
        marks = {mark.get_label(): mark for axis in axes.flat for mark in axis.get_legend_handles_labels()[0]}
        axes.flat[len(objects)].legend(
            marks.values(), marks.keys(), loc="center left", frameon=False, fontsize=7
        )
        figure.supxlabel("towards the lip, mm", fontsize=8)
        figure.supylabel("height, mm", fontsize=8)
    return figure


def _panel(axis: "Axes", drawn: Drawn) -> None:
    """Draw a cut and what is listed of the parameters that have a picture."""
    axis.set_title(drawn.name.replace("_", " "))
    axis.set_aspect("equal", adjustable="datalim")
    try:
        along, aside, height = drawn.in_plane_mm(drawn.points_m * 1e3)
    except KeyError:  # opening or lip are not listed: there is no plane to cut in
        axis.set_axis_off()
        return
    cut = np.abs(aside) < CUT_MM
    thin = slice(None, None, max(1, len(along) // POINTS))
    axis.scatter(along[thin], height[thin], s=0.4, lw=0, color="0.85")
    axis.scatter(along[cut], height[cut], s=1.2, lw=0, color="0.25")
    for draw in PICTURES:
        try:
            draw(axis, drawn)
        except KeyError:
            continue  # not listed


def _lip(drawn: Drawn) -> tuple[float, float]:
    along, _, height = drawn.in_plane_mm(drawn.vector_mm("lip"))
    return float(along), float(height)


def _opening(axis: "Axes", drawn: Drawn) -> None:
    height = drawn.vector_mm("opening")[2]
    radius = drawn.values["radius_m"] * 1e3
    axis.plot([0.0], [height], "+", color="black", ms=7, label="opening's centre")
    axis.annotate("", (radius, height), (0.0, height), arrowprops={"arrowstyle": "->", "color": PURPLE})
    axis.plot([], [], color=PURPLE, label="radius")


def _lip_point(axis: "Axes", drawn: Drawn) -> None:
    axis.plot(*_lip(drawn), "o", color=ORANGE, ms=4, label="lip", zorder=5)


def _height(axis: "Axes", drawn: Drawn) -> None:
    along, _, height = drawn.in_plane_mm(drawn.points_m * 1e3)
    left, low = along.min() - 8.0, height.min()
    top = low + drawn.values["height_m"] * 1e3
    axis.annotate("", (left, top), (left, low), arrowprops={"arrowstyle": "<->", "color": GREY})
    axis.plot([left, left], [low, top], color=GREY, lw=0.8, label="height")


def _hull(axis: "Axes", drawn: Drawn) -> None:
    from scipy.spatial import ConvexHull

    _ = drawn.values["volume_m3"]
    along, _, height = drawn.in_plane_mm(drawn.points_m[drawn.container] * 1e3)
    outline = np.column_stack([along, height])
    corners = ConvexHull(outline).vertices
    axis.fill(*outline[corners].T, fill=False, ls="--", lw=0.8, ec=GREY, label="container's hull")


def _surface(axis: "Axes", drawn: Drawn, tilt_rad: float, colour: str, style: str, label: str) -> None:
    """Draw the level through the lip of the cup tilted by an angle, in the cup's own frame."""
    lip = np.array(_lip(drawn))
    far = np.ptp(drawn.in_plane_mm(drawn.points_m * 1e3)[0])
    height = (lip[1] - drawn.points_m[:, 2].min() * 1e3) / max(np.sin(tilt_rad), 1e-6)
    end = lip - min(far, height) * np.array([np.cos(tilt_rad), np.sin(tilt_rad)])
    axis.plot(*np.column_stack([lip, end]), color=colour, ls=style, lw=1.4, label=label)


def _tilt(axis: "Axes", drawn: Drawn) -> None:
    _surface(
        axis, drawn, drawn.values["tilt_reference_rad"], ORANGE, "-", "level at the tilt reference (hull)"
    )


def _cavity_tilt(axis: "Axes", drawn: Drawn) -> None:
    tilt_rad = drawn.values["tilt_reference_cavity_rad"]
    _surface(axis, drawn, tilt_rad, BLUE, "--", "level at the tilt reference (cavity)")


def _capacity(axis: "Axes", drawn: Drawn) -> None:
    _ = drawn.values["capacity_m3"]
    lip = _lip(drawn)
    axis.plot([-lip[0], lip[0]], [lip[1]] * 2, color=BLUE, lw=0.8, label="level when brimful (capacity)")


def _wall(axis: "Axes", drawn: Drawn) -> None:
    along, aside, height = drawn.in_plane_mm(drawn.points_m * 1e3)
    middle = height.min() + 0.5 * np.ptp(height)
    near = drawn.container & (np.abs(aside) < 2 * CUT_MM) & (np.abs(height - middle) < 3.0)
    outer = along[near].max(initial=0.0)
    wall = [outer - drawn.values["wall_m"] * 1e3, outer]
    axis.plot(wall, [middle] * 2, color=GREEN, lw=3.0, solid_capstyle="butt", label="wall")


def _stability(axis: "Axes", drawn: Drawn) -> None:
    along, _, height = drawn.in_plane_mm(drawn.points_m * 1e3)
    edge, low = along[height < height.min() + 1.5].max(), height.min()
    middle = low + edge / max(np.tan(drawn.values["stability_rad"]), 1e-6)
    words = "base's edge to centre of mass (stability)"
    axis.plot([edge, 0.0], [low, middle], color=GREEN, ls=":", lw=1.4, label=words)


def _spout(axis: "Axes", drawn: Drawn) -> None:
    depth = drawn.values["spout_depth_m"] * 1e3
    if depth > TIE_M * 1e3:
        along, height = _lip(drawn)
        depth_mm = [height, height + depth]
        look: Any = {"color": ORANGE, "lw": 2.4, "solid_capstyle": "butt", "label": "depth of the spout"}
        axis.plot([along + BESIDE_MM] * 2, depth_mm, **look)


PICTURES: tuple[Callable[["Axes", Drawn], None], ...] = (
    *(_hull, _capacity, _tilt, _cavity_tilt, _opening, _height, _wall, _stability, _spout, _lip_point),
)
