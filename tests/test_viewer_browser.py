"""The viewer's page in a browser: headless Chromium, skipped where there is none."""

from __future__ import annotations

import io
import os
import shutil

import numpy as np
import pytest
import shapes

import coneflat
from coneflat.view.content import content_of
from coneflat.view.webpage import SHOWS, notebook_html, page_of

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
ARGUMENTS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"]  # no graphics card is needed
WIDE, NARROW = {"width": 1366, "height": 768}, {"width": 390, "height": 844}
CELL = "1 / coneflat.state.get('squares') * coneflat.model.head.uv_side"


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    path = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)
    if path is None:
        pytest.skip("there is no Chromium here; CHROMIUM=/path/to/it says where it is")
    with playwright.sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=path, args=ARGUMENTS)
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def result():
    """Two charts, cones of both signs, a boundary."""
    hill = shapes.hill(10, 8)
    joined = shapes.join(shapes.torus(), (hill[0] + 1, hill[1]))
    return coneflat.flatten(*joined, distortion=0.2, charts="atlas")


@pytest.fixture(scope="module")
def written(result, tmp_path_factory):
    return result.view(tmp_path_factory.mktemp("page") / "page.html")


class Visit:
    """An open page, and what it complained of or asked for."""

    def __init__(self, browser, path, **options):
        self.troubles, self.requests = [], []
        self.context = browser.new_context(**{"viewport": WIDE, "color_scheme": "light", **options})
        self.page = self.context.new_page()
        self.page.on("console", lambda message: self.troubles.append(message.text))
        self.page.on("pageerror", lambda error: self.troubles.append(str(error)))
        self.page.route("**/*", lambda route: self._request(route, path.as_uri()))
        self.page.goto(path.as_uri())
        self.page.wait_for_selector("html[data-ready]", timeout=60_000)
        self.page.wait_for_function(
            "!window.coneflat || (!coneflat.moving && !coneflat.panes.some((pane) => pane.rough || pane.stale))"
        )

    def _request(self, route, own):
        if route.request.url == own:
            route.continue_()
        else:
            self.requests.append(route.request.url)
            route.abort()

    def run(self, script):
        return self.page.evaluate(script)

    def settle(self):
        """Wait until what was asked for is drawn: frames come one after the other."""
        self.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def box(self, pane):
        return self.page.locator(f"#{pane}").bounding_box()

    def picture(self, pane=None):
        """(h, w, 3) what the page, or a pane, looks like."""
        from PIL import Image

        self.settle()
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

    def close(self):
        self.context.close()
        assert self.troubles == []
        assert self.requests == []


@pytest.fixture
def visit(browser, written):
    opened = Visit(browser, written)
    yield opened
    opened.close()


def thing(kind, index):
    return f"{{kind: '{kind}', index: {index}}}"


