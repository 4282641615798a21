"""The pictures of the viewer, taken in a Chromium."""

from __future__ import annotations

import os
import shutil
import tempfile
from io import BytesIO
from pathlib import Path

from palette import save_small
from PIL import Image
from playwright.sync_api import sync_playwright

import coneflat

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
WIDE, NARROW = {"width": 1366, "height": 768}, {"width": 390, "height": 844}
#: Name, size, theme, and what is done on the page first.
SHOTS = (
    (
        "viewer-light",
        WIDE,
        "light",
        "coneflat.find({kind: 'cone', index: 1}); coneflat.state.set({show: 'checker'})",
    ),
    ("viewer-dark", WIDE, "dark", "coneflat.state.set({show: 'qc', report: true})"),
    ("viewer-phone-light", NARROW, "light", "coneflat.state.set({show: 'picture'})"),
    ("viewer-phone-dark", NARROW, "dark", "coneflat.state.set({show: 'area'})"),
)


def browser_path() -> str | None:
    """Return where a Chromium is, or None."""
    return os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)


def take_screenshots(result: coneflat.Flattening) -> None:
    """Show a flattening in the viewer, in four ways."""
    arguments = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        page_path = result.view(Path(folder) / "page.html")
        browser = driver.chromium.launch(executable_path=browser_path(), args=arguments)
        for name, size, scheme, script in SHOTS:
            context = browser.new_context(viewport=size, color_scheme=scheme, reduced_motion="reduce")
            page = context.new_page()
            page.goto(page_path.as_uri())
            page.wait_for_selector("html[data-ready]")
            page.evaluate(script)
            page.wait_for_timeout(1500)  # Drawn finely once nothing moves.
            with Image.open(BytesIO(page.screenshot())) as picture:
                save_small(picture, name, dither=False)
            context.close()
        browser.close()
