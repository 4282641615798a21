"""The pictures of the viewer and of the studio, taken in a Chromium."""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from chromium import ARGUMENTS, browser_path
from palette import save_small
from PIL import Image
from playwright.sync_api import sync_playwright

import coneflat
from coneflat.apps.studio.serve import listening
from coneflat.apps.studio.server import StudioServer
from coneflat.apps.studio.session import Session
from coneflat.view.page.quads import page_of_quads
from coneflat.view.page.webpage import write_page

WIDE, NARROW = {"width": 1366, "height": 768}, {"width": 390, "height": 844}
STUDIO_SIZE = {"width": 1000, "height": 560}
#: The highest of the cones in front is picked.
PICK_SEEN = """
(() => {
  const pane = coneflat.panes[0], {cones} = coneflat.model.arrays;
  const place = (vertex) => pane.camera.project(coneflat.model.place(vertex));
  const seen = Array.from(cones, (vertex, index) => ({kind: "cone", index, at: place(vertex)})).filter(
    (thing) => coneflat.marks.isSeen(pane, thing, coneflat.state));
  seen.sort((one, other) => one.at[1] - other.at[1]);
  coneflat.state.set({picked: {kind: "cone", index: seen[0].index}});
})()
"""
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
SHOTS_OF_QUADS = (("viewer-quads", {"width": 1100, "height": 620}, "light", "null"),)


#: What is painted in the picture of the studio, and where: parts of the pane's width and height.
PAINTED = (("importance", 0.3, 0.42), ("no_cone", 0.62, 0.62), ("no_seam", 0.47, 0.75))


def take_screenshots(result: coneflat.Flattening) -> None:
    """Show a flattening in the viewer, in four ways."""
    with tempfile.TemporaryDirectory() as folder:
        _take(result.view(Path(folder) / "page.html"), SHOTS)


def take_screenshot_of_quads(quads: coneflat.QuadMesh, name: str) -> None:
    """Show quads in the viewer; name: of the model."""
    with tempfile.TemporaryDirectory() as folder:
        _take(write_page(page_of_quads(quads, name=name), Path(folder) / "page.html"), SHOTS_OF_QUADS)


def take_screenshot_of_studio(mesh: Path) -> None:
    """Show the studio at work on a mesh: a cone has an angle of the user's, and places are painted."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver, listening(0) as listener:
        session, port = Session(Path(folder)), listener.getsockname()[1]
        server = StudioServer(session, "token", port)
        serving = threading.Thread(target=server.run, args=([listener],))
        serving.start()
        session.open(mesh)
        browser = driver.chromium.launch(executable_path=browser_path(), args=ARGUMENTS)
        context = browser.new_context(viewport=STUDIO_SIZE, color_scheme="light", reduced_motion="reduce")
        page = context.new_page()
        page.goto(f"http://127.0.0.1:{port}/?token=token")
        session.wait_until_idle()
        page.wait_for_selector("html[data-ready]")
        page.wait_for_timeout(1000)
        page.keyboard.press("a")
        page.evaluate(PICK_SEEN)
        page.evaluate("studio.setAngle(studio.selectedNumber(), 180)")
        page.wait_for_timeout(500)
        session.wait_until_idle()
        page.wait_for_timeout(500)
        for layer, right, down in PAINTED:
            page.evaluate(
                f"studio.setTool('{layer}'); studio.brush.radius = 34;"
                f"(({{width, height}}) => studio.brush.dab(coneflat.panes[0], {right} * width, {down} * height))"
                "(coneflat.panes[0]); studio.brush.at = null"
            )
            page.wait_for_timeout(300)
            session.wait_until_idle()
        page.wait_for_timeout(2500)  # Drawn finely once nothing moves.
        page.evaluate("studio.took = 0; studio.panel.showWork()")
        with Image.open(BytesIO(page.screenshot())) as picture:
            save_small(picture.convert("RGB").quantize(128, kmeans=2).convert("RGB"), "studio", dither=False)
        browser.close()
        server.should_exit = True
        serving.join()


def _take(page_path: Path, shots: Sequence[tuple[str, Any, Any, str]]) -> None:
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=browser_path(), args=ARGUMENTS)
        for name, size, scheme, script in shots:
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
