"""The studio's page in a headless Chromium, and the session behind it."""

from __future__ import annotations

import threading
from contextlib import ExitStack
from pathlib import Path

import pytest
from browsing import PATIENCE, Visit

import coneflat

pytest.importorskip("uvicorn", reason="the extra studio is not installed")
pytest.importorskip("starlette", reason="the extra studio is not installed")

from coneflat.apps.studio.serve import HOST, open_listener
from coneflat.apps.studio.server import StudioServer
from coneflat.apps.studio.session import Session

TOKEN = "a-token-of-some-length"


class Studio:
    """A session, served."""

    def __init__(self, folder, **options):
        self.session = Session(folder, **options)
        listener = open_listener(0)
        port = listener.getsockname()[1]
        self.address = f"http://{HOST}:{port}/?token={TOKEN}"
        self.server = StudioServer(self.session, TOKEN, port)
        self.thread = threading.Thread(target=self.server.run, args=([listener],), daemon=True)
        self.thread.start()

    def close(self):
        self.server.should_exit = True
        self.thread.join(20)
        self.session.close()


class StudioVisit(Visit):
    """The studio's page; what it asks of its own server is no trouble."""

    def __init__(self, browser, studio, **options):
        class Address:
            def as_uri(self):
                return studio.address

        self.studio = studio
        super().__init__(browser, Address(), **options)

    def _request(self, route, address):
        if route.request.url.startswith(address.split("?")[0]):
            route.continue_()
        else:
            self.requests.append(route.request.url)
            route.abort()

    def settle(self):
        """Wait until the page shows what the session has come to."""
        self.wait("!studio.isBusy()")
        assert self.studio.session.wait_until_idle(60)
        version = self.studio.session.version
        self.wait(f"studio.news.version >= {version} && studio.news.layout === studio.layout")
        self.wait_until_drawn()

    def cones(self):
        return self.run("studio.coneRows().map((row) => row.vertex)")

    def choices(self):
        return self.run("studio.choices")

    def place_of(self, vertex):
        """Where a vertex of the user is on the screen, in the model's pane."""
        box = self.box("model")
        x, y = self.run(
            f"studio.overlay.places(coneflat.panes[0], studio.verticesOf([{vertex}])[0])[0].slice(0, 2)"
        )
        return box["x"] + x, box["y"] + y

    def visible_vertices(self, count):
        """Vertices in front, away from cones and seams, all over the model's pane."""
        return self.run(
            "(() => { const pane = coneflat.panes[0], found = [];"
            "for (let i = 2; i < 12; i++) for (let j = 2; j < 12; j++) {"
            "const [x, y] = [(i * pane.width) / 14, (j * pane.height) / 14];"
            "const thing = coneflat.renderer.pick(pane, x, y, coneflat.state);"
            "const vertex = thing?.kind === 'triangle' ? studio.tools.vertexAt(pane, x, y) : null;"
            "if (vertex !== null && !studio.isCone(vertex)) {"
            "const at = studio.overlay.places(pane, vertex)[0];"
            "if (studio.tools.vertexAt(pane, at[0], at[1]) === vertex &&"
            "coneflat.renderer.pick(pane, at[0], at[1], coneflat.state).kind === 'triangle')"
            "found.push(studio.numberOf(vertex)); } }"
            f"const step = Math.max(1, Math.floor(found.length / {count}));"
            f"return found.filter((one, i) => i % step === 0).slice(0, {count}); }})()"
        )


@pytest.fixture
def sample(tmp_path):
    path = tmp_path / "sample.obj"
    path.write_bytes(Path(coneflat.sample_path()).read_bytes())
    return path


@pytest.fixture
def studio(tmp_path, sample):
    served = Studio(tmp_path)
    served.session.open(sample)
    assert served.session.wait_until_idle(PATIENCE / 1000)
    yield served
    served.close()


@pytest.fixture
def visit(browser, studio):
    opened = StudioVisit(browser, studio)
    yield opened
    opened.close()


@pytest.fixture
def open_page(browser):
    """A function that serves a mesh in its folder, and returns its settled page; both are closed at the end."""
    with ExitStack() as stack:

        def opening(mesh, **options):
            served = Studio(mesh.parent, **options)
            stack.callback(served.close)
            served.session.open(mesh)
            assert served.session.wait_until_idle(PATIENCE / 1000)
            opened = StudioVisit(browser, served)
            stack.callback(opened.close)
            opened.settle()
            return opened

        yield opening
