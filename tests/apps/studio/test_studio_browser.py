"""Whole stories of the studio in a browser: by mouse, keys and fingers."""
# ruff: noqa: F811  (fixtures that are imported)

from __future__ import annotations

import json
from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
import shapes
from browsing import NARROW, need_browser
from click.testing import CliRunner
from studio_browsing import (  # noqa: F401
    Studio,
    StudioVisit,
    open_page,
    sample,
    studio,
    visit,
)

import coneflat
from coneflat.apps.cli.main import cli
from coneflat.apps.studio.paint import Region

need_browser()


def test_a_whole_story(visit, studio, tmp_path, browser):
    page = visit.page
    visit.settle()
    first, title, cones = visit.choices(), page.inner_text("#title"), visit.cones()

    # A cone more, which is dragged; the model does not turn.
    page.keyboard.press("a")
    vertex, target, *apart = visit.visible_vertices(40)
    page.mouse.click(*visit.place_of(vertex))
    visit.settle()
    assert set(visit.cones()) == {*cones, vertex}
    assert visit.run("studio.selectedNumber()") == vertex
    turn = visit.run("coneflat.panes[0].camera.turn.join()")
    page.mouse.move(*visit.place_of(vertex))
    page.mouse.down()
    page.mouse.move(*visit.place_of(target), steps=4)
    page.mouse.up()
    visit.settle()
    assert set(visit.cones()) == {*cones, target}
    assert visit.run("coneflat.panes[0].camera.turn.join()") == turn

    # Its angle is typed, and snaps.
    page.select_option("#snap", "45")
    page.keyboard.press("g")
    page.keyboard.type("260")
    page.keyboard.press("Enter")
    visit.settle()
    row = visit.run(f"studio.coneRows().find((row) => row.vertex === {target})")
    assert (row["degrees"], row["chosen"]) == (pytest.approx(270), True)
    report = page.inner_text("#title")

    # Everything is undone, and done again.
    page.keyboard.press("Escape")
    page.locator("#model").focus()
    for _ in range(3):
        page.keyboard.press("Control+z")
    visit.settle()
    assert (visit.choices(), page.inner_text("#title")) == (first, title)
    assert page.locator("#undo").is_disabled()
    for _ in range(3):
        page.keyboard.press("y")
    visit.settle()
    assert page.inner_text("#title") == report

    # A seam is drawn.
    page.keyboard.press("x")
    ends = [apart[len(apart) // 2], apart[len(apart) // 2 + 1]]
    for end in ends:
        page.mouse.click(*visit.place_of(end))
    page.keyboard.press("Escape")
    visit.settle()
    (path,) = visit.choices()["cuts"]
    assert [path[0], path[-1]] == ends

    # It is saved, and made again by the command from the project.
    with page.expect_download() as download:
        page.click("#save-npz")
    assert download.value.suggested_filename == "sample_uv.npz"
    download.value.save_as(tmp_path / "saved.npz")
    saved, made = coneflat.read_flattening(tmp_path / "saved.npz"), tmp_path / "made.npz"
    project = str(tmp_path / "sample_studio.json")
    done = CliRunner().invoke(cli, ["flatten", "--project", project, "-o", str(made)])
    assert done.exit_code == 0, done.output
    np.testing.assert_array_equal(coneflat.read_flattening(made).uv, saved.uv)
    cuts = {tuple(edge) for edge in np.sort(saved.seams, axis=1).tolist()}
    assert {tuple(sorted(edge)) for edge in pairwise(path)} <= cuts


def test_a_mesh_is_dropped_on_an_empty_page(browser, tmp_path):
    vertices, faces = shapes.join(shapes.sphere(2), shapes.sphere(2))
    bad = np.concatenate([faces, [[0, 1, len(vertices) - 1]]])
    (tmp_path / "from").mkdir()
    shapes.write_obj(tmp_path / "from" / "bad.obj", vertices, bad)
    served = Studio(tmp_path)
    try:
        visit = StudioVisit(browser, served)
        assert "empty" in visit.page.get_attribute("body", "class")
        visit.page.set_input_files("#open", tmp_path / "from" / "bad.obj")
        visit.wait("studio.hasLayout() && !studio.isBusy()")
        visit.settle()
        assert "The mesh was repaired: 3 vertices" in visit.page.inner_text("#warnings")
        # Undone, the layout is dimmed and named as out of date, until the mesh is repaired.
        visit.page.click("#undo")
        visit.wait("document.body.classList.contains('stale')")
        visit.page.click("#repair")
        visit.settle()
        assert "stale" not in visit.page.get_attribute("body", "class")
        assert visit.drawn_share("model") > 0.1
        visit.close()
    finally:
        served.close()


def test_the_page_says_when_the_studio_has_ended(browser, studio):
    visit = StudioVisit(browser, studio)
    visit.settle()
    studio.close()
    visit.wait("!document.getElementById('trouble').hidden")
    assert "start it again with: coneflat studio sample_studio.json" in visit.page.inner_text("#trouble")
    visit.troubles.clear()  # The browser tells of every question without an answer.
    visit.close()


@pytest.fixture
def hill(open_page, tmp_path):
    return open_page(shapes.write_obj(tmp_path / "hill.obj", *shapes.hill(16, 12)))


def painted(visit, layer):
    paint = visit.choices().get("paint", {})
    return set(Region.of_text(paint.get(layer, "")).vertices())


def test_a_brush_paints_on_both_sides(visit, studio, tmp_path):
    page = visit.page
    visit.settle()
    bare = visit.picture("model")
    vertices = visit.visible_vertices(9)

    # A stroke on the model is one step, and its colour is seen.
    page.keyboard.press("p")
    page.mouse.move(*visit.place_of(vertices[3]))
    page.mouse.down()
    page.mouse.move(*visit.place_of(vertices[4]), steps=6)
    page.mouse.up()
    visit.settle()
    assert {vertices[3], vertices[4]} <= painted(visit, "no_cone")
    assert studio.session.state()["undo"] == 1
    page.mouse.move(1, 1)
    assert (np.abs(visit.picture("model") - bare).max(axis=2) > 40).mean() > 0.003

    # In the layout, by the keys alone, with a larger brush: of what is in the middle.
    page.locator("#layout").focus()
    page.keyboard.press("b")
    page.keyboard.press(".")
    visit.run(
        "(() => { const {camera} = coneflat.panes[1];"
        "const [p] = coneflat.model.shapeOf({kind: 'triangle', index: coneflat.model.worstTriangle()}, true);"
        "camera.pan = [0, 1].map((k) => (p[0][k] + p[1][k] + p[2][k]) / 3); camera.note(); })()"
    )
    within = visit.run(
        "(() => { const pane = coneflat.panes[1], {model} = coneflat, near = [];"
        "model.arrays.point_vertex.forEach((v, p) => { const [x, y] = pane.camera.project(model.flatPlace(p));"
        "if (Math.hypot(x - pane.width / 2, y - pane.height / 2) <= 35) near.push(studio.numberOf(v)); });"
        "return near; })()"
    )
    page.keyboard.press("Enter")
    visit.settle()
    assert set(within) == painted(visit, "no_seam")
    assert len(set(within)) > 20

    # Importance, and an eraser.
    page.keyboard.press("i")
    page.select_option("#brush-weight", "100")
    page.mouse.click(*visit.place_of(vertices[6]))
    visit.settle()
    assert vertices[6] in Region.of_text(visit.choices()["paint"]["importance"]["100.0"]).vertices()
    page.keyboard.press("e")
    page.mouse.click(*visit.place_of(vertices[3]))
    visit.settle()
    assert vertices[3] not in painted(visit, "no_cone")

    # Undone to the bare model, the colours too.
    page.keyboard.press("v")
    for _ in range(4):
        page.keyboard.press("u")
    visit.settle()
    assert "paint" not in visit.choices()
    assert visit.run("coneflat.renderer.look.marks") is None


def test_the_curve_offers_numbers_of_cones(visit):
    page = visit.page
    visit.settle()
    page.keyboard.press("q")
    visit.wait("studio.panel.curve.found")
    shown = visit.run("studio.panel.curve.found")
    assert np.all(np.diff(shown["distortions"]) < 0)
    curve = coneflat.cone_curve(coneflat.sample_path())
    assert shown["counts"] == curve.counts.tolist()
    assert "most is gained up to" in page.get_attribute("#curve", "aria-label")
    at = visit.run(f"studio.panel.curve.places().x({curve.knee})")
    box = page.locator("#curve").bounding_box()
    page.mouse.click(box["x"] + at, box["y"] + 40)
    visit.settle()
    assert visit.choices()["options"] == {"cone_count": curve.knee}
    assert len(visit.cones()) == curve.knee
    # It holds until what it depends on changes.
    page.locator(".cone .toggle").first.click()
    visit.settle()
    assert page.locator("#curve").is_hidden()
    assert page.locator("#curve-ask").is_enabled()


SHOWN_PLACES = """
(() => { const {model} = coneflat, {camera} = coneflat.panes[1], out = [];
const {faces} = model.arrays;
for (let c = 0; c < faces.length; c += 30) out.push(camera.project(model.flatPlace(faces[c])));
return [out, [camera.width, camera.height], Array.from(model.arrays.chart)]; })()
"""


def test_a_small_change_keeps_the_layout_in_place(visit, studio):
    visit.settle()
    mesh = coneflat.read_mesh(coneflat.sample_path())
    faces = np.asarray(mesh.corners).reshape(-1, 3)
    turned = 0
    studio.session.act({"do": "hand"})
    visit.settle()
    for cone in visit.cones()[:5]:
        (before, size, charts), neighbours = visit.run(SHOWN_PLACES), faces[(faces == cone).any(axis=1)]
        to = int(np.setdiff1d(neighbours, visit.cones()).min())
        studio.session.act({"do": "move", "vertex": cone, "to": to})
        visit.settle()
        after, _, now = visit.run(SHOWN_PLACES)
        turned += visit.run("studio.turns") > 0
        if len(set(now)) == len(set(charts)):  # No chart was split.
            off = np.linalg.norm(np.subtract(after, before)[:, :2], axis=1).mean()
            assert off < 0.2 * min(size), cone
            assert (np.array(now) == charts).mean() > 0.9
    assert turned  # Without the turn of the view, the places would be far apart.


#: A layout like that shown, turned, whose largest chart is split in two and whose other charts have moved.
SPLIT = """
(() => { const before = coneflat.model, {uv, faces, chart} = before.arrays;
const turned = uv.slice(), parts = chart.slice(), most = Math.max(...chart);
for (let p = 0; p < uv.length; p += 2) [turned[p], turned[p + 1]] = [uv[p + 1], 1 - uv[p]];
const middle = (i) => before.place(before.vertexAt(3 * i))[0];
for (let i = 0; i < parts.length; i++) parts[i] = chart[i] === 0 && middle(i) > 0.3 ? most + 1 : chart[i];
const swapped = parts.map((one) => most + 1 - one);
const after = new before.constructor(before.head, {...before.arrays, uv: turned, chart: swapped});
[after.uvCentre, after.uvUnit] = [before.uvCentre, before.uvUnit];
studio.align(after);
return [studio.turns, Array.from(after.arrays.chart.filter((_, i) => chart[i] === 0)), most]; })()
"""


def test_a_chart_that_splits_keeps_the_place_and_the_number_of_its_larger_part(visit):
    visit.settle()
    turns, numbers, largest = visit.run(SPLIT)
    (larger, _), (smaller, _) = Counter(numbers).most_common()
    assert (turns, larger) == (1, 0)
    assert smaller > largest


def test_a_sliver_beside_a_drawn_cut_is_reported(visit):
    """Two rings around the ball, one triangle apart."""
    visit.settle()
    assert visit.run("studio.slivers") == 0
    mesh = coneflat.read_mesh(coneflat.sample_path())
    rings = _rings(mesh)
    for ring in rings:
        visit.run(f"studio.act({{do: 'cut', path: {ring}}})")
        visit.settle()
    assert visit.run("studio.slivers") >= 1
    assert "less than two triangles wide" in visit.page.inner_text("#warnings")
    for _ in rings:
        visit.run("studio.act({do: 'undo'})")
    visit.settle()
    assert not visit.page.is_visible("#warnings")


def _rings(mesh):
    """Return two closed paths of vertices: the borders of a strip of triangles, on which a plane cuts the sample."""
    checked = coneflat.check_mesh(mesh.vertices, mesh.triangles).mesh
    height = checked.vertices[:, 1] - np.median(checked.vertices[:, 1])
    is_upper = (height > 0)[checked.faces]
    strip = checked.faces[is_upper.any(axis=1) & ~is_upper.all(axis=1)]
    pairs = np.sort(strip[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, counts = np.unique(pairs, axis=0, return_counts=True)
    neighbours = {}
    for tail, head in edges[counts == 1].tolist():
        neighbours.setdefault(tail, []).append(head)
        neighbours.setdefault(head, []).append(tail)
    loops = []
    while neighbours:
        start = next(iter(neighbours))
        path = [start]
        while ends := [v for v in neighbours.pop(path[-1], []) if v in neighbours]:
            path.append(ends[0])
        if len(path) > 10:
            loops.append([*path, start])
    return sorted(loops, key=len)[-2:]


def test_a_path_joins_an_earlier_cut_instead_of_running_next_to_it(visit):
    visit.settle()
    ends = visit.visible_vertices(40)
    start, end = ends[0], ends[-1]
    path = visit.run(f"studio.pathBetween(...studio.verticesOf([{start}, {end}]))")
    visit.run(f"studio.act({{do: 'cut', path: {path}}})")
    visit.settle()
    beside = visit.run(
        "(() => { const graph = studio.graph(), near = (number) => {"
        f"const [v] = studio.verticesOf([number]), on = new Set(studio.verticesOf({path}));"
        "return [...graph.ends.slice(graph.start[v], graph.start[v + 1])].find((w) => !on.has(w)); };"
        f"return studio.pathBetween(near({path[1]}), near({path[-2]})); }})()"
    )
    assert len(set(beside) & set(path)) > len(path) - 4


def test_sizes_are_shown_in_a_unit(hill, tmp_path):
    page = hill.page
    page.click("#sizes summary")
    layout = hill.run("studio.layout")
    result = coneflat.flatten(tmp_path / "hill.obj")
    mesh = coneflat.TriangleMesh(result.vertices, result.faces)
    a, b = result.vertices[mesh.edges[mesh.is_boundary_edge]].transpose(1, 0, 2)
    length = np.linalg.norm(b - a, axis=1).sum()
    assert float(page.inner_text("#size-list dd:nth-of-type(3)")) == pytest.approx(length, rel=1e-3)
    page.select_option("#unit", "inch")
    page.select_option("#shown-in", "cm")
    hill.settle()
    assert page.inner_text("#size-list dd:nth-of-type(3)").endswith(" cm")
    assert float(page.inner_text("#size-list dd:nth-of-type(3)").split()[0]) == pytest.approx(
        2.54 * length, rel=1e-3
    )
    assert hill.run("studio.layout") == layout


def test_a_picture_and_a_report_are_saved(hill, tmp_path):
    page = hill.page
    for kind, begins in (("png", b"\x89PNG"), ("json", b"{")):
        with page.expect_download() as download:
            page.click(f"#save-{kind}")
        download.value.save_as(tmp_path / f"x.{kind}")
        assert (tmp_path / f"x.{kind}").read_bytes().startswith(begins)
    assert json.loads((tmp_path / "x.json").read_text())["flipped"] == 0


def test_quads_are_shown_over_the_views_and_saved_from_there(hill, tmp_path):
    page = hill.page
    page.fill("#quad-count", "300")
    page.click("#make-quads")
    hill.wait("studio.news.quads === 1 && !document.getElementById('quads-view').hidden")
    inside = page.frame_locator("#quads-view")
    inside.locator("html[data-ready]").wait_for(timeout=60_000)
    assert "irregular" in inside.locator("#title").inner_text()
    frame, model, layout = (
        page.locator(f"#{name}").bounding_box() for name in ("quads-view", "model", "layout")
    )
    assert (frame["x"], frame["x"] + frame["width"]) == (model["x"], layout["x"] + layout["width"])
    assert page.locator("#save-quads-obj").is_visible()
    with page.expect_download() as download:
        page.click("#save-quads-obj")
    assert download.value.suggested_filename == "hill_quads.obj"
    download.value.save_as(tmp_path / "quads.obj")
    mesh = coneflat.read_mesh(tmp_path / "quads.obj")
    assert set(np.diff(mesh.offsets)) == {4}
    assert 100 < len(mesh.offsets) - 1 < 600

    page.click("#show-quads")
    assert not page.locator("#quads-view").is_visible()
    page.click("#show-quads")
    assert page.locator("#quads-view").is_visible()
    page.fill("#padding", "3")
    page.keyboard.press("Tab")
    hill.settle()
    hill.wait("studio.news.quads === 0")
    assert not page.locator("#quads-view").is_visible()
    assert not page.locator("#save-quads-obj").is_visible()


def test_the_user_cancels_quads(hill):
    page = hill.page
    page.fill("#quad-count", "200000")
    page.click("#make-quads")
    page.locator("#cancel").wait_for(timeout=60_000)
    assert "quads" in page.inner_text("#stage-name")
    page.click("#cancel")
    hill.wait("!studio.news.making")
    page.locator("#cancel").wait_for(state="hidden")
    assert page.locator("#make-quads").is_enabled()
    assert page.locator("#refusal").is_hidden()
    assert hill.run("studio.news.quads") == 0


TURN, ZOOM = "coneflat.panes[0].camera.turn.join()", "coneflat.panes[0].camera.zoom"


class Fingers:
    """Fingers on the page's screen."""

    def __init__(self, visit):
        self._session = visit.context.new_cdp_session(visit.page)

    def touch(self, kind, *points):
        places = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(points)]
        self._session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": places})

    def drag(self, *ways, steps=6):
        """Move fingers, each along a way from one place to another, together, and lift them."""
        self.touch("touchStart", *[begin for begin, _ in ways])
        for step in range(1, steps + 1):
            at = [np.add(begin, np.subtract(end, begin) * step / steps).tolist() for begin, end in ways]
            self.touch("touchMove", *at)
        self.touch("touchEnd")


@pytest.fixture
def phone(browser, studio):
    opened = StudioVisit(
        browser, studio, viewport=NARROW, has_touch=True, is_mobile=True, device_scale_factor=2
    )
    opened.settle()
    opened.fingers = Fingers(opened)
    yield opened
    opened.close()


def seen_cone(phone):
    """A cone in sight in the model's pane that is far from others, and its number."""
    return phone.run(
        "(() => { const pane = coneflat.panes[0], {cones} = coneflat.model.arrays;"
        "const at = Array.from(cones, (v) => studio.overlay.places(pane, v)[0]);"
        "const off = (p, q) => Math.hypot(p[0] - q[0], p[1] - q[1]);"
        "const far = (i) => Math.min(...at.map((p, j) => (j === i ? 1e9 : off(p, at[i]))));"
        "const isSeen = (index) => coneflat.marks.isSeen(pane, {kind: 'cone', index}, coneflat.state);"
        "const seen = at.map((_, i) => i).filter(isSeen).sort((i, j) => far(j) - far(i));"
        "return studio.numberOf(cones[seen[0]]); })()"
    )


def test_a_finger_moves_a_cone(phone, studio):
    cone, (target, *_) = seen_cone(phone), phone.visible_vertices(5)
    (x, y), to = phone.place_of(cone), phone.place_of(target)
    turn = phone.run(TURN)
    # A finger need not be on it to the pixel.
    phone.fingers.drag(((x + 9, y - 8), to))
    phone.settle()
    assert phone.run(TURN) == turn
    assert target in phone.cones()
    assert cone not in phone.cones()
    assert studio.session.state()["undo"] == 1
    assert phone.run("studio.selectedNumber()") == target
    # Nor is it there, but for what is picked, when the finger is lifted.
    assert phone.run("studio.tools.dragged") is None


def test_two_fingers_turn_and_zoom_whatever_the_tool(phone):
    layout = phone.run("studio.layout")
    for tool in ("look", "cone", "no_cone", "cut"):
        phone.page.locator(f"#tool-{tool}").tap()
        phone.run("coneflat.panes.forEach((pane) => pane.camera.fit())")
        phone.wait_until_drawn()
        (x, y), turn = phone.place_of(seen_cone(phone)), phone.run(TURN)
        # The first finger lands on a cone, the second beside it.
        phone.fingers.drag(((x, y), (x - 30, y)), ((x + 60, y), (x + 90, y)))
        assert phone.run(ZOOM) == pytest.approx(2, rel=0.05), tool
        phone.fingers.drag(((x - 20, y), (x - 20, y - 30)), ((x + 40, y), (x + 40, y + 30)))
        assert phone.run(TURN) != turn, tool
        phone.settle()
        assert phone.run("[studio.news.undo, studio.layout]") == [0, layout], tool
        assert phone.run("studio.paint.preview") is None, tool
        assert phone.run("studio.tools.dragged") is None, tool
