"""What the viewer's page shows, in a browser."""

from __future__ import annotations

import numpy as np
import pytest
from browsing import NARROW, WIDE, Visit, thing

from coneflat.options.outputs import SHOWS
from coneflat.view.page.content import content_of
from coneflat.view.page.webpage import notebook_html, page_of

CELL = "1 / coneflat.state.get('squares') * coneflat.model.head.uv_side"


def colour_at(visit, u, v):
    """The colour that the layout has at a point of the plane."""
    x, y = visit.run(
        f"(({{camera}}, m) => camera.project([({u} - m.uvCentre[0]) * m.uvUnit, ({v} - m.uvCentre[1]) * m.uvUnit, 0]))"
        "(coneflat.panes[1], coneflat.model)"
    )[:2]
    return visit.picture("layout")[int(y), int(x)]


def inner_points(viewed, cell, count=12):
    """Middles of squares of the plane that lie well inside a triangle-covered part."""
    from coneflat.view.figures.raster import rasterise

    flat = np.column_stack([1000 * viewed.uv, np.zeros(len(viewed.uv))])
    covered = rasterise(flat, viewed.uv_faces, 1000, 1000).covered
    steps = [slice(int(1000 * i * cell), int(1000 * (i + 1) * cell)) for i in range(int(1 / cell))]
    inside = [(i, j) for i, u in enumerate(steps) for j, v in enumerate(steps) if covered[v, u].all()]
    return [inside[k] for k in np.linspace(0, len(inside) - 1, count).astype(int)]


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


@pytest.mark.parametrize("size", [WIDE, NARROW], ids=["wide", "narrow"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_both_views_are_drawn_and_everything_fits(browser, viewed_page, size, scheme):
    visit = Visit(browser, viewed_page, viewport=size, color_scheme=scheme)
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


def test_the_browser_has_the_numbers_of_the_result(visit, viewed):
    content = content_of(viewed, 10**6)
    for name, values in (("qc", content.qc), ("area", content.area_scale), ("flat", content.flat_curvature)):
        there = np.array(visit.run(f"Array.from(coneflat.model.arrays.{name})"), dtype=float)
        np.testing.assert_allclose(there, values, rtol=1e-6, atol=1e-9)
    values = {"qc": content.qc, "area": content.area_scale, "curvature": content.curvature}
    for name, scale in content.scales.items():
        there = np.array(visit.run(f"Array.from(coneflat.model.tones('{name}'))"))
        expected = np.nan_to_num(scale.position(values.get(name, content.flat_curvature)), nan=-1)
        np.testing.assert_allclose(there, expected, atol=1e-5)


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


def test_cones_are_red_and_black(visit, viewed):
    assert (viewed.curvatures > 0).any()
    assert (viewed.curvatures < 0).any()
    for index, curvature in enumerate(viewed.curvatures):
        (x, y), box = visit.at("layout", thing("cone", index))[0], visit.box("layout")
        colour = visit.picture("layout")[round(y - box["y"]), round(x - box["x"])]
        assert np.abs(colour - ([214, 33, 33] if curvature > 0 else [0, 0, 0])).max() < 12


def test_report_help_and_theme(visit, viewed):
    assert not visit.page.is_visible("#table")
    visit.page.click("#report")
    assert "seam mismatch" in visit.page.inner_text("#table")
    assert 0.1 < visit.drawn_share("layout") < 0.95  # it has made room
    box, whole = visit.box("layout"), visit.picture()
    gap = whole[
        round(box["y"]) + 5 : round(box["y"] + box["height"]) - 5, round(box["x"]) - 6 : round(box["x"]) - 2
    ]
    assert np.ptp(gap.reshape(-1, 3), axis=0).max() == 0  # nothing is left of what was there
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
        assert not any(np.array_equal(seen[-1], other) for other in seen[:-1])
    visit.page.select_option("#show", "qc")
    assert visit.page.locator("#scale-ticks span").count() == 3
    visit.page.mouse.move(*visit.at("layout", thing("triangle", 200))[0])
    place = float(visit.page.get_attribute("#scale-mark", "style").split("left:")[1].split("%")[0]) / 100
    value = visit.run("coneflat.model.arrays.qc[200]")
    low, high = visit.run("[coneflat.model.head.scales.qc.low, coneflat.model.head.scales.qc.high]")
    assert place == pytest.approx(min((value - low) / (high - low), 1), abs=1e-3)


def test_squares_alternate_and_are_as_large_as_they_should_be(visit, viewed):
    visit.run("coneflat.state.set({squares: 12, seams: false, cones: false})")
    cell = visit.run(CELL)
    corners = viewed.corner_uv
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]).sum() / 2
    assert cell == pytest.approx(np.sqrt(area) / 12)
    for i, j in inner_points(viewed, cell):
        light = colour_at(visit, (i + 0.5) * cell, (j + 0.5) * cell)[0] > 200
        assert light == ((i + j) % 2 == 0)