@pytest.mark.parametrize("size", [WIDE, NARROW], ids=["wide", "narrow"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_both_views_are_drawn_and_everything_fits(browser, written, size, scheme):
    visit = Visit(browser, written, viewport=size, color_scheme=scheme)
    for pane in ("model", "layout"):
        assert 0.1 < visit.drawn_share(pane) < 0.95
        box = visit.box(pane)
        assert box["width"] * box["height"] > 0.25 * size["width"] * size["height"]
    assert visit.state("dark") == (scheme == "dark")
    assert (visit.picture("model")[3, -3] < 60).all() == (scheme == "dark")
    assert visit.run("document.documentElement.scrollWidth") <= size["width"]
    assert visit.run("[...document.querySelectorAll('button, select')].every((one) => {"
                     "const box = one.getBoundingClientRect(); return !box.width || (box.left >= 0 && "
                     "box.right <= innerWidth && box.bottom <= innerHeight); })")  # fmt: skip
    visit.close()


def test_the_browser_has_the_numbers_of_the_result(visit, result):
    content = content_of(result, 10**6)
    for name, values in (("qc", content.qc), ("area", content.area_scale), ("flat", content.flat_curvature)):
        there = np.array(visit.run(f"Array.from(coneflat.model.arrays.{name})"), dtype=float)
        np.testing.assert_allclose(there, values, rtol=1e-6, atol=1e-9)
    values = {"qc": content.qc, "area": content.area_scale, "curvature": content.curvature}
    for name, scale in content.scales.items():
        there = np.array(visit.run(f"Array.from(coneflat.model.tones('{name}'))"))
        expected = np.nan_to_num(scale.position(values.get(name, content.flat_curvature)), nan=-1)
        np.testing.assert_allclose(there, expected, atol=1e-5)


def test_pointing_finds_a_triangle_on_both_sides(visit, result):
    visit.run("coneflat.state.set({seams: false, cones: false})")  # which come before triangles
    for index in (0, 123, 777, len(result.faces) - 1):
        visit.page.mouse.move(*visit.at("layout", thing("triangle", index))[0])
        assert visit.state("hovered") == {"kind": "triangle", "index": index}
        assert f"Triangle {index:,}" in visit.page.inner_text("#facts")
        assert f"QC {result.distortion.qc[index]:.4f}" in visit.page.inner_text("#facts")
        for pane in ("model", "layout"):
            (x, y), box = visit.at(pane, thing("triangle", index))[0], visit.box(pane)
            if 0 < x - box["x"] < box["width"] and 0 < y - box["y"] < box["height"]:
                assert near(visit, pane, x, y)
    visit.page.mouse.move(5, 5)
    assert visit.state("hovered") is None


def near(visit, pane, x, y, reach=16):
    """Whether the accent colour of marks is seen near a place."""
    box = visit.box(pane)
    picture = visit.picture(pane)
    row, column = round(y - box["y"]), round(x - box["x"])
    part = picture[max(row - reach, 0) : row + reach, max(column - reach, 0) : column + reach]
    return (np.abs(part - [0xD6, 0x00, 0x6C]).max(axis=2) < 60).any()


def test_pointing_at_the_model_finds_what_is_in_front(visit, result):
    seen = 0
    for index in range(0, 1280, 40):
        place = visit.at("model", thing("triangle", index))[0]
        visit.page.mouse.move(*place)
        found = visit.state("hovered")
        facing = visit.run(
            f"coneflat.marks.isSeen(coneflat.panes[0], {thing('triangle', index)}, coneflat.state)"
        )
        if found == {"kind": "triangle", "index": index}:
            seen += 1
            assert facing
    assert seen > 8  # of 32, half of which face away


def test_a_seam_edge_and_its_two_sides(visit, result):
    count = visit.run("coneflat.model.seamCount")
    assert count > 5
    visit.run("coneflat.state.set({cones: false})")  # which come before seams
    for index in (0, count // 2, count - 1):
        sides = visit.at("layout", thing("seam", index))
        assert len(sides) == 2
        for place in sides:
            visit.page.mouse.move(*place)
            assert visit.state("hovered") == {"kind": "seam", "index": index}
            for x, y in sides:
                assert near(visit, "layout", x, y)
    text = visit.page.inner_text("#facts")
    assert "Seam edge" in text
    assert "equally long" in text
    corners = f"coneflat.model.outlineCorners({2 * (count - 1)})"
    ends = visit.run(f"{corners}.map((c) => coneflat.model.vertexNumber(coneflat.model.vertexAt(c)))")
    assert sorted(ends) in np.sort(result.seams, axis=1).tolist()


def test_a_click_keeps_a_cone_and_turns_the_model_to_it(visit, result):
    for index in range(len(result.cones)):
        visit.page.mouse.click(*visit.at("layout", thing("cone", index))[0])
        assert visit.state("picked") == {"kind": "cone", "index": index}
        visit.page.wait_for_timeout(500)
        assert visit.run(f"coneflat.marks.isSeen(coneflat.panes[0], {thing('cone', index)}, coneflat.state)")
        (x, y), box = visit.at("model", thing("cone", index))[0], visit.box("model")
        assert 0 < x - box["x"] < box["width"]
        assert 0 < y - box["y"] < box["height"]
        assert near(visit, "model", x, y)
        assert f"{abs(result.curvatures[index]) / np.pi:.3f} π" in visit.page.inner_text("#facts")
    visit.page.keyboard.press("Escape")
    assert visit.state("picked") is None


@pytest.mark.parametrize("name", ["seams", "cones", "edges"])
def test_toggles_change_both_views_and_back(visit, name):
    before = [visit.picture(pane) for pane in ("model", "layout")]
    was = visit.page.get_attribute(f"#{name}", "aria-pressed")
    visit.page.click(f"#{name}")
    visit.page.mouse.move(5, 5)
    assert visit.page.get_attribute(f"#{name}", "aria-pressed") != was
    for pane, picture in zip(("model", "layout"), before, strict=True):
        assert (visit.picture(pane) != picture).any()
    visit.page.click(f"#{name}")
    visit.page.mouse.move(5, 5)
    for pane, picture in zip(("model", "layout"), before, strict=True):
        np.testing.assert_array_equal(visit.picture(pane), picture)


def test_cones_are_red_and_black(visit, result):
    assert (result.curvatures > 0).any()
    assert (result.curvatures < 0).any()
    for index, curvature in enumerate(result.curvatures):
        (x, y), box = visit.at("layout", thing("cone", index))[0], visit.box("layout")
        colour = visit.picture("layout")[round(y - box["y"]), round(x - box["x"])]
        assert np.abs(colour - ([214, 33, 33] if curvature > 0 else [0, 0, 0])).max() < 12


def test_report_help_and_theme(visit, result):
    assert not visit.page.is_visible("#table")
    visit.page.click("#report")
    assert "seam mismatch" in visit.page.inner_text("#table")
    visit.settle()
    assert 0.1 < visit.drawn_share("layout") < 0.95  # it has made room
    visit.page.click("#report")
    visit.page.click("#help")
    assert visit.page.is_visible("#keys")
    assert "two fingers" in visit.page.inner_text("#keys")
    visit.page.click("#keys button")
    assert not visit.page.is_visible("#keys")
    visit.page.click("#theme")
    assert (visit.picture("layout")[-3, 3] < 60).all()


def test_everything_that_can_be_shown_looks_different(visit):
    seen = []
    for show in SHOWS:
        visit.page.select_option("#show", show)
        assert visit.state("show") == show
        has_scale = show in ("qc", "area", "curvature", "flat")
        assert visit.page.is_visible("#scale") == has_scale
        assert visit.page.is_visible("#file-label") == (show == "picture")
        seen.append(visit.picture("layout"))
        assert all((seen[-1] != other).any() for other in seen[:-1])
    visit.page.select_option("#show", "qc")
    assert visit.page.locator("#scale-ticks span").count() == 3
    visit.page.mouse.move(*visit.at("layout", thing("triangle", 200))[0])
    place = float(visit.page.get_attribute("#scale-mark", "style").split("left:")[1].split("%")[0]) / 100
    value = visit.run("coneflat.model.arrays.qc[200]")
    low, high = visit.run("[coneflat.model.head.scales.qc.low, coneflat.model.head.scales.qc.high]")
    assert place == pytest.approx(min((value - low) / (high - low), 1), abs=1e-3)


def colour_at(visit, u, v):
    """The colour that the layout has at a point of the plane."""
    x, y = visit.run(
        f"(({{camera}}, m) => camera.project([({u} - m.uvCentre[0]) * m.uvUnit, ({v} - m.uvCentre[1]) * m.uvUnit, 0]))"
        "(coneflat.panes[1], coneflat.model)"
    )[:2]
    return visit.picture("layout")[int(y), int(x)]


def inner_points(result, cell, count=12):
    """Middles of squares of the plane that lie well inside a triangle-covered part."""
    from coneflat.view.raster import rasterise

    flat = np.column_stack([1000 * result.uv, np.zeros(len(result.uv))])
    covered = rasterise(flat, result.uv_faces, 1000, 1000).covered
    steps = [slice(int(1000 * i * cell), int(1000 * (i + 1) * cell)) for i in range(int(1 / cell))]
    inside = [(i, j) for i, u in enumerate(steps) for j, v in enumerate(steps) if covered[v, u].all()]
    return [inside[k] for k in np.linspace(0, len(inside) - 1, count).astype(int)]


def test_squares_alternate_and_are_as_large_as_they_should_be(visit, result):
    visit.run("coneflat.state.set({squares: 12, seams: false, cones: false})")
    cell = visit.run(CELL)
    corners = result.corner_uv
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]).sum() / 2
    assert cell == pytest.approx(np.sqrt(area) / 12)
    for i, j in inner_points(result, cell):
        light = colour_at(visit, (i + 0.5) * cell, (j + 0.5) * cell)[0] > 200
        assert light == ((i + j) % 2 == 0)


def quarters(path):
    """A picture whose quarters are red, green (above), blue and white (below)."""
    from PIL import Image

    pixels = np.zeros((64, 64, 3), dtype=np.uint8)
    pixels[:32, :32], pixels[:32, 32:], pixels[32:, :32], pixels[32:, 32:] = (
        (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255),
    )  # fmt: skip
    Image.fromarray(pixels).save(path)
    return path


def expected_quarter(u, v):
    return {(0, 1): [255, 0, 0], (1, 1): [0, 255, 0], (0, 0): [0, 0, 255], (1, 0): [255, 255, 255]}[
        u > 0.5, v > 0.5
    ]


def test_a_picture_lies_upright(browser, result, tmp_path):
    path = result.view(tmp_path / "page.html", texture=quarters(tmp_path / "quarters.png"))
    visit = Visit(browser, path)
    visit.run("coneflat.state.set({seams: false, cones: false})")
    assert visit.state("show") == "picture"
    for i, j in inner_points(result, 0.07):
        u, v = 0.07 * (i + 0.5), 0.07 * (j + 0.5)
        if min(abs(u - 0.5), abs(v - 0.5)) > 0.05:
            assert np.abs(colour_at(visit, u, v) - expected_quarter(u, v)).max() < 8
    visit.close()


def test_a_picture_can_be_chosen_in_the_page(visit, result, tmp_path):
    visit.page.select_option("#show", "picture")
    before = visit.picture("layout")
    visit.page.set_input_files("#file", quarters(tmp_path / "quarters.png"))
    visit.page.wait_for_timeout(300)
    assert (visit.picture("layout") != before).any()
    i, j = inner_points(result, 0.07)[3]
    u, v = 0.07 * (i + 0.5), 0.07 * (j + 0.5)
    assert np.abs(colour_at(visit, u, v) - expected_quarter(u, v)).max() < 8
    (tmp_path / "no.png").write_text("no picture")
    visit.page.set_input_files("#file", tmp_path / "no.png")
    visit.page.wait_for_selector("#trouble:not([hidden])")
    assert "cannot show the picture" in visit.page.inner_text("#trouble")


def test_mouse_turns_moves_and_zooms(visit):
    for pane, turns in (("model", True), ("layout", False)):
        box = visit.box(pane)
        x, y = round(box["x"] + box["width"] / 2), round(box["y"] + box["height"] / 2)
        camera = f"coneflat.panes[{int(not turns)}].camera"
        turn, pan = visit.run(f"[{camera}.turn, {camera}.pan]")
        visit.page.mouse.move(x, y)
        visit.page.mouse.down()
        visit.page.mouse.move(x + 60, y + 30, steps=4)
        visit.page.mouse.up()
        assert (visit.run(f"{camera}.turn") != turn) == turns
        assert (visit.run(f"{camera}.pan") != pan) != turns
        rows = np.array(visit.run(f"{camera}.turn")).reshape(3, 3)
        np.testing.assert_allclose(rows @ rows.T, np.eye(3), atol=1e-12)
        # What is under the pointer stays there.
        back = f"[({x - 100} - {box['x']} - {camera}.width / 2) / {camera}.scale + {camera}.pan[0], {camera}.zoom]"
        visit.page.mouse.move(x - 100, y)
        place, zoom = visit.run(back)
        visit.page.mouse.wheel(0, -300)
        visit.page.wait_for_timeout(100)
        later, larger = visit.run(back)
        assert later == pytest.approx(place)
        assert larger > 1.3 * zoom
        visit.page.mouse.dblclick(x, y)
        assert visit.run(f"{camera}.zoom") == 1
    assert visit.state("hovered") is None or visit.state("picked") is not None


def test_keys_do_what_the_help_says(visit):
    press = visit.page.keyboard.press
    for key, name in (("s", "seams"), ("c", "cones"), ("t", "edges"), ("r", "report"), ("d", "dark")):
        was = visit.state(name)
        press(key)
        assert visit.state(name) is not was
    for number, show in enumerate(SHOWS, 1):
        press(str(number))
        assert visit.state("show") == show
    squares = visit.state("squares")
    press("]")
    assert visit.state("squares") > squares
    press("[")
    assert visit.state("squares") == pytest.approx(squares)
    visit.page.focus("#layout")
    camera = "coneflat.panes[1].camera"
    pan = visit.run(f"{camera}.pan")
    press("ArrowLeft")
    assert visit.run(f"{camera}.pan") != pan
    press("+")
    assert visit.run(f"{camera}.zoom") > 1
    press("0")
    assert (visit.run(f"{camera}.zoom"), visit.run(f"{camera}.pan")) == (1, pan)
    visit.page.focus("#model")
    turn = visit.run("coneflat.panes[0].camera.turn")
    press("ArrowUp")
    assert visit.run("coneflat.panes[0].camera.turn") != turn
    press("w")
    worst = visit.state("picked")["index"]
    qc = np.array(visit.run("Array.from(coneflat.model.arrays.qc)"))
    assert qc[worst] == np.nanmax(qc)
    press("Escape")
    press("?")
    assert visit.page.is_visible("#keys")
    press("Escape")
    assert not visit.page.is_visible("#keys")
    press("Enter")
    assert visit.state("picked") is None or visit.state("picked")["kind"] in ("triangle", "seam", "cone")


def test_fingers_turn_zoom_and_pick(browser, written):
    visit = Visit(browser, written, viewport=NARROW, has_touch=True, is_mobile=True)
    session = visit.context.new_cdp_session(visit.page)

    def touch(kind, *points):
        places = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(points)]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": places})

    box = visit.box("model")
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    turn = visit.run("coneflat.panes[0].camera.turn")
    touch("touchStart", (x, y))
    for step in range(1, 6):
        touch("touchMove", (x + 12 * step, y))
    touch("touchEnd")
    assert visit.run("coneflat.panes[0].camera.turn") != turn
    touch("touchStart", (x - 40, y), (x + 40, y))
    for step in range(1, 6):
        touch("touchMove", (x - 40 - 8 * step, y), (x + 40 + 8 * step, y))
    touch("touchEnd")
    assert visit.run("coneflat.panes[0].camera.zoom") == pytest.approx(2, rel=0.05)
    assert visit.state("picked") is None
    visit.page.touchscreen.tap(*visit.at("layout", thing("triangle", 500))[0])
    assert visit.state("picked") == {"kind": "triangle", "index": 500}
    visit.close()


