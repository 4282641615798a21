"""The studio's page in a browser: in a notebook, with the texture of a file, and with a map for textures."""
# ruff: noqa: F811  (fixtures that are imported)

from __future__ import annotations

import functools
import http.server
import threading

import numpy as np
import pytest
import shapes
from browsing import PATIENCE, need_browser
from gltf_scenes import coloured_ball
from studio_browsing import Studio, StudioVisit, sample, studio, visit  # noqa: F401

import coneflat

need_browser()


@pytest.fixture
def page():
    with coneflat.studio(*shapes.sphere(3)) as opened:
        yield opened


def test_a_frame_of_a_notebook_shows_it_and_of_no_other_page(browser, page, tmp_path):
    assert page.result is not None
    (tmp_path / "index.html").write_text(page._repr_html_())
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=str(tmp_path))
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    context = browser.new_context(viewport={"width": 1200, "height": 760}, reduced_motion="reduce")
    try:
        for place in (f"http://localhost:{server.server_port}/", "http://elsewhere.example/"):
            outer = context.new_page()
            if "elsewhere" in place:
                # A page of the web, played by the browser.
                outer.route(
                    place, lambda route: route.fulfill(body=page._repr_html_(), content_type="text/html")
                )
            outer.goto(place)
            if "elsewhere" in place:
                assert outer.frames[-1].url.startswith("chrome-error:")
                continue
            frame = outer.frame_locator("iframe")
            frame.locator("html[data-settled='true']").wait_for(state="attached", timeout=PATIENCE)
            assert "1,280 triangles" in frame.locator("#title").inner_text()
            # What is done there is chosen here, and the other way round.
            frame.locator("#charts").select_option("one")
            frame.locator("#undo:not([disabled])").wait_for(timeout=PATIENCE)
            assert page.choices["options"] == {"charts": "one"}
            page.choices = {"options": {"cone_count": 7}}
            frame.locator("#cones-by >> option[value=cone_count]:checked").wait_for(
                state="attached", timeout=PATIENCE
            )
    finally:
        context.close()
        server.shutdown()
        server.server_close()


#: The pixel of a pane, as bytes, at the middle of a triangle that is nearest to a place.
PIXELS = """
(() => { const {renderer, panes, model} = coneflat, {canvas, gl} = renderer, out = [];
const bytes = new Uint8Array(4 * canvas.width * canvas.height);
gl.bindFramebuffer(gl.FRAMEBUFFER, null);
gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
for (const pane of panes) for (let i = 0; i < model.triangleCount; i += 7) {
const [middle] = model.shapeOf({kind: "triangle", index: i}, pane.inPlane);
const place = [0, 1, 2].map((k) => (middle[0][k] + middle[1][k] + middle[2][k]) / 3);
const [x, y] = pane.camera.project(place), thing = renderer.pick(pane, x, y, coneflat.state);
if (thing?.kind !== "triangle" || thing.index !== i) continue;
const column = Math.floor((pane.left + x) * renderer.pixel);
const row = canvas.height - 1 - Math.floor((pane.top + y) * renderer.pixel);
const at = 4 * (row * canvas.width + column), centre = model.place(model.vertexAt(3 * i))[0];
out.push([pane.name, centre, bytes[at], bytes[at + 1], bytes[at + 2]]); }
return out; })()
"""


def test_the_texture_of_the_file_is_shown_in_both_views(browser, tmp_path):
    path = tmp_path / "ball.glb"
    path.write_bytes(coloured_ball())
    served = Studio(tmp_path)
    try:
        served.session.open(path)
        visit = StudioVisit(browser, served)
        try:
            visit.settle()
            visit.wait("coneflat.renderer.look.asInFile === true")
            visit.run("coneflat.state.set({show: 'picture', seams: false, cones: false})")
            visit.wait_until_drawn()
            pixels = visit.run(PIXELS)
            left = [pixel for pixel in pixels if pixel[0] == "layout"]
            assert {pixel[0] for pixel in pixels} == {"model", "layout"}
            assert len(left) > 50
            is_red, is_green = (
                np.array([pixel[2 + k] > 100 + pixel[3 - k] for pixel in pixels]) for k in (0, 1)
            )
            assert is_red.sum() > 30
            assert is_green.sum() > 30
            side = np.array([pixel[1] for pixel in pixels])
            assert side[is_red].min() > side[is_green].max() - 0.4
            # An image of the user is in the UVs of the layout again.
            visit.run("coneflat.renderer.setPicture(coneflat.renderer.look.picture)")
            assert visit.run("coneflat.renderer.look.asInFile") is False
        finally:
            visit.close()
    finally:
        served.close()


