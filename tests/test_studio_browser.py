"""Whole stories of the studio in a browser, on the sample."""
# ruff: noqa: F811  (fixtures that are imported)

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import shapes
from browsing import NARROW
from click.testing import CliRunner
from studio_browsing import Studio, StudioVisit, sample, studio, visit  # noqa: F401

import coneflat
from coneflat.apps.cli.main import cli


def test_a_whole_story(visit, studio, tmp_path, browser):
    page = visit.page
    visit.settle()
    first, title = visit.choices(), page.inner_text("#title")
    found = visit.cones()
    assert len(found) == 19

    # Three cones more.
    page.keyboard.press("a")
    vertices = visit.visible_vertices(5)
    for vertex in vertices[:3]:
        page.mouse.click(*visit.place_of(vertex))
        visit.settle()
    assert set(visit.cones()) == {*found, *vertices[:3]}
    assert visit.run("studio.selectedNumber()") == vertices[2]
    assert page.inner_text("#title") != title

    # One of them is dragged; the model does not turn.
    turn = visit.run("coneflat.panes[0].camera.turn.join()")
    page.mouse.move(*visit.place_of(vertices[2]))
    page.mouse.down()
    page.mouse.move(*visit.place_of(vertices[3]), steps=4)
    page.mouse.up()
    visit.settle()
    assert set(visit.cones()) == {*found, *vertices[:2], vertices[3]}
    assert visit.run("coneflat.panes[0].camera.turn.join()") == turn
    assert studio.session.state()["undo"] == 4  # The drag is one step.

    # Its angle is typed, and snaps.
    page.select_option("#snap", "45")
    page.keyboard.press("g")
    page.keyboard.type("260")
    page.keyboard.press("Enter")
    visit.settle()
    row = visit.run(f"studio.coneRows().find((row) => row.vertex === {vertices[3]})")
    assert (row["degrees"], row["chosen"]) == (pytest.approx(270), True)
    report = visit.run("coneflat.model.head.title")

    # Everything is undone, and done again.
    page.keyboard.press("Escape")
    page.locator("#model").focus()
    for _ in range(5):
        page.keyboard.press("Control+z")
    visit.settle()
    assert visit.choices() == first
    assert page.inner_text("#title") == title
    assert page.locator("#undo").is_disabled()
    for _ in range(5):
        page.keyboard.press("y")
    visit.settle()
    assert visit.run("coneflat.model.head.title") == report

    # A seam is drawn, and erased, and drawn again.
    page.keyboard.press("x")
    apart = visit.visible_vertices(40)
    ends = [apart[len(apart) // 2], apart[len(apart) // 2 + 1]]
    for vertex in ends:
        page.mouse.click(*visit.place_of(vertex))
    page.keyboard.press("Escape")
    visit.settle()
    (path,) = visit.choices()["cuts"]
    assert [path[0], path[-1]] == ends
    page.locator("#path-list button").click()
    visit.settle()
    assert visit.choices()["cuts"] == []
    page.keyboard.press("u")
    visit.settle()
    assert visit.run("studio.news.trouble") is None

    # It is saved, the project opened again elsewhere, and made again without the page.
    with page.expect_download() as download:
        page.click("#save-npz")
    assert download.value.suggested_filename == "sample_uv.npz"
    saved = coneflat.read_flattening(_kept(download.value, tmp_path / "saved.npz"))
    again = Studio(tmp_path)
    try:
        again.session.open(tmp_path / "sample_studio.json")
        second = StudioVisit(browser, again)
        second.settle()
        assert second.choices() == visit.choices()
        assert second.run("coneflat.model.head.title") == visit.run("coneflat.model.head.title")
        second.close()
    finally:
        again.close()
    project, made = str(tmp_path / "sample_studio.json"), tmp_path / "made.npz"
    done = CliRunner().invoke(cli, ["flatten", "--project", project, "-o", str(made)])
    assert done.exit_code == 0, done.output
    np.testing.assert_array_equal(coneflat.read_flattening(made).uv, saved.uv)
    edges = {frozenset(edge) for edge in pairwise(path)}
    assert edges <= {frozenset(edge) for edge in _seams(saved)}


def _kept(download, path):
    download.save_as(path)
    return path


def _seams(result):
    """Return the edges whose two sides lie apart in the plane."""
    sides = {}
    for face, points in zip(result.faces.tolist(), result.uv_faces.tolist(), strict=True):
        for k in range(3):
            ends = sorted([(face[k], points[k]), (face[k - 1], points[k - 1])])
            sides.setdefault((ends[0][0], ends[1][0]), set()).add((ends[0][1], ends[1][1]))
    return [edge for edge, points in sides.items() if len(points) > 1]


def test_nothing_is_marked_where_a_cone_was(visit):
    page = visit.page
    visit.settle()
    marked = (
        "(() => { const {canvas} = coneflat.marks, {data} = canvas.getContext('2d').getImageData(0, 0, canvas.width,"
        "canvas.height); return data.filter((value, i) => i % 4 === 3 && value > 9).length; })()"
    )
    page.keyboard.press("a")
    page.mouse.click(*visit.place_of(visit.visible_vertices(1)[0]))
    visit.settle()
    page.click("#undo")
    visit.settle()
    visit.page.wait_for_timeout(300)  # until the browser has shown it
    assert visit.run(marked) == 0


def test_searches_keep_what_is_locked(visit):
    page = visit.page
    visit.settle()
    kept = visit.cones()[4]
    page.locator(f'.cone[data-vertex="{kept}"] .toggle').click()
    page.select_option("#cones-by", "cone_count")
    visit.settle()
    page.fill("#cone-count", "12")
    page.keyboard.press("Enter")
    visit.settle()
    assert len(visit.cones()) == 12
    assert kept in visit.cones()
    assert page.get_attribute(f'.cone[data-vertex="{kept}"] .toggle', "aria-pressed") == "true"
    page.select_option("#cones-by", "hand")
    visit.settle()
    page.locator("#model").focus()
    page.keyboard.press("n")
    first = visit.cones()[0]
    assert visit.run("studio.selectedNumber()") == first
    page.keyboard.press("Delete")
    visit.settle()
    assert len(visit.cones()) == 11
    assert first not in visit.cones()


def test_what_cannot_be_is_told_and_undone(visit):
    page = visit.page
    visit.settle()
    for _ in range(3):
        page.locator(".cone button[aria-label^='Take']").first.click()
        visit.settle()
    shown = visit.run("studio.layout")
    page.locator(".cone input").first.fill("-5")
    page.keyboard.press("Tab")
    visit.wait("!document.getElementById('refusal').hidden")
    assert "positive angle" in page.inner_text("#refusal")
    assert visit.run("studio.layout") == shown
    visit.troubles.clear()  # The browser tells of the refusal, too.
    page.click("#undo")
    visit.settle()
    assert page.locator("#refusal").is_hidden()


def test_two_pages_show_the_same(visit, browser, studio):
    visit.settle()
    other = StudioVisit(browser, studio, viewport=NARROW)
    other.settle()
    assert other.run("document.documentElement.scrollWidth <= innerWidth")
    other.page.locator("#stretch").focus()
    other.page.keyboard.press("End")
    other.settle()
    visit.settle()
    assert visit.choices()["options"] == {"stretch": 1.0}
    assert visit.page.input_value("#stretch") == "1"
    assert visit.run("coneflat.model.head.title") == other.run("coneflat.model.head.title")
    other.close()


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
        visit.wait("studio.news.trouble?.repair && !studio.isBusy()")
        visit.page.click("#repair")
        visit.wait("studio.layout === 1 && !studio.isBusy()")
        visit.settle()
        assert visit.drawn_share("model") > 0.1
        visit.close()
    finally:
        served.close()


def test_another_mesh_takes_the_place_of_the_first(visit, tmp_path):
    visit.settle()
    shapes.write_obj(tmp_path / "ball.obj", *shapes.sphere(3))
    (tmp_path / "empty.obj").write_bytes(b"")
    first = visit.page.inner_text("#title")
    visit.page.set_input_files("#open", tmp_path / "ball.obj")
    visit.page.locator("#name", has_text="ball.obj").wait_for()
    visit.settle()
    assert visit.page.inner_text("#title") != first
    visit.page.set_input_files("#open", tmp_path / "empty.obj")
    visit.page.locator("#refusal-text", has_text="is empty").wait_for()
    assert visit.run("studio.viewer") is None
    assert visit.page.locator("#cone-list > .cone").count() == 0


def test_a_layout_that_is_gone_stops_nothing(visit):
    visit.settle()
    visit.page.route(
        "**/layout*", lambda route: route.fulfill(status=400, body="there is no layout yet"), times=1
    )
    visit.page.locator("#stretch").focus()
    visit.page.keyboard.press("End")
    visit.wait("studio.news.choices.options.stretch === 1 && !studio.isBusy()")
    visit.page.keyboard.press("Home")
    visit.settle()
    assert visit.page.locator("#trouble").is_hidden()
    visit.troubles.clear()  # The browser tells of the refusal, too.


def test_the_page_says_when_the_studio_has_ended(browser, studio):
    visit = StudioVisit(browser, studio)
    visit.settle()
    studio.close()
    visit.wait("!document.getElementById('trouble').hidden")
    assert "start it again with: coneflat studio sample_studio.json" in visit.page.inner_text("#trouble")
    visit.troubles.clear()  # The browser tells of every question without an answer.
    visit.close()
