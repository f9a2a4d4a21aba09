"""The page on a run: what it says, and that a real browser shows it, without a network, on a phone as well."""

import re
import subprocess
import sys

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from browser import opened
from conftest import PARTS, sampled

from pipeline.artefacts import write_json, write_mesh, write_table
from pipeline.errors import PipelineError
from pipeline.report.index.figures import images
from pipeline.report.index.numbers import claims, headlines, scores
from pipeline.report.index.objects import rows, scan
from pipeline.report.index.runs import runs
from pipeline.report.style import save
from pipeline.scan.shapes import shape
from pipeline.schemas import TABLES

NAMES = ("jug", "mug")
NUMBERS = {
    "classify.pouring.label_mapping.same.auc": 0.99,
    "classify.pouring.label_mapping.novel.auc": 0.98,
    "classify.pouring.label_mapping.novel.tpr_at_fpr_01": 0.8,
    "classify.pouring.standard.novel.auc": 0.9,
    "classify.filling.hydrostatic.novel.auc": 0.96,
    "classify.filling.hydrostatic.same.auc": 0.961,
    "classify.filling.standard.novel.auc": 0.75,
    "classify.filling.standard.same.auc": 0.85,
    "evaluation.filling.standard.novel.auc.low": 0.699,
    "evaluation.filling.standard.novel.auc.high": 0.854,
    "evaluation.filling.standard.same.auc.low": 0.876,
    "evaluation.filling.standard.same.auc.high": 0.912,
    "classify.filling.standard.novel.tpr_at_fpr_01": 0.07,
    "evaluation.pouring.label_mapping.novel.auc.low": 0.97,
    "evaluation.pouring.label_mapping.novel.auc.high": 0.985,
    "simulate.pouring.trials": 2000,
    "simulate.pouring.leaked": 3,
    "simulate.pouring.mug.positive_share": 0.6,
}
CLAIM = {"section": "IV-A", "words": "warped parameters lose less", "measure": "pouring", "sure": True}
CLAIMS = [
    CLAIM | {"value": 0.07, "low": 0.05, "high": 0.09, "holds": True, "why": ""},
    CLAIM | {"value": -0.02, "low": -0.02, "high": -0.02, "holds": False, "why": "Too few trials."},
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with what the page is made from, for two objects of true shape."""
    folder = tmp_path_factory.mktemp("run")
    for name in NAMES:
        body, truth = shape(name), sampled(name)
        write_mesh(folder / f"fuse/{name}/mesh.ply", (body.vertices_m, body.triangles))
        fusion = {
            "layout": "7-scenes",
            "n_views": 36,
            "share_seen": 0.9,
            "watertight": True,
            "residual_m": {"median": 0.0006},
            "complaints": ["the floor was poorly seen", "depth is noisy"] if name == "jug" else [],
        }
        write_json(folder / f"fuse/{name}/fusion.json", fusion)
        mapping = truth.assign(source_index=0, target_index=0, valid=True)[TABLES["mapping"].names]
        write_table(folder / f"warp/mug/{name}/label_mapping.parquet", mapping, "mapping")
    parameters = pd.DataFrame(
        [
            {"object": name, "mapping": mapping}
            for name in NAMES
            for mapping in ("label_mapping", "point_mapping")
        ]
    )
    for column in TABLES["parameters"].names[2:]:
        parameters[column] = np.where(parameters["mapping"] == "label_mapping", 0.04, 0.5)
    write_table(folder / "parametrise/mug/parameters.parquet", parameters, "parameters")
    write_json(folder / "metrics.json", {**NUMBERS, "claims": CLAIMS[:1]})
    write_json(folder / "execution.json", {"claims": CLAIMS[1:]})
    figure, axis = plt.subplots(figsize=(7, 2))
    axis.plot([0, 1], [0, 1])
    save([figure, figure], folder / "roc.pdf")
    figure.savefig(folder / "mug.png")
    plt.close(figure)
    return folder


@pytest.fixture(scope="module")
def page(folder):
    """Return the address of the page."""
    options = {
        "engine": "liquid",
        "spacing-m": 0.01,
        "samples": 50,
        "draws": 20,
        "source": "mug",
    }
    files = {
        "processed": folder,
        "figures": folder / "roc.pdf",
        "scans": folder / "mug.png",
    }
    command = [
        sys.executable,
        "-m",
        "pipeline.report.index",
        "--objects",
        *NAMES,
        "--output",
        folder / "index.html",
    ]
    command += ["--numbers", folder / "metrics.json", folder / "execution.json"]
    command += [f"--{key}={value}" for key, value in {**options, **files}.items()]
    subprocess.run(list(map(str, command)), check=True)
    return (folder / "index.html").as_uri()


@pytest.mark.parametrize(("width", "scheme"), [(320, "light"), (390, "light"), (1280, "dark")])
def test_a_browser_shows_it_without_complaint_network_or_sideways_scrolling(browser, page, width, scheme):
    with opened(browser, page, width, 740, color_scheme=scheme) as tab:
        tab.page.wait_for_selector("body[data-ready]")
        assert tab.complaints == []
        assert [address for address in tab.requests if not address.startswith(("data:", "blob:"))] == [page]
        assert tab.page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
        pictures = tab.page.evaluate(
            "Array.from(document.images, i => [i.alt, i.loading === 'lazy' || i.naturalWidth])"
        )
        assert len(pictures) == 3
        for words, size in pictures:
            assert len(words) > 20
            assert size
        assert tab.page.evaluate(FAINT) == []


# Every text whose contrast with the nearest background is below WCAG's 4.5 (3 for large text).
FAINT = """() => {
  const numbers = (text) => text.match(/[\\d.]+/g).map(Number);
  const light = (c) => c.slice(0, 3).map((v) => v / 255).map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
  const ground = (e) => {
    for (; e; e = e.parentElement) {
      const found = numbers(getComputedStyle(e).backgroundColor);
      if (found.length === 3 || found[3] > 0.8) return found;
    }
    return [255, 255, 255];
  };
  const faint = [];
  for (const e of document.querySelectorAll("body *")) {
    const own = [...e.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim());
    if (!own || e.closest(".stage") || !e.checkVisibility() || ["SCRIPT", "STYLE", "SELECT"].includes(e.tagName)) continue;
    const style = getComputedStyle(e), a = light(numbers(style.color)), b = light(ground(e));
    const least = parseFloat(style.fontSize) >= 24 ? 3 : 4.5;
    if ((Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05) < least) faint.push(e.textContent.trim().slice(0, 40));
  }
  return faint;
}"""

# Numbers of the canvas's pixels: drawn at all; as orange as a rim; as blue as liquid.
COLOURS = """() => {
  const canvas = document.querySelector("#panel canvas"), copy = document.createElement("canvas");
  copy.width = canvas.width; copy.height = canvas.height;
  const context = copy.getContext("2d");
  context.drawImage(canvas, 0, 0);
  const data = context.getImageData(0, 0, copy.width, copy.height).data, found = { drawn: 0, rim: 0, blue: 0, sum: 0 };
  for (let i = 0; i < data.length; i += 4) {
    const [r, g, b, a] = data.subarray(i, i + 4);
    found.drawn += a > 0; found.rim += a > 200 && r > 120 && r > 1.6 * g && b < 90; found.blue += a > 200 && b > 1.5 * r && b > 90;
    found.sum = (found.sum * 31 + r + 7 * g + 13 * b) % 1000003;
  }
  return found;
}"""


def test_objects_are_picked_turned_filled_and_tilted(browser, page):
    with opened(browser, page, 1000, 900) as tab:
        view = tab.page
        view.wait_for_selector("body[data-ready]")

        def settled():
            view.evaluate(
                "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
            )
            return view.evaluate(COLOURS)

        assert view.locator("#panel .title").inner_text() == "mug"
        full = settled()
        assert full["drawn"] > 20_000
        assert full["blue"] > 2_000
        view.locator("#panel canvas").focus()
        view.keyboard.press("ArrowLeft")
        assert settled()["sum"] != full["sum"]
        view.locator("input[name=fill]").fill("0")
        assert settled()["blue"] < full["blue"]
        view.locator("input[name=glass]").uncheck()
        view.locator("input[name=marked]").uncheck()
        assert settled()["rim"] > 200
        view.click("[data-show=jug]")
        view.wait_for_selector("#panel[data-shown=jug]")
        assert view.locator("#panel .title").inner_text() == "jug"
        view.locator("input[name=fill]").fill("100")
        view.locator("input[name=tilt]").fill("52")
        spilt, kept = map(int, re.findall(r"(?:pours|keeps) (\d+) ml", view.locator(".readout").inner_text()))
        held = int(re.search(r"capacity of (\d+) ml", view.locator(".readout").inner_text())[1])
        assert abs(spilt + kept - held) <= 1
        assert 0.3 < spilt / held < 0.7
        assert tab.complaints == []


def test_the_liquid_on_the_page_is_that_of_hydrostatics(browser, page):
    """The page's table of radii keeps at every tilt what the cavity's own cells do, to 2.5 % of the capacity."""
    from pipeline.geometry.cavity import cavity, lip_alone, pour_axis, retained_volume_m3

    body = shape("mug")
    cup = cavity(body.vertices_m, body.triangles, name="mug")
    lip, tilts = lip_alone(cup), np.deg2rad([20.0, 40.0, 60.0, 80.0, 100.0])
    true = retained_volume_m3(cup, lip, pour_axis(cup.opening_m, lip), tilts) / cup.capacity_m3
    with opened(browser, page) as tab:
        tab.page.wait_for_selector("body[data-ready]")
        tab.page.locator("input[name=fill]").fill("100")
        kept = []
        for tilt in np.rad2deg(tilts):
            tab.page.locator("input[name=tilt]").fill(f"{tilt:.0f}")
            words = tab.page.locator(".readout").inner_text()
            held, keeps = (int(re.search(rf"{what} (\d+) ml", words)[1]) for what in ("capacity of", "keeps"))
            kept.append(keeps / held)
    np.testing.assert_allclose(kept, true, atol=0.025)


def test_claims_of_all_numbers_are_on_the_page(browser, page):
    with opened(browser, page) as tab:
        assert tab.page.locator(".narrow .yes").count() == 1
        assert tab.page.locator(".narrow .no").count() == 1


def test_numbers_are_said_with_their_intervals_and_claims_with_their_answers():
    table = scores(NUMBERS)[0]
    assert table["rows"][0]["novel"] == {"value": 0.98, "low": 0.97, "high": 0.985}
    first, second = claims(CLAIMS)
    assert (first["value"], first["interval"], first["holds"]) == ("0.070", "0.050 to 0.090", True)
    assert (second["value"], second["interval"], second["why"]) == ("−0.020", "", "Too few trials.")
    (tiny,) = claims([CLAIMS[0] | {"value": -0.00012, "low": -0.0007, "high": 0.0}])
    assert (tiny["value"], tiny["interval"]) == ("−0.00012", "−0.001 to 0.000")
    told = {one["what"]: one for one in headlines(NUMBERS)}
    assert told["trials with liquid"]["value"] == "2,000"
    assert told["trials with liquid"]["beside"] == "3 particles through a wall"
    assert scores({}) == claims([]) == headlines({}) == []


def test_parameters_are_those_of_the_label_mapping_in_readable_units(folder):
    jug, mug = rows(folder, "mug", NAMES, None, NUMBERS)
    assert [one["value"] for one in mug["parameters"]][:2] == ["40.00", "40.00"]
    assert (jug["source"], mug["source"]) == (False, True)
    assert (jug["poured"], mug["poured"]) == (None, 0.6)
    assert mug["scan"]["seen"] == "90%"


def test_uncertainties_are_said_to_the_decimals_of_their_column(folder, tmp_path):
    names = ["radius_m", "volume_m3", "height_m"]
    table = pd.DataFrame({"object": ["mug"] * 3, "mapping": "label_mapping", "parameter": names})
    table = table.assign(value=0.04, std=[0.000123, 0.0000021, 0.0], unit="m")
    write_table(tmp_path / "uncertainties.parquet", table, "uncertainties")
    jug, mug = rows(folder, "mug", NAMES, tmp_path / "uncertainties.parquet", NUMBERS)
    assert [one["std"] for one in mug["parameters"]] == ["0.12", "< 0.01", "2.1", "", ""]
    assert [one["value"] for one in mug["parameters"]][:1] == ["40.00"]
    assert not any(one["std"] for one in jug["parameters"])


def test_what_fuse_complains_of_is_on_the_page(browser, page):
    with opened(browser, page) as tab:
        told = tab.page.locator("#objects-table ~ p").all_inner_texts()
    assert told[0] == "jug, of its scan: the floor was poorly seen. depth is noisy."
    assert not any("mug, of its scan" in words for words in told)


def test_a_scan_without_views_is_told_as_what_it_is():
    told = scan({"layout": "mesh", "n_views": 0, "share_seen": 1.0, "watertight": False, "residual_m": {}})
    assert told == {"kind": "mesh", "seen": "–", "median": "–", "closed": "not closed", "complaints": []}


def test_links_lead_to_the_runs_and_name_what_they_show():
    assert [name for name, _ in runs()] == ["all runs", "pouring", "filling"]
    for _, address in runs():
        assert address.startswith("http://127.0.0.1:5000/#/experiments/1?workflowType=machine_learning")
    assert "pouring" in runs()[1][1]


def test_every_page_of_a_figure_is_an_image_and_a_broken_one_is_named(folder, tmp_path):
    first, second = images(folder / "roc.pdf")
    assert (first["width"], first["height"]) == (672, 192)  # 7 × 2 inches
    assert first["image"] == second["image"]
    broken = tmp_path / "roc.pdf"
    broken.write_bytes(b"%PDF-1.4 and nothing")
    with pytest.raises(PipelineError, match=r"roc\.pdf: expected a figure as PDF"):
        images(broken)


def test_parts_on_the_page_are_those_of_the_points():
    """Vertices get the parts of the surface's points: a vertex deep in a part has all of it."""
    import base64
    import gzip

    from pipeline.scene.shape import surface, thinned

    body, truth = shape("mug"), sampled("mug")
    packed = surface(
        (body.vertices_m, body.triangles), truth[["x_m", "y_m", "z_m"]].to_numpy(), truth[PARTS].to_numpy()
    )
    where = packed["surface"]["arrays"]["parts"]
    content = gzip.decompress(base64.b64decode(packed["surface"]["data"]))
    parts = np.frombuffer(content, np.uint8, where["count"], where["offset"]).reshape(-1, 3)
    vertices, _ = thinned((body.vertices_m, body.triangles))
    on_handle = np.hypot(*vertices[:, :2].T) > 0.050
    assert (parts[on_handle, 2] == 255).mean() > 0.9
    bottom = vertices[:, 2] < 0.005
    np.testing.assert_array_equal(parts[bottom], np.broadcast_to([255, 0, 0], (bottom.sum(), 3)))