HIDDEN = (
    "#tool-cone",
    "#tool-corner",
    "#tool-no_cone",
    "#tool-importance",
    "#cones-by",
    "#stretch",
    "#boundary",
)


def test_the_page_switches_between_the_maps(visit, studio):
    visit.settle()
    page, cones = visit.page, visit.cones()
    page.keyboard.press("a")
    assert page.is_hidden("#max-energy")
    page.select_option("#purpose", "texture")
    visit.settle()
    assert [name for name in HIDDEN if page.is_visible(name)] == []
    assert page.input_value("#max-energy") == "4.1"
    assert "energy 4.0" in page.inner_text("#title")
    assert visit.cones() == []
    assert visit.run("[studio.tools.mode, coneflat.state.get('cones')]") == ["look", False]

    # Keys of cones have no effect, and those of seams have.
    page.locator("#model").focus()
    for key in ("a", "p", "n", "m", "l", "q", "Delete"):
        page.keyboard.press(key)
    visit.settle()
    assert visit.run("[studio.tools.mode, studio.news.undo, studio.refused]") == ["look", 1, None]
    page.keyboard.press("x")
    assert visit.run("studio.tools.mode") == "cut"

    page.fill("#max-energy", "4")
    page.keyboard.press("Enter")
    visit.wait("studio.refused")
    visit.troubles.clear()  # The browser reports the refused request.
    assert (
        page.inner_text("#refusal-text")
        == "“Energy at most” must be above 4, the energy of an isometry, got 4."
    )
    page.fill("#max-energy", "4.4")
    page.keyboard.press("Enter")
    visit.settle()
    assert page.text_content("#command") == "coneflat unwrap sample.obj --max-energy 4.4"
    assert studio.session.state()["choices"]["options"] == {"max_energy": 4.4}

    page.select_option("#purpose", "angles")
    visit.settle()
    assert page.is_visible("#cones-by")
    assert visit.cones() == cones
    assert visit.run("coneflat.state.get('cones')")


def test_less_common_options_are_set_by_the_page(visit):
    page = visit.page
    visit.settle()
    page.click("#more summary")
    assert page.is_hidden("#more-area")
    page.fill("#more-quantise", "90")
    page.keyboard.press("Enter")
    visit.settle()
    assert "--quantise 1.57079" in page.text_content("#command")
    page.fill("#more-quantise", "")
    page.keyboard.press("Enter")
    page.select_option("#purpose", "texture")
    visit.settle()
    assert page.is_hidden("#more-quantise")
    assert page.is_hidden("#chart-number")
    page.fill("#more-area", "0.3")
    page.keyboard.press("Enter")
    page.select_option("#more-up", "-z")
    page.select_option("#charts", "number")
    page.fill("#chart-number", "5")
    page.keyboard.press("Enter")
    visit.settle()
    assert page.text_content("#command") == (
        "coneflat unwrap sample.obj --area 0.3 --up 0.0,0.0,-1.0 --charts 5"
    )
    assert [page.input_value(f"#{name}") for name in ("more-up", "more-area", "charts")] == [
        "-z",
        "0.3",
        "number",
    ]
    assert "5 charts" in page.inner_text("#title")
    assert page.input_value("#max-energy") == ""
    page.click("#no-more")
    visit.wait("studio.refused")
    visit.troubles.clear()  # The browser reports the refused request.
    assert "“Seams” none and “Area distortion at most” cannot be combined" in page.inner_text("#refusal-text")
    assert not page.is_checked("#no-more")
    page.fill("#more-area", "")
    page.keyboard.press("Enter")
    page.select_option("#charts", "atlas")
    visit.settle()
    page.check("#no-more")
    visit.settle()
    assert "--seams none" in page.text_content("#command")
    page.select_option("#purpose", "angles")
    visit.settle()
    assert page.text_content("#command") == "coneflat flatten sample.obj --up 0.0,0.0,-1.0"