def test_slow_machines_draw_roughly_while_something_moves(visit):
    visit.run("coneflat.slowFrames = 2")
    camera = "coneflat.panes[0].camera"
    visit.run(f"{camera}.rotate(0.3, 0.1)")
    visit.settle()
    assert visit.run("coneflat.panes.map((pane) => pane.rough)") == [True, False]
    visit.page.wait_for_timeout(500)
    assert visit.run("coneflat.panes.map((pane) => pane.rough)") == [False, False]
    fine = visit.picture("model")
    visit.run("coneflat.slowFrames = 0; coneflat.redraw()")
    np.testing.assert_array_equal(visit.picture("model"), fine)


def test_drawing_goes_on_after_the_graphics_card_was_lost(visit):
    before = visit.picture("model")
    visit.run("window.lost = coneflat.renderer.gl.getExtension('WEBGL_lose_context'); lost.loseContext()")
    visit.page.wait_for_timeout(200)
    visit.run("lost.restoreContext()")
    visit.page.wait_for_timeout(500)
    assert (np.abs(visit.picture("model") - before).max(axis=2) > 8).mean() < 0.001


def test_a_thinned_mesh_says_so(browser, result, tmp_path):
    visit = Visit(browser, result.view(tmp_path / "page.html", most_triangles=900))
    count = visit.run("coneflat.model.triangleCount")
    assert count <= 900
    words = f"drawn with {count:,} of {len(result.faces):,} triangles"
    assert words in visit.page.inner_text("#title")
    visit.page.click("#report")
    assert words.capitalize() in visit.page.inner_text("#table")
    assert visit.drawn_share("layout") > 0.1
    visit.close()


