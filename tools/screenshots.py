"""Screenshots of the viewer in Chromium."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from chromium import ARGUMENTS, browser_path
from palette import save_small
from PIL import Image
from playwright.sync_api import sync_playwright

import coneflat
from coneflat.apps.view import write_page
from coneflat.apps.view.quad_page import page_of_quads

WIDE, NARROW = {"width": 1366, "height": 768}, {"width": 390, "height": 844}
#: Name, size, theme, and actions on the page before the screenshot.
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
SHOTS_OF_QUADS = (("viewer-quads", {"width": 1100, "height": 620}, "light", "null"),)


def take_screenshots(result: coneflat.Flattening) -> None:
    """Show a flattening in the viewer, in four ways."""
    with tempfile.TemporaryDirectory() as folder:
        _take(result.view(Path(folder) / "page.html"), SHOTS)


def take_screenshot_of_quads(quads: coneflat.QuadMesh, name: str) -> None:
    """Show quads in the viewer; name: of the model."""
    with tempfile.TemporaryDirectory() as folder:
        _take(write_page(page_of_quads(quads, name=name), Path(folder) / "page.html"), SHOTS_OF_QUADS)


def _take(page_path: Path, shots: Sequence[tuple[str, Any, Any, str]]) -> None:
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=browser_path(), args=ARGUMENTS)
        for name, size, scheme, script in shots:
            context = browser.new_context(viewport=size, color_scheme=scheme, reduced_motion="reduce")
            page = context.new_page()
            page.goto(page_path.as_uri())
            page.wait_for_selector("html[data-ready]")
            page.evaluate(script)
            page.wait_for_timeout(1500)  # The page is drawn at full resolution when nothing moves.
            with Image.open(BytesIO(page.screenshot())) as picture:
                save_small(picture, name, dither=False)
            context.close()
        browser.close()
