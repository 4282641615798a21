"""The studio's page in a browser: in a notebook, with the texture of a file, and with a map for textures."""
# ruff: noqa: F811  (fixtures that are imported)

from __future__ import annotations

import functools
import http.server
import threading
from pathlib import Path

import numpy as np
import pytest
import shapes
from browsing import PATIENCE, need_browser
from gltf_scenes import coloured_ball
from studio_browsing import Studio, StudioVisit, open_page, sample, studio, visit  # noqa: F401

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
coneflat.redraw(); coneflat.drawStale();  // pixels can be read only in the task that draws them
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
    assert "strain " in page.inner_text("#title")
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

    # No cones are shown in any way.
    page.locator("#model").focus()
    page.keyboard.press("c")
    assert not visit.run("coneflat.state.get('cones')")
    assert page.is_hidden("#cones")
    assert "cone" not in page.inner_text("#title")

    page.select_option("#purpose", "angles")
    visit.settle()
    assert page.is_visible("#cones-by")
    assert page.is_visible("#cones")
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


def test_a_slider_leads_from_less_stretch_to_shorter_seams(visit, studio):
    page = visit.page
    page.select_option("#purpose", "texture")
    visit.settle()
    assert float(page.input_value("#energy")) == -1  # 4.1
    page.locator("#energy").focus()
    measures = []
    for key, energy in (("Home", "4.01"), ("End", "14")):
        page.keyboard.press(key)
        visit.settle()
        assert page.input_value("#max-energy") == energy
        assert studio.session.state()["choices"]["options"] == {"max_energy": float(energy)}
        rows = dict(row[:2] for row in visit.run("coneflat.model.head.rows"))
        measures.append((float(rows["energy"]), visit.run("coneflat.model.head.sizes.seams")))
    (low_energy, long_seams), (high_energy, short_seams) = measures
    assert 4 < low_energy <= 4.01
    assert low_energy < high_energy
    assert long_seams > short_seams
    page.fill("#max-energy", "4.4")
    page.keyboard.press("Enter")
    visit.settle()
    assert float(page.input_value("#energy")) == pytest.approx(np.log10(0.4), abs=0.026)


def test_six_cones_and_save_are_in_sight(open_page, tmp_path):
    mesh = tmp_path / "sample.obj"
    mesh.write_bytes(Path(coneflat.sample_path()).read_bytes())
    visit = open_page(mesh)
    visit.page.set_viewport_size({"width": 1200, "height": 800})
    rows = visit.page.locator("#cone-list .cone")
    top = visit.page.locator("#save").bounding_box()["y"]
    boxes = [rows.nth(index).bounding_box() for index in range(rows.count())]
    assert len(boxes) >= 6
    assert all(box["y"] + box["height"] <= top for box in boxes[:6])
    buttons = visit.page.locator("#exports button")
    for index in range(buttons.count()):
        box = buttons.nth(index).bounding_box()
        assert top <= box["y"]
        assert box["y"] + box["height"] <= 800


def test_angles_have_one_unit(visit):
    """Degrees, in the panel as in the text on a picked cone; the panel's tooltips have multiples of pi."""
    row = visit.run("studio.coneRows()[0]")
    visit.run(f"studio.find({row['vertex']})")
    told = visit.page.inner_text("#facts")
    assert f"cone angle {row['degrees']:.1f}°" in told
    assert "π" not in told
    field = visit.page.locator(f'#cone-list .cone[data-vertex="{row["vertex"]}"] input')
    assert f"{row['degrees'] / 180:.3f} π" in field.get_attribute("title")


MIDDLE_OF_CHART = """(() => {
  const {arrays} = coneflat.model, pane = coneflat.panes[1];
  const triangles = [...arrays.chart.keys()].filter((i) => arrays.chart[i] === arrays.chart[0]);
  const size = (i) => { const [p, q, r] = [0, 1, 2].map((k) => coneflat.model.flatPlace(arrays.faces[3 * i + k]));
    return Math.abs((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])); };
  const widest = triangles.reduce((one, other) => (size(other) > size(one) ? other : one));
  const places = [0, 1, 2].map((k) => coneflat.model.flatPlace(arrays.faces[3 * widest + k]));
  return pane.camera.project([0, 1, 2].map((k) => places.reduce((sum, place) => sum + place[k] / 3, 0))).slice(0, 2);
})()"""


def test_charts_are_moved_rotated_pinned_and_packed(visit, studio):
    page = visit.page
    assert page.is_hidden("#tool-chart")
    page.select_option("#purpose", "texture")
    visit.settle()
    page.select_option("#charts", "number")
    visit.settle()
    page.fill("#chart-number", "5")
    page.keyboard.press("Enter")
    visit.settle()
    first = visit.run("Array.from(coneflat.model.arrays.uv)")
    page.locator("#model").focus()
    page.keyboard.press("j")
    assert page.is_disabled("#chart-rotate")

    # A chart is dragged, and is pinned where it is dropped.
    box, (x, y) = visit.box("layout"), visit.run(MIDDLE_OF_CHART)
    page.mouse.move(box["x"] + x, box["y"] + y)
    page.mouse.down()
    page.mouse.move(box["x"] + x + 25, box["y"] + y + 10, steps=4)
    assert visit.run("studio.panel.charts.offset") is not None
    page.mouse.up()
    visit.settle()
    (pin,) = visit.choices()["charts"]["pins"]
    assert pin[1:3] == [1, 0]
    assert np.hypot(*pin[3:]) > 0.01
    assert page.get_attribute("#chart-pin", "aria-pressed") == "true"
    assert visit.run("Array.from(coneflat.model.arrays.uv)") != first
    assert visit.run("coneflat.model.head.places.filter((place) => place[6]).length") == 1

    # It is rotated about its middle, and the others are packed around it.
    page.click("#chart-rotate")
    visit.settle()
    (turned,) = visit.choices()["charts"]["pins"]
    np.testing.assert_allclose(turned[1:3], [0, 1], atol=1e-12)
    page.check("#chart-pack")
    visit.settle()
    assert "overlap none" in page.inner_text("#title")
    assert visit.choices()["charts"] == {"pins": [turned], "packed": True}
    assert studio.session.state()["trouble"] is None

    # It is freed, and everything is undone.
    page.click("#chart-pin")
    visit.settle()
    assert visit.choices()["charts"]["pins"] == []
    np.testing.assert_allclose(visit.run("Array.from(coneflat.model.arrays.uv)"), first, atol=1e-6)
    page.click("#undo")
    visit.settle()
    assert visit.choices()["charts"]["pins"] == [turned]
    page.click("#chart-free")
    visit.settle()
    assert "charts" not in visit.choices()
    page.select_option("#purpose", "angles")
    visit.settle()
    assert visit.run("studio.tools.mode") == "look"
    assert page.is_hidden("#charts-tools")
