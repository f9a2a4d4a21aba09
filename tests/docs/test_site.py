"""The site is whole, needs no network, and its reference has everything."""

import yaml
from browser import opened
from docs.conftest import ROOT

from pipeline.pour.__main__ import SUBCOMMANDS
from pipeline.schemas import TABLES


def _keys(schema: dict, name: str = "") -> list[str]:
    inner = schema.get("properties", {})
    return [name.rpartition(".")[2]] * bool(name) + [
        key for one in inner for key in _keys(inner[one], f"{name}.{one}")
    ]


def test_the_site_is_built_without_a_warning(site):
    assert (site / "index.html").is_file()
    assert (site / "searchindex.js").stat().st_size > 10_000


def test_the_reference_has_every_key_table_and_subcommand(site):
    schema = yaml.safe_load((ROOT / "workflow/schemas/config.schema.yaml").read_text())
    page = (site / "reference/configuration.html").read_text()
    assert [
        key for key in _keys(schema) if f">{key}<" not in page.replace(".", "<>").replace("<>", ">")
    ] == []
    page = (site / "reference/tables.html").read_text()
    assert [name for name in TABLES if f'id="{name.replace("_", "-")}"' not in page] == []
    page = (site / "reference/pour.html").read_text()
    assert all(
        f'id="{module.__name__.replace("pipeline.", "").replace(".", "-")}"' in page for module in SUBCOMMANDS
    )


def test_public_functions_are_in_the_reference_with_their_words(site):
    page = (site / "reference/api/geometry.html").read_text()
    assert 'id="pipeline.geometry.frames.apply"' in page
    assert 'id="pipeline.models.Model"' in (site / "reference/api/shared.html").read_text()


def test_it_is_read_from_disk_without_network_or_sideways_scrolling(browser, site):
    for path in ("index.html", "tutorial.html", "evaluation.html", "reference/configuration.html"):
        address = (site / path).as_uri()
        with opened(browser, address, 390, 800) as tab:
            assert tab.complaints == []
            assert [asked for asked in tab.requests if not asked.startswith(("file:", "data:"))] == []
            assert tab.page.evaluate("document.documentElement.scrollWidth <= window.innerWidth"), path


def test_a_word_is_found(browser, site):
    with opened(browser, f"{(site / 'search.html').as_uri()}?q=tilt+reference") as tab:
        found = tab.page.locator("#search-results ul.search li")
        found.nth(3).wait_for()  # they come one after the other
        assert found.count() > 3
