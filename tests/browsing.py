"""The viewer's page in a headless Chromium; modules of tests that need it skip where there is none."""

from __future__ import annotations

import io
from importlib.util import find_spec

import numpy as np
import pytest
import shapes
from chromium import ARGUMENTS, browser_path

import coneflat

WIDE, NARROW = {"width": 1366, "height": 768}, {"width": 390, "height": 844}
SMALL = {"width": 1200, "height": 700}  # Drawn quickly without a graphics card.
PATIENCE = 60_000  # milliseconds, for a machine with much else to do

AT_REST = (
    "!coneflat.moving && !coneflat.scheduled && !coneflat.panes.some((pane) => pane.rough || pane.stale)"
)
RESET = """
document.querySelectorAll("dialog[open]").forEach((dialog) => dialog.close());
document.activeElement?.blur();
coneflat.state.set({
  show: coneflat.model.head.show, squares: coneflat.model.head.squares, seams: true, cones: true, edges: false,
  report: false, dark: false, up: coneflat.model.head.up, hovered: null, picked: null, fault: null,
});
coneflat.panes.forEach((pane) => pane.camera.fit());
"""


def need_browser():
    """Skip a module of tests where there is no browser."""
    if find_spec("playwright") is None:
        pytest.skip("playwright is not installed", allow_module_level=True)
    if browser_path() is None:
        missing = "there is no Chromium here; CHROMIUM=/path/to/it says where it is"
        pytest.skip(missing, allow_module_level=True)


@pytest.fixture(scope="module")
def browser():
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=browser_path(), args=ARGUMENTS)
        yield opened
        opened.close()


@pytest.fixture(scope="session")
def viewed():
    """A flattening with two charts, cones of both signs, a boundary."""
    hill = shapes.hill(10, 8)
    joined = shapes.join(shapes.torus(), (hill[0] + 1, hill[1]))
    return coneflat.flatten(*joined, distortion=0.2, charts="atlas")


@pytest.fixture(scope="session")
def viewed_page(viewed, tmp_path_factory):
    return viewed.view(tmp_path_factory.mktemp("page") / "page.html")


@pytest.fixture(scope="module")
def open_visit(browser, viewed_page):
    opened = Visit(browser, viewed_page)
    yield opened
    opened.close()


@pytest.fixture
def visit(open_visit):
    """The page of `viewed` as it is when it has just been opened; it is opened once for all."""
    open_visit.page.mouse.move(1, 1)
    open_visit.run(RESET)
    open_visit.wait_until_drawn()
    yield open_visit
    open_visit.check()


class Visit:
    """An open page, and what it complained of or asked for."""

    def __init__(self, browser, path, **options):
        self.troubles, self.requests = [], []
        # Movements that the page makes automatically are jumps, so that there is nothing to wait for.
        usual = {"viewport": SMALL, "color_scheme": "light", "reduced_motion": "reduce"}
        self.context = browser.new_context(**{**usual, **options})
        self.page = self.context.new_page()
        self.page.on("console", self._hear)
        self.page.on("pageerror", lambda error: self.troubles.append(str(error)))
        self.page.route("**/*", lambda route: self._request(route, path.as_uri()))
        self.page.goto(path.as_uri())
        self.page.wait_for_selector("html[data-ready]", timeout=PATIENCE)
        self.wait_until_drawn()

    def _hear(self, message):
        # Drivers may warn of slow readbacks, which is no fault of the page.
        if message.type == "error":
            self.troubles.append(message.text)

    def _request(self, route, address):
        if route.request.url == address:
            route.continue_()
        else:
            self.requests.append(route.request.url)
            route.abort()

    def run(self, script):
        return self.page.evaluate(script)

    def wait(self, condition):
        """Wait until an expression of the page is true; Playwright's own way needs `eval`, which the page forbids."""
        seen = self.run(
            f"new Promise((done) => {{ const end = performance.now() + {PATIENCE}; const look = () => ({condition}) ?"
            "done(true) : performance.now() > end ? done(false) : requestAnimationFrame(look); look(); })"
        )
        assert seen, f"it never came that {condition}"

    def wait_until_drawn(self):
        """Wait until everything is drawn finely; pages without a viewer have nothing to draw."""
        self.wait(f"!window.coneflat || ({AT_REST})")

    def box(self, pane):
        return self.page.locator(f"#{pane}").bounding_box()

    def picture(self, pane=None):
        """(h, w, 3) what the page, or a pane, looks like."""
        from PIL import Image

        self.wait_until_drawn()
        clip = {} if pane is None else {"clip": self.box(pane)}
        return np.asarray(Image.open(io.BytesIO(self.page.screenshot(**clip))).convert("RGB")).astype(int)

    def drawn_share(self, pane):
        """How much of a pane is not background, which its corners show."""
        picture = self.picture(pane)
        return (np.abs(picture - picture[-3, 3]).max(axis=2) > 12).mean()

    def at(self, pane, thing):
        """The places of a thing on the screen: of each part its middle."""
        box = self.box(pane)
        middles = self.run(
            f"(() => {{ const pane = coneflat.panes.find((one) => one.name === '{pane}');"
            f"return coneflat.model.shapeOf({thing}, pane.inPlane).map((ends) => {{"
            "const places = ends.map((end) => pane.camera.project(end));"
            "return [0, 1].map((k) => places.reduce((sum, p) => sum + p[k], 0) / places.length); }); })()"
        )
        return [(box["x"] + x, box["y"] + y) for x, y in middles]

    def state(self, name):
        return self.run(f"coneflat.state.get('{name}')")

    def check(self):
        """Nothing was complained of, and nothing asked for."""
        problems = [*self.troubles, *self.requests]
        self.troubles.clear()
        self.requests.clear()
        assert not problems, problems

    def close(self):
        self.context.close()
        self.check()


def thing(kind, index):
    return f"{{kind: '{kind}', index: {index}}}"