def test_a_picture_lies_upright(browser, viewed, tmp_path):
    path = viewed.view(tmp_path / "page.html", texture=quarters(tmp_path / "quarters.png"))
    visit = Visit(browser, path)
    visit.run("coneflat.state.set({seams: false, cones: false})")
    assert visit.state("show") == "picture"
    for i, j in inner_points(viewed, 0.07):
        u, v = 0.07 * (i + 0.5), 0.07 * (j + 0.5)
        if min(abs(u - 0.5), abs(v - 0.5)) > 0.05:
            assert np.abs(colour_at(visit, u, v) - expected_quarter(u, v)).max() < 8
    visit.close()


def test_a_picture_can_be_chosen_in_the_page(browser, viewed_page, viewed, tmp_path):
    visit = Visit(browser, viewed_page)
    visit.page.select_option("#show", "picture")
    visit.rest()
    visit.page.set_input_files("#file", quarters(tmp_path / "quarters.png"))
    visit.wait("coneflat.renderer.look.picture instanceof ImageBitmap")
    i, j = inner_points(viewed, 0.07)[3]
    u, v = 0.07 * (i + 0.5), 0.07 * (j + 0.5)
    assert np.abs(colour_at(visit, u, v) - expected_quarter(u, v)).max() < 8
    (tmp_path / "no.png").write_text("no picture")
    visit.page.set_input_files("#file", tmp_path / "no.png")
    visit.page.wait_for_selector("#trouble:not([hidden])")
    assert "cannot show the picture" in visit.page.inner_text("#trouble")
    visit.close()


def test_drawing_goes_on_after_the_graphics_card_was_lost(browser, viewed_page):
    visit = Visit(browser, viewed_page)
    before = visit.picture("model")
    visit.run("window.lost = coneflat.renderer.gl.getExtension('WEBGL_lose_context'); lost.loseContext()")
    visit.wait("coneflat.renderer.gl.isContextLost()")
    visit.run(
        "new Promise((done) => { coneflat.renderer.canvas.addEventListener('webglcontextrestored', done);"
        "setTimeout(() => lost.restoreContext()); })"
    )
    assert (np.abs(visit.picture("model") - before).max(axis=2) > 8).mean() < 0.001
    visit.close()


def test_a_thinned_mesh_says_so(browser, viewed, tmp_path):
    visit = Visit(browser, viewed.view(tmp_path / "page.html", most_triangles=900))
    count = visit.run("coneflat.model.triangleCount")
    assert count <= 900
    words = f"drawn with {count:,} of {len(viewed.faces):,} triangles"
    assert words in visit.page.inner_text("#title")
    visit.page.click("#report")
    assert words.capitalize() in visit.page.inner_text("#table")
    assert visit.drawn_share("layout") > 0.1
    visit.close()


def test_a_hostile_name_is_shown_as_it_is(browser, viewed, tmp_path):
    name = "</script><img src=x onerror=alert(1)>.obj"
    path = tmp_path / "page.html"
    path.write_text(page_of(viewed, name=name), encoding="utf-8")
    visit = Visit(browser, path)
    assert visit.page.inner_text("#name") == name
    assert visit.page.title() == f"{name} – coneflat"
    visit.close()


def test_a_notebook_shows_it_in_a_frame(browser, viewed, tmp_path):
    path = tmp_path / "notebook.html"
    path.write_text(
        f"<!doctype html><html data-ready><body>{notebook_html(viewed)}</body></html>", encoding="utf-8"
    )
    visit = Visit(browser, path)
    frame = visit.page.frames[1]
    frame.wait_for_selector("html[data-ready]", timeout=60_000)
    assert frame.evaluate("coneflat.model.triangleCount") == len(viewed.faces)
    assert frame.evaluate("document.documentElement.scrollHeight <= innerHeight")
    visit.close()


def test_a_browser_without_webgl_says_so(browser, viewed_page):
    context = browser.new_context(viewport=WIDE)
    page = context.new_page()
    page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page.goto(viewed_page.as_uri())
    page.wait_for_selector("#trouble:not([hidden])")
    assert "WebGL 2" in page.inner_text("#trouble")
    context.close()
