"""The page on a scan: what fuse complains of is on it, and covers nothing else."""

from conftest import sampled

from pipeline.fuse import coverage
from pipeline.report import scans
from pipeline.scan.shapes import shape

FACTS = {"layout": "7-scenes", "n_views": 1, "watertight": True, "eyes_object_m": [[0.3, 0.2, 0.5]]}


def test_complaints_are_below_everything_else_and_within_the_page():
    body, cloud = shape("small_cup"), sampled("small_cup", 500)
    told = coverage.complaints({"inner_wall": 0.2, "floor": 0.5}, 0.1, 0.02, 0.004, 0.0004, 0.006)
    points_m, seen = cloud[["x_m", "y_m", "z_m"]].to_numpy(), cloud["seen"].to_numpy()
    figure = scans.draw(
        "cup", (body.vertices_m, body.triangles), points_m, seen, FACTS | {"complaints": told}
    )
    figure.draw_without_rendering()
    words = figure.get_supxlabel()
    assert [" ".join(line.split()) for line in words.replace("\n  ", " ").splitlines()] == [
        f"! {complaint}" for complaint in told
    ]
    box = figure._supxlabel.get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= figure.bbox.width
    assert box.y0 >= 0
    assert box.y1 <= min(axis.get_tightbbox().y0 for axis in figure.axes)


def test_a_scan_without_complaints_says_nothing():
    body, cloud = shape("small_cup"), sampled("small_cup", 500)
    points_m, seen = cloud[["x_m", "y_m", "z_m"]].to_numpy(), cloud["seen"].to_numpy()
    figure = scans.draw("cup", (body.vertices_m, body.triangles), points_m, seen, FACTS)
    assert figure.get_supxlabel() == ""
