"""Pictures of the studio: its page, the page on a phone, and an animated session."""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

from chromium import ARGUMENTS, browser_path
from palette import IMAGES, MAX_BYTES, save_small
from PIL import Image
from playwright.sync_api import sync_playwright
from screenshots import NARROW

from coneflat.apps.studio.serve import open_listener
from coneflat.apps.studio.server import StudioServer
from coneflat.apps.studio.session import Session

SIZE = {"width": 1000, "height": 560}
#: Layers to paint, and positions as fractions of the width and height of the pane.
PAINTED = (("importance", 0.3, 0.42), ("no_cone", 0.62, 0.62), ("no_seam", 0.47, 0.75))
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

SESSION_SIZE = {"width": 820, "height": 430}
SQUARES = 14  # of the checkerboard: fewer than usual, for a small file
#: An arrow for the mouse pointer, which is not part of screenshots.
ARROW = """
(() => {
  const arrow = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  arrow.innerHTML = '<path d="M1 1v17l4-4 3 7 3-1.3-3-7h6z" fill="#fff" stroke="#000" stroke-width="1.3"/>';
  Object.assign(arrow.style, {position: "fixed", width: "18px", height: "24px", zIndex: 99, pointerEvents: "none"});
  const follow = ({clientX, clientY}) => Object.assign(arrow.style, {left: `${clientX}px`, top: `${clientY}px`});
  document.addEventListener("pointermove", follow, {capture: true});
  document.body.append(arrow);
})()
"""
#: Parts of the pane's width and height: where a cone is set, the way that it is dragged, and the ends of a cut.
SET, WAY = (0.55, 0.64), ((0.51, 0.61), (0.47, 0.58), (0.43, 0.54), (0.39, 0.50))
CUT = ((0.30, 0.66), (0.62, 0.72))
QUICK, SLOW, LAST = 350, 900, 2200  # Milliseconds of a frame.
QUALITIES = (65, 50, 35)


class StudioPage(NamedTuple):
    """The studio's page in a browser, and the session behind it."""

    page: Any
    session: Session

    def settle(self) -> None:
        """Wait until the last action is shown at full resolution."""
        self.page.wait_for_timeout(150)
        self.session.wait_until_idle()
        self.page.wait_for_timeout(900)

    def picture(self) -> Image.Image:
        """Return a screenshot."""
        with Image.open(BytesIO(self.page.screenshot())) as picture:
            return picture.convert("RGB")


@contextmanager
def studio_page(mesh: Path, **context: Any) -> Iterator[StudioPage]:
    """Open a mesh in the studio; context: options of the browser context."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver, open_listener(0) as listener:
        session, port = Session(Path(folder)), listener.getsockname()[1]
        server = StudioServer(session, "token", port)
        serving = threading.Thread(target=server.run, args=([listener],))
        serving.start()
        session.open(mesh)
        browser = driver.chromium.launch(executable_path=browser_path(), args=ARGUMENTS)
        page = browser.new_context(color_scheme="light", reduced_motion="reduce", **context).new_page()
        page.goto(f"http://127.0.0.1:{port}/?token=token")
        session.wait_until_idle()
        page.wait_for_selector("html[data-ready]")
        page.wait_for_timeout(1000)
        yield StudioPage(page, session)
        browser.close()
        server.should_exit = True
        serving.join()


def take_studio(mesh: Path) -> None:
    """Show the studio at work on a mesh: a cone has an angle of the user's, and places are painted."""
    with studio_page(mesh, viewport=SIZE) as studio:
        studio.page.keyboard.press("a")
        _pick_and_paint(studio)
        save_small(studio.picture().quantize(128, kmeans=2).convert("RGB"), "studio", dither=False)


def take_phone(mesh: Path) -> None:
    """Show it on a telephone, with a cone that is picked."""
    with studio_page(mesh, viewport=NARROW, has_touch=True, is_mobile=True) as studio:
        _pick_and_paint(studio)
        studio.page.evaluate("studio.setTool('no_seam')")
        studio.settle()
        save_small(studio.picture(), "studio-phone", dither=False)


def _pick_and_paint(studio: StudioPage) -> None:
    page = studio.page
    page.evaluate(PICK_SEEN)
    page.evaluate("studio.setAngle(studio.selectedNumber(), 180)")
    studio.settle()
    for layer, right, down in PAINTED:
        page.evaluate(
            f"studio.setTool('{layer}');"
            "studio.brush.radius = Math.round(34 * Math.min(1, coneflat.panes[0].height / 400));"
            f"(({{width, height}}) => studio.brush.dab(coneflat.panes[0], {right} * width, {down} * height))"
            "(coneflat.panes[0]); studio.brush.at = null"
        )
        studio.settle()
    page.wait_for_timeout(1500)
    page.evaluate("studio.took = 0; studio.panel.work.show()")


def take_session(mesh: Path) -> None:
    """Show a session that moves: a cone is set, and dragged, and a seam is cut; each time the layout follows."""
    with studio_page(mesh, viewport=SESSION_SIZE) as studio:
        page, frames = studio.page, []
        box = page.locator("#model").bounding_box()
        page.evaluate(f"coneflat.state.set({{squares: {SQUARES}}})")
        page.evaluate(ARROW)

        def go(place: tuple[float, float]) -> None:
            page.mouse.move(box["x"] + place[0] * box["width"], box["y"] + place[1] * box["height"], steps=4)

        def shoot(milliseconds: int, settles: bool = True) -> None:
            if settles:
                studio.settle()
            page.evaluate("studio.took = 0; studio.panel.work.show(); coneflat.state.set({hovered: null})")
            page.wait_for_timeout(250)
            frames.append((studio.picture(), milliseconds))

        def press(selector: str) -> None:
            place = page.locator(selector).bounding_box()
            page.mouse.move(place["x"] + place["width"] / 2, place["y"] + place["height"] / 2, steps=3)
            page.click(selector)

        go((0.9, 0.9))
        shoot(SLOW)
        _tell(press, go, shoot, page)
        _save_moving(frames, "studio-session")


def _tell(press: Callable[..., None], go: Callable[..., None], shoot: Callable[..., None], page: Any) -> None:
    """Do what the session shows."""
    press("#tool-cone")
    shoot(QUICK)
    go(SET)
    shoot(QUICK, settles=False)
    page.mouse.down()
    page.mouse.up()
    shoot(SLOW)
    page.mouse.down()
    for place in WAY:
        go(place)
        shoot(QUICK)
    page.mouse.up()
    shoot(SLOW)
    press("#tool-cut")
    shoot(QUICK)
    go(CUT[0])
    page.mouse.down()
    page.mouse.up()
    shoot(QUICK, settles=False)
    go(CUT[1])
    shoot(QUICK, settles=False)
    page.mouse.down()
    page.mouse.up()
    page.evaluate("studio.tools.endLine(); coneflat.remark()")
    go((0.9, 0.9))
    shoot(LAST)


def _save_moving(frames: list[tuple[Image.Image, int]], name: str) -> None:
    """Write an animated picture with the best quality that is small enough."""
    path = IMAGES / f"{name}.webp"
    pictures, times = [picture for picture, _ in frames], [milliseconds for _, milliseconds in frames]
    for quality in QUALITIES:
        pictures[0].save(
            path, save_all=True, append_images=pictures[1:], duration=times, loop=0, quality=quality, method=6
        )
        if path.stat().st_size <= MAX_BYTES:
            break
    width, height = pictures[0].size
    print(
        f"{path.name}: {len(frames)} of {width} x {height}, {path.stat().st_size / 1000:.0f} KB at {quality}",
        flush=True,
    )
