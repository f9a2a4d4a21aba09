"""Every object as source of every other: what counts, and what is drawn."""

import numpy as np
import pypdfium2

from pipeline.report import sources
from pipeline.report.style import save

NAMES = ["mug", "jug", "wide_bowl"]


def _errors() -> dict[str, np.ndarray]:
    """Return matrices in which the source itself is ten times worse, which must not count."""
    return {
        key: 0.01 * (k + np.array([[90, 1, 2], [3, 90, 4], [5, 6, 90]]))
        for k, key in enumerate(sources.PANELS)
    }


def test_the_source_itself_does_not_count():
    found = sources.numbers(_errors(), NAMES)
    assert len(found) == 2 * len(NAMES) * len(sources.PANELS)
    assert np.isclose(found["sources.mug.radius.error_mean"], 0.015)
    assert np.isclose(found["sources.jug.radius.error_max"], 0.04)
    assert np.isclose(found["sources.wide_bowl.height.error_mean"], 0.065)


def test_the_page_has_every_error_in_its_unit_and_names_who_was_annotated(tmp_path):
    save(sources.draw(_errors(), NAMES, "mug", ["jug"]), tmp_path / "sources.pdf")
    save(sources.draw(_errors(), NAMES, "mug", ["jug"]), tmp_path / "again.pdf")
    assert (tmp_path / "sources.pdf").read_bytes() == (tmp_path / "again.pdf").read_bytes()
    document = pypdfium2.PdfDocument(tmp_path / "sources.pdf")
    words = document[0].get_textpage().get_text_range()
    document.close()
    assert "A human annotated the mug" in words
    assert "others (jug)" in words
    for title, *_ in sources.PANELS.values():
        assert title in words
    assert "90.0" in words  # the mug's own radius, framed
