"""The studio's page by the keyboard, without colours, and at its start."""
# ruff: noqa: F811  (fixtures that are imported)

from __future__ import annotations

import numpy as np
import pytest
from browsing import need_browser
from studio_browsing import Studio, StudioVisit, sample, studio, visit  # noqa: F401

need_browser()

FOCUS = "document.activeElement.getAttribute('aria-label') ?? document.activeElement.textContent"


def test_a_toolbar_is_one_tab_stop_with_arrow_keys(visit):
    visit.settle()
    page = visit.page
    page.locator("#tool-look").focus()
    page.keyboard.press("ArrowRight")
    assert visit.run("document.activeElement.id") == "tool-cone"
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("ArrowLeft")
    assert visit.run("document.activeElement.id") == "tool-keep"  # The tool for corners is hidden.
    page.keyboard.press("Tab")
    assert visit.run("document.activeElement.id") == "tool-no_cone"
    page.keyboard.press("Shift+Tab")
    assert visit.run("document.activeElement.id") == "tool-keep"


def test_a_row_of_a_cone_is_one_tab_stop_and_its_controls_have_names(visit, studio):
    visit.settle()
    page, cones = visit.page, visit.cones()
    page.locator("#cone-list button").first.focus()
    page.keyboard.press("ArrowRight")
    assert visit.run(FOCUS) == f"Angle of cone {cones[0]}, degrees"
    page.keyboard.press("ArrowRight")
    assert visit.run(FOCUS) == f"Lock cone {cones[0]}"
    page.keyboard.press("ArrowDown")
    assert visit.run(FOCUS) == f"Lock cone {cones[1]}"
    # The focus stays when the list changes.
    page.keyboard.press("Enter")
    visit.settle()
    assert studio.session.state()["choices"]["cones"][0]["locked"]
    assert visit.run(FOCUS) == f"Lock cone {cones[1]}"
    line, cones = visit.cones().index(cones[1]), visit.cones()
    page.keyboard.press("ArrowRight")
    assert visit.run(FOCUS) == f"Remove cone {cones[line]}"
    page.keyboard.press("Enter")
    visit.settle()
    assert visit.cones() == [*cones[:line], *cones[line + 1 :]]
    assert visit.run(FOCUS) == f"Remove cone {cones[line + 1]}"
    page.keyboard.press("Tab")
    assert visit.run("document.activeElement.textContent") == f"{cones[line + 2]:,}"


def test_cones_of_both_signs_differ_in_shape(visit):
    visit.settle()
    marks = visit.run(
        "coneflat.model.conePoints.flatMap((points, i) => points.map((point) => ["
        "coneflat.model.head.cone_curvatures[i], "
        "...coneflat.panes[1].camera.project(coneflat.model.flatPlace(point)).slice(0, 2)]))"
    )
    picture = visit.picture("layout")
    filled = {True: [], False: []}
    for curvature, x, y in marks:
        radius = 0.75 * np.clip(6.5 * np.sqrt(abs(curvature) / (np.pi / 2)), 3.5, 10)
        inks = [
            picture[round(y + a * radius), round(x + b * radius)] for a in (-0.7, 0.7) for b in (-0.7, 0.7)
        ]
        ink = [214, 33, 33] if curvature > 0 else [0, 0, 0]
        filled[curvature > 0].append(np.mean([np.abs(colour - ink).max() < 60 for colour in inks]))
    assert np.mean(filled[False]) > np.mean(filled[True]) + 0.25


def test_keys_show_a_crosshair_where_they_apply(visit):
    visit.settle()
    page = visit.page
    page.locator("#model").focus()
    page.keyboard.press("a")
    assert visit.run("coneflat.panes.map((pane) => studio.overlay.aims(pane))") == [True, False]
    before = visit.picture("model")
    page.mouse.move(*[side + 3 for side in visit.place_of(visit.cones()[0])])
    page.mouse.move(1, 1)
    assert not visit.run("coneflat.panes.some((pane) => studio.overlay.aims(pane))")
    middle = np.abs(visit.picture("model") - before)[before.shape[0] // 2 - 16 :, :][:32]
    assert middle.max() > 100


def test_a_start_page_opens_the_sample(browser, tmp_path):
    served = Studio(tmp_path)
    try:
        visit = StudioVisit(browser, served)
        assert visit.page.locator("#open-first").count() == 1
        visit.page.click("#sample")
        visit.wait("studio.hasLayout() && !studio.isBusy()")
        visit.settle()
        title = visit.page.inner_text("#title")
        assert "1 chart" in title
        assert "overlap none" in title
        assert visit.page.locator("#start").is_hidden()
        assert (tmp_path / "sample_studio.json").exists()
        visit.close()
    finally:
        served.close()


def test_saving_is_in_sight_and_the_unit_square_is_in_the_view(visit):
    visit.settle()
    box, panel = visit.page.locator("#save-obj").bounding_box(), visit.page.locator("#studio").bounding_box()
    assert box["y"] + box["height"] <= panel["y"] + panel["height"]
    pane = visit.box("layout")
    for u, v in ((0, 0), (1, 1)):
        x, y, _ = visit.run(f"coneflat.panes[1].camera.project(coneflat.model.planePlace({u}, {v}))")
        assert 0 < x < pane["width"]
        assert 0 < y < pane["height"]


def test_the_view_can_have_another_axis_up(visit):
    visit.settle()
    visit.page.locator("#sizes summary").click()
    for axis in "xyz":
        visit.page.select_option("#up", axis)
        turn = np.reshape(visit.run("coneflat.panes[0].camera.turn"), (3, 3))
        up = turn @ np.eye(3)["xyz".index(axis)]
        assert up[1] > 0.7, axis
        assert np.linalg.det(turn) == pytest.approx(1), axis


def test_drawn_cuts_keep_their_colour_in_every_mode(visit, studio):
    visit.settle()
    ends = visit.visible_vertices(40)[::20][:2]
    path = visit.run(f"studio.pathBetween(...studio.verticesOf({ends}))")
    studio.session.act({"do": "cut", "path": path})
    visit.settle()
    visit.page.mouse.move(1, 1)
    for show in ("checker", "charts", "qc", "picture", "plain"):
        visit.run(f"coneflat.state.set({{show: '{show}'}})")
        assert (np.abs(visit.picture("model") - [214, 0, 108]).max(axis=2) < 40).sum() > 20, show
