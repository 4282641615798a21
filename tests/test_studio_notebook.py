"""The studio from Python: its page in a frame of another page, as notebooks have it, its choices and its result."""

from __future__ import annotations

import http.client
import http.server
import threading
import urllib.request
from contextlib import contextmanager

import numpy as np
import pytest
import shapes
from browsing import PATIENCE

import coneflat
from coneflat.errors import ArrayShapeError, MeshFileError, OptionError, StudioError

pytest.importorskip("uvicorn", reason="the extra studio is not installed")
pytest.importorskip("starlette", reason="the extra studio is not installed")


@pytest.fixture
def page():
    with coneflat.studio(*shapes.sphere(3)) as opened:
        yield opened


def test_arrays_are_flattened_as_they_are(page):
    whole = coneflat.flatten(*shapes.sphere(3), repair=False)
    np.testing.assert_array_equal(page.result.vertices, whole.vertices)
    np.testing.assert_array_equal(page.result.uv, whole.uv)
    assert page.project.name == "mesh_studio.json"
    assert page.project.exists()


def test_choices_are_set_and_read(page):
    assert page.choices["options"] == {}
    page.choices = {"options": {"cone_count": 9}, "paint": {"no_cone": "0-80"}}
    result = page.result
    assert len(result.cones) == 9
    assert (result.cones > 80).all()
    assert page.choices["paint"] == {"no_cone": "0-80"}
    again = coneflat.flatten(*shapes.sphere(3), cone_count=9, forbidden_cones=range(81))
    np.testing.assert_array_equal(result.uv, again.uv)
    page.choices = {**page.choices, "options": {"stretch": 0.5}}
    assert page.choices["options"] == {"stretch": 0.5}
    for bad, message in (
        ({"options": {"stretch": 7}}, "from 0 to 1"),
        ({"cuts": 5}, "these are no choices"),
        ({"paint": {"glue": "1"}}, "nothing is painted as 'glue'"),
    ):
        with pytest.raises((StudioError, OptionError), match=message):
            page.choices = bad
    assert page.choices["options"] == {"stretch": 0.5}
    page.choices = {"cuts": [[0, 641]]}
    with pytest.raises(StudioError, match="no edge connects"):
        assert page.result


