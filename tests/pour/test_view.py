"""Looking at an object in a real browser."""

import json

from browser import opened
from pour.served import serving


def test_a_mug_is_shown_with_liquid_that_leaves_when_it_is_tilted(browser, project):
    with serving(project, "view", "mug") as (url, process), opened(browser, url, 700, 500) as tab:
        tab.page.wait_for_selector("#panel[data-shown=mug]")
        told = tab.page.locator(".readout")
        assert "Nothing is above the lip" in told.inner_text()
        tab.page.locator("input[name=tilt]").fill("80")
        tab.page.wait_for_function("document.querySelector('.readout').textContent.includes('pours')")
        assert tab.complaints == []
        process.send_signal(2)
        assert json.loads(process.communicate(timeout=20)[0]) == {"objects": ["mug"]}
    assert process.returncode == 0
