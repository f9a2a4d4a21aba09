"""Annotating in a real browser: what the mouse paints is what is saved, and it agrees with the mug's true parts."""

import json
import signal

import numpy as np
import pytest
from browser import opened
from conftest import PARTS, sampled
from pour.served import serving

from pipeline.artefacts import points, read_table
from pipeline.errors import PipelineError
from pipeline.geometry.frames import apply
from pipeline.pour.annotate import Annotation

RIM_M = 0.0040  # how far the mug's rim reaches below its top
TOP_M, OUTSIDE_M = 0.095, 0.0435


def seen(page, point_m):
    """Return where a point (3,) of the object is in the window, in pixels."""
    x, y = page.evaluate(
        "p => { const at = page.viewer.project(new Float32Array(p)); return [at.x[0], at.y[0]]; }",
        list(point_m),
    )
    box = page.locator("canvas").bounding_box()
    return box["x"] + x, box["y"] + y


def drag(page, a, b):
    page.mouse.move(*a)
    page.mouse.down()
    page.mouse.move(*b, steps=3)
    page.mouse.up()


def look(page, azimuth, elevation):
    page.evaluate(
        "([a, e]) => { page.viewer.azimuth = a; page.viewer.elevation = e; page.viewer.drawNow(); }",
        [azimuth, elevation],
    )


def iou(found, true):
    return (found & true).sum() / (found | true).sum()


def counted(page, part):
    return int(page.locator(f"#n-{part}").inner_text())


def test_a_mug_painted_by_box_and_brush_is_saved_with_its_true_parts(browser, project, T_object_world):
    truth = sampled("mug")
    with serving(project, "annotate", "mug") as (url, process), opened(browser, url, 800, 560) as tab:
        page = tab.page
        page.wait_for_selector("body[data-ready]")
        handle_m = points(truth[truth["handle"]])
        away = np.arctan2(*handle_m.mean(axis=0)[1::-1])
        look(page, away - np.pi / 2, 0.0)  # the handle to the right

        page.keyboard.press("x")
        page.keyboard.press("1")
        canvas = page.locator("canvas").bounding_box()
        corner = canvas["x"] + canvas["width"], canvas["y"] + canvas["height"]
        drag(page, (canvas["x"] + 2, canvas["y"] + 2), (corner[0] - 2, corner[1] - 2))
        assert counted(page, "container") == len(truth)

        page.keyboard.press("3")
        out = np.array([np.cos(away), np.sin(away), 0.0])
        centre = points(truth)[:, :2].mean(axis=0) * 0.0
        low = [*(centre + OUTSIDE_M * out[:2]), 0.0]
        drag(page, seen(page, low), (corner[0] - 2, canvas["y"] + 2))
        page.keyboard.press("2")
        left, right = (seen(page, [*(s * 0.06 * out[:2]), TOP_M - RIM_M]) for s in (-1, 1))
        drag(page, left, (right[0], canvas["y"] + 2))

        handles = counted(page, "handle")
        page.keyboard.press("b")
        page.keyboard.press("3")
        middle = seen(page, [0.0, 0.0, 0.05])
        drag(page, middle, (middle[0] + 30, middle[1]))
        assert counted(page, "handle") > handles  # the brush painted the wall
        page.keyboard.press("Control+z")
        assert counted(page, "handle") == handles

        page.click("#save")
        page.wait_for_function("document.getElementById('said').textContent.startsWith('saved')")
        page.click("#close")
        result = json.loads(process.communicate(timeout=20)[0])
        assert tab.complaints == []
        assert all(address.startswith((url, "data:")) for address in tab.requests)
    assert process.returncode == 0
    saved = read_table(project.folder / "config/annotations/mug.parquet", "annotation")
    np.testing.assert_allclose(apply(T_object_world, points(saved)), points(truth), atol=1e-5)
    for part, least in {"container": 0.97, "rim": 0.75, "handle": 0.9}.items():
        assert iou(saved[part].to_numpy(), truth[part].to_numpy()) > least, part
    assert result["annotation"].endswith("config/annotations/mug.parquet")
    assert result["rim"] == saved["rim"].sum()


def test_the_brush_paints_what_is_seen_and_not_the_far_wall(browser, project):
    with serving(project, "annotate", "mug") as (url, _), opened(browser, url, 800, 560) as tab:
        tab.page.wait_for_selector("body[data-ready]")
        look(tab.page, 0.0, 0.0)  # from +x
        middle = seen(tab.page, [0.0, 0.0, 0.05])
        drag(tab.page, middle, (middle[0] + 40, middle[1] + 20))
        kinds = np.array(tab.page.evaluate("Array.from(page.painting.kinds)"))
    painted = points(sampled("mug"))[kinds > 0]
    assert len(painted) > 50
    assert painted[:, 0].min() > 0.0
    assert np.hypot(*painted[:, :2].T).min() > 0.0385  # the outer side of a wall of 4 mm


def test_every_tool_is_in_reach_on_a_phone(browser, project):
    with serving(project, "annotate", "mug") as (url, _), opened(browser, url, 390, 740) as tab:
        tab.page.wait_for_selector("body[data-ready]")
        ends = tab.page.evaluate(
            "Array.from(document.querySelectorAll('button'), b => b.getBoundingClientRect().right)"
        )
        assert len(ends) > 8
        assert max(ends) <= 390


def test_nothing_is_saved_before_container_and_rim_are_painted(browser, project):
    with serving(project, "annotate", "mug") as (url, process), opened(browser, url, 800, 560) as tab:
        tab.page.wait_for_selector("body[data-ready]")
        tab.page.click("#save")
        tab.page.wait_for_function("document.getElementById('said').textContent.includes('paint some')")
        process.send_signal(signal.SIGINT)
        result = json.loads(process.communicate(timeout=20)[0])
    assert process.returncode == 0
    assert result == {"object": "mug", "annotation": None}
    assert not (project.folder / "config/annotations").exists()


def test_an_annotation_is_where_the_next_one_starts(project):
    truth = sampled("mug")[PARTS].to_numpy()
    first = Annotation(project, "mug", 6000)
    first.save(truth.astype(int).tolist())
    np.testing.assert_array_equal(Annotation(project, "mug", 6000).parts, truth)
    with pytest.raises(PipelineError, match="load the page again"):
        first.save(truth[:-1].astype(int).tolist())


def test_another_page_cannot_save(project):
    from urllib.error import HTTPError
    from urllib.request import Request, urlopen

    with serving(project, "annotate", "mug") as (url, _):
        for address, headers in ((f"{url}save", {}), (url, {"Host": "elsewhere.example:80"})):
            posted = b"[]" if "save" in address else None
            request = Request(address, posted, {"Content-Type": "application/json", **headers})
            with pytest.raises(HTTPError, match="403") as refusal:
                urlopen(request)
            refusal.value.close()