def test_a_hostile_name_is_shown_as_it_is(browser, result, tmp_path):
    name = "</script><img src=x onerror=alert(1)>.obj"
    path = tmp_path / "page.html"
    path.write_text(page_of(result, name=name), encoding="utf-8")
    visit = Visit(browser, path)
    assert visit.page.inner_text("#name") == name
    assert visit.page.title() == f"{name} – coneflat"
    visit.close()


def test_a_notebook_shows_it_in_a_frame(browser, result, tmp_path):
    path = tmp_path / "notebook.html"
    path.write_text(
        f"<!doctype html><html data-ready><body>{notebook_html(result)}</body></html>", encoding="utf-8"
    )
    visit = Visit(browser, path)
    frame = visit.page.frames[1]
    frame.wait_for_selector("html[data-ready]", timeout=60_000)
    assert frame.evaluate("coneflat.model.triangleCount") == len(result.faces)
    assert frame.evaluate("document.documentElement.scrollHeight <= innerHeight")
    visit.close()


def test_a_browser_without_webgl_says_so(browser, written):
    context = browser.new_context(viewport=WIDE)
    page = context.new_page()
    page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page.goto(written.as_uri())
    page.wait_for_selector("#trouble:not([hidden])")
    assert "WebGL 2" in page.inner_text("#trouble")
    context.close()
