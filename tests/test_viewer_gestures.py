"""What mouse, keys and fingers do in the viewer's page, in a browser."""

from __future__ import annotations

import numpy as np
import pytest
from browsing import NARROW, Visit, thing

from coneflat.options.outputs import SHOWS


def near(visit, pane, x, y, reach=16):
    """Whether the accent colour of marks is seen near a place."""
    box = visit.box(pane)
    picture = visit.picture(pane)
    row, column = round(y - box["y"]), round(x - box["x"])
    part = picture[max(row - reach, 0) : row + reach, max(column - reach, 0) : column + reach]
    return (np.abs(part - [0xD6, 0x00, 0x6C]).max(axis=2) < 60).any()


def test_pointing_finds_a_triangle_on_both_sides(visit, viewed):
    visit.run("coneflat.state.set({seams: false, cones: false})")  # which come before triangles
    for index in (0, 123, 777, len(viewed.faces) - 1):
        visit.page.mouse.move(*visit.at("layout", thing("triangle", index))[0])
        assert visit.state("hovered") == {"kind": "triangle", "index": index}
        assert f"Triangle {index:,}" in visit.page.inner_text("#facts")
        assert f"QC {viewed.distortion.qc[index]:.4f}" in visit.page.inner_text("#facts")
        for pane in ("model", "layout"):
            (x, y), box = visit.at(pane, thing("triangle", index))[0], visit.box(pane)
            if 0 < x - box["x"] < box["width"] and 0 < y - box["y"] < box["height"]:
                assert near(visit, pane, x, y)
    visit.page.mouse.move(5, 5)
    assert visit.state("hovered") is None


def test_pointing_at_the_model_finds_what_is_in_front(visit, viewed):
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


def test_a_seam_edge_and_its_two_sides(visit, viewed):
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
    assert sorted(ends) in np.sort(viewed.seams, axis=1).tolist()


def test_a_click_keeps_a_cone_and_turns_the_model_to_it(visit, viewed):
    for index in range(len(viewed.cones)):
        visit.page.mouse.click(*visit.at("layout", thing("cone", index))[0])
        assert visit.state("picked") == {"kind": "cone", "index": index}
        visit.rest()
        assert visit.run(f"coneflat.marks.isSeen(coneflat.panes[0], {thing('cone', index)}, coneflat.state)")
        (x, y), box = visit.at("model", thing("cone", index))[0], visit.box("model")
        assert 0 < x - box["x"] < box["width"]
        assert 0 < y - box["y"] < box["height"]
        assert near(visit, "model", x, y)
        assert f"{abs(viewed.curvatures[index]) / np.pi:.3f} π" in visit.page.inner_text("#facts")
    visit.page.keyboard.press("Escape")
    assert visit.state("picked") is None


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
        visit.wait(f"{camera}.zoom > {1.3 * zoom}")
        later, _ = visit.run(back)
        assert later == pytest.approx(place)
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


def test_fingers_turn_zoom_and_pick(browser, viewed_page):
    visit = Visit(browser, viewed_page, viewport=NARROW, has_touch=True, is_mobile=True)
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


def test_slow_machines_draw_roughly_while_something_moves(browser, viewed_page):
    visit = Visit(browser, viewed_page)
    visit.run(
        "const viewer = coneflat, draw = viewer.renderer.draw.bind(viewer.renderer); window.drawn = [];"
        "viewer.renderer.draw = (pane, state, rough) => {"
        "drawn.push([pane.name, rough]); draw(pane, state, rough); };"
        # Drawn at once: the next frame of a busy machine may come when nothing moves any more.
        "viewer.slowFrames = 2; viewer.panes[0].camera.rotate(0.3, 0.1); viewer.drawStale()"
    )
    visit.rest()
    assert visit.run("drawn") == [["model", True], ["model", False]]
    fine = visit.picture("model")
    visit.run("coneflat.slowFrames = 0; coneflat.redraw()")
    assert np.abs(visit.picture("model") - fine).max() <= 2  # of 255
    visit.close()


def test_the_model_glides_to_what_was_picked(browser, viewed_page):
    visit = Visit(browser, viewed_page, reduced_motion="no-preference")
    before = visit.run("coneflat.panes[0].camera.turn")
    hidden = visit.run(
        "Array.from({length: coneflat.model.coneCount}, (_, index) => index).find((index) =>"
        "!coneflat.marks.isSeen(coneflat.panes[0], {kind: 'cone', index}, coneflat.state))"
    )
    visit.run(f"coneflat.find({thing('cone', hidden)})")
    visit.wait(f"coneflat.marks.isSeen(coneflat.panes[0], {thing('cone', hidden)}, coneflat.state)")
    assert visit.run("coneflat.panes[0].camera.turn") != before
    visit.close()