def test_files_and_projects(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shapes.write_obj(tmp_path / "ball.obj", *shapes.sphere(2))
    with coneflat.studio("ball.obj") as first:
        first.choices = {"options": {"charts": "one"}}
        uv = first.result.uv
        assert first.project == tmp_path / "ball_studio.json"
    with coneflat.studio(tmp_path / "ball_studio.json") as second:
        np.testing.assert_array_equal(second.result.uv, uv)
    with coneflat.studio(*shapes.sphere(2), folder=tmp_path) as third:
        assert third.project == tmp_path / "mesh_studio.json"
    assert third.project.exists()
    with pytest.raises(MeshFileError, match="cannot read"):
        coneflat.studio("nowhere.obj")
    with pytest.raises(ArrayShapeError, match="must have the shape"):
        coneflat.studio(np.zeros((3, 2)), np.array([[0, 1, 2]]))
    with pytest.raises(ArrayShapeError, match="whole numbers"):
        coneflat.studio(np.zeros((3, 3)), np.zeros((1, 3)))


def test_what_it_made_goes_with_it():
    opened = coneflat.studio(shapes.sphere(1))
    folder, process = opened.project.parent, opened._session.worker_process
    assert folder.exists()
    opened.close()
    assert not folder.exists()
    assert process is not None
    assert opened._session.worker_process is None


@contextmanager
def notebook(content, host):
    """Serve a page that has something in it, as a notebook's server does."""

    class Page(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.send_header("content-type", "text/html")
            self.end_headers()
            self.wfile.write(f"<!doctype html><title>notebook</title>{content}".encode())

        def log_message(self, *words):
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Page)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://{host}:{server.server_port}/"
    server.shutdown()
    server.server_close()


def test_a_frame_of_a_notebook_shows_it(browser, page):
    assert page.result is not None
    context = browser.new_context(viewport={"width": 1200, "height": 760}, reduced_motion="reduce")
    try:
        with notebook(page._repr_html_(), "localhost") as address:
            outer = context.new_page()
            outer.goto(address)
            frame = outer.frame_locator("iframe")
            frame.locator("html[data-settled='true']").wait_for(state="attached", timeout=PATIENCE)
            assert "640 triangles" not in frame.locator("#title").inner_text()
            before = frame.locator("#title").inner_text()
            assert "1,280 triangles" in before
            # What is done there is chosen here.
            frame.locator("#charts").select_option("one")
            frame.locator("#undo:not([disabled])").wait_for(timeout=PATIENCE)
            assert page.choices["options"] == {"charts": "one"}
    finally:
        context.close()


@contextmanager
def proxy():
    """Serve ports of this machine under /proxy/, as jupyter-server-proxy does, and a page with a frame of one at /."""
    content = ""

    class Proxy(http.server.BaseHTTPRequestHandler):
        def pass_on(self):
            if self.path == "/":
                status, headers, body = (
                    200,
                    {"content-type": "text/html"},
                    f"<!doctype html>{content}".encode(),
                )
            else:
                port, _, path = self.path.removeprefix("/proxy/").partition("/")
                size = int(self.headers.get("content-length") or 0)
                there = http.client.HTTPConnection("127.0.0.1", int(port), timeout=60)
                # Headers go on as they are, the host's and the origin's among them.
                there.request(self.command, f"/{path}", self.rfile.read(size) or None, dict(self.headers))
                answer = there.getresponse()
                status, headers, body = answer.status, dict(answer.getheaders()), answer.read()
                there.close()
            self.send_response(status)
            for name, value in headers.items():
                if name.lower() not in (
                    "content-length",
                    "transfer-encoding",
                    "connection",
                    "date",
                    "server",
                ):
                    self.send_header(name, value)
            self.send_header("content-length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        do_GET = do_POST = pass_on

        def log_message(self, *words):
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Proxy)
    server.daemon_threads = True

    def show(frame):
        nonlocal content
        content = frame
        return f"http://localhost:{server.server_port}/"

    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield show
    server.shutdown()
    server.server_close()


def test_a_proxy_shows_it(browser):
    context = browser.new_context(viewport={"width": 1200, "height": 760}, reduced_motion="reduce")
    with proxy() as show, coneflat.studio(*shapes.sphere(3), through="/proxy/{port}/") as opened:
        assert opened.address.startswith("/proxy/")
        outer = context.new_page()
        outer.goto(show(opened._repr_html_()))
        frame = outer.frame_locator("iframe")
        frame.locator("html[data-settled='true']").wait_for(state="attached", timeout=PATIENCE)
        frame.locator("#charts").select_option("one")
        frame.locator("#undo:not([disabled])").wait_for(timeout=PATIENCE)
        assert opened.choices["options"] == {"charts": "one"}
        # What is set here is shown there.
        opened.choices = {"options": {"cone_count": 7}}
        frame.locator("#cones-by >> option[value=cone_count]:checked").wait_for(
            state="attached", timeout=PATIENCE
        )
        assert frame.locator("#cone-count").input_value() == "7"
        assert frame.locator("#charts").input_value() == "atlas"
        # Without the token nobody gets in, by this way either.
        bare = show("").rstrip("/") + opened.address.split("?")[0]
        for query in ("", "?token=wrong"):
            assert outer.request.get(f"{bare}{query}").status == 403
    context.close()
    for bad in ("", "/proxy/", "https://hub/user/me/proxy/8000/"):
        with pytest.raises(OptionError, match="an address with the port in it"):
            coneflat.studio(*shapes.sphere(1), through=bad)


def test_no_other_page_frames_it(browser, page):
    context = browser.new_context()
    try:
        outer = context.new_page()
        # A page of the web, played by the browser.
        outer.route("http://elsewhere.example/", lambda route: route.fulfill(
            body=page._repr_html_(), content_type="text/html"
        ))  # fmt: skip
        outer.goto("http://elsewhere.example/")
        inner = outer.frames[-1]
        assert inner is not outer.main_frame
        assert inner.url.startswith("chrome-error:")
        assert inner.locator("#studio").count() == 0
    finally:
        context.close()


def test_the_command_s_page_is_in_no_frame(page):
    with urllib.request.urlopen(page.address) as answer:
        assert "frame-ancestors http://localhost:*" in answer.headers["content-security-policy"]
        assert answer.headers["x-frame-options"] is None
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.urlopen(page.address.split("?")[0])
