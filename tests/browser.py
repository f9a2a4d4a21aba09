"""A real browser for tests: headless Chromium, and pages that note what they complain of and what they ask the network for."""

import os
import shutil
import tempfile
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# Graphics by software, as machines that test have no card; no sandbox for root, where Chromium cannot have one.
GRAPHICS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
AS_ROOT = ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []


@dataclass
class Opened:
    """A page; `complaints`: errors and warnings of its console, `requests`: addresses it asked for."""

    page: Any
    complaints: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)


@contextmanager
def opened(browser: Any, url: str, width: int = 1200, height: int = 800, **options: Any):
    """Open a page of a size in CSS pixels; options are those of a browser context, such as `color_scheme`."""
    context = browser.new_context(viewport={"width": width, "height": height}, **options)
    found = Opened(context.new_page())
    found.page.set_default_timeout(30_000)
    found.page.on("pageerror", lambda error: found.complaints.append(str(error)))
    found.page.on("request", lambda request: found.requests.append(request.url))

    def note(message: Any) -> None:
        # Reading back pixels stalls a graphics card, which Chromium says even where there is none.
        if message.type in ("error", "warning") and "GPU stall due to ReadPixels" not in message.text:
            found.complaints.append(message.text)

    found.page.on("console", note)
    try:
        found.page.goto(url)
        yield found
    finally:
        context.close()


@contextmanager
def chromium():
    """Start headless Chromium; the test is skipped where there is none."""
    path = next(filter(None, map(shutil.which, NAMES)), None)
    if path is None:
        pytest.skip("no Chromium on this machine (Debian: apt-get install chromium)")
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as profile, sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=path, args=[*GRAPHICS, *AS_ROOT], env={**os.environ, "XDG_CONFIG_HOME": profile}
        )
        yield browser
        browser.close()
