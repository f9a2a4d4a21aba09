"""The figure of labels: one scale, handles to the right, and nothing that is hidden."""

import numpy as np
import pytest
from conftest import sampled
from matplotlib.colors import to_hex

from pipeline.artefacts import normals, points
from pipeline.report.labels import PARTS, _seen, _view, draw


def test_all_panels_have_one_scale_and_handles_are_to_the_right():
    mug, bowl = sampled("mug"), sampled("wide_bowl")
    figure = draw("mug", mug, {"wide_bowl": bowl}, {"wide_bowl": bowl})
    figure.canvas.draw()
    drawn = [axis for axis in figure.axes if axis.collections]
    assert [axis.get_title() for axis in drawn] == ["mug\n(annotated)", "wide bowl\ninitial", "final"]
    pixels_a_mm = [axis.get_window_extent().width / np.ptp(axis.get_xlim()) for axis in drawn]
    assert pixels_a_mm == pytest.approx([pixels_a_mm[0]] * 3, rel=0.03)
    dots = drawn[0].collections[0]
    colours = np.array([to_hex(colour).upper() for colour in dots.get_facecolors()])
    across = np.asarray(dots.get_offsets())[:, 0]
    handle, container = (across[colours == PARTS[part]] for part in ("handle", "container"))
    assert len(handle) > 20
    assert np.median(handle) > np.quantile(container, 0.9)


def test_what_faces_away_or_is_behind_a_wall_is_not_seen():
    table = sampled("tall_cup")
    axes, middle_m = _view(table)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    floor = (points(table)[:, 2] < 0.02) & (normals(table)[:, 2] > 0.9)
    assert floor.sum() > 20
    across, up, _ = _seen(table, axes, middle_m)
    shown = np.column_stack([across, up])
    hidden = (points(table)[floor] - middle_m) @ axes[:2].T * 1e3
    drawn = [np.isclose(shown, place, atol=1e-9).all(axis=1).any() for place in hidden]
    # The floor of a tall cup is behind its front wall.
    assert np.mean(drawn) < 0.05
