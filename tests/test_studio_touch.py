"""The studio by fingers, on the screen of a telephone, in a browser."""
# ruff: noqa: F811  (fixtures that are imported)

from __future__ import annotations

import numpy as np
import pytest
from browsing import NARROW
from studio_browsing import StudioVisit, sample, studio  # noqa: F401

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


def test_a_tap_picks_the_cone_that_it_means_and_adds_others(phone):
    cone = seen_cone(phone)
    x, y = phone.place_of(cone)
    phone.page.touchscreen.tap(x - 8, y + 9)
    assert phone.run("studio.selectedNumber()") == cone
    far = [v for v in phone.visible_vertices(12) if min(
        np.hypot(*np.subtract(phone.place_of(v), phone.place_of(c))) for c in phone.cones()) > 25]  # fmt: skip
    phone.page.locator("#tool-cone").tap()
    phone.page.touchscreen.tap(*phone.place_of(far[0]))
    phone.settle()
    assert far[0] in phone.cones()


@pytest.mark.parametrize("tool", ["look", "cone", "no_cone", "cut"])
def test_two_fingers_turn_and_zoom_whatever_the_tool(phone, tool):
    phone.page.locator(f"#tool-{tool}").tap()
    (x, y), turn = phone.place_of(seen_cone(phone)), phone.run(TURN)
    # The first finger lands on a cone, the second beside it.
    phone.fingers.drag(((x, y), (x - 30, y)), ((x + 60, y), (x + 90, y)))
    assert phone.run(ZOOM) == pytest.approx(2, rel=0.05)
    phone.fingers.drag(((x - 20, y), (x - 20, y - 30)), ((x + 40, y), (x + 40, y + 30)))
    assert phone.run(TURN) != turn
    phone.settle()
    assert phone.run("[studio.news.undo, studio.layout]") == [0, 1]
    assert phone.run("studio.paint.preview") is None
    assert phone.run("studio.tools.dragged") is None


def test_one_finger_turns_beside_the_cones_and_paints(phone, studio):
    (one, two, *_), box = phone.visible_vertices(5), phone.box("model")
    turn = phone.run(TURN)
    corner = box["x"] + 12, box["y"] + box["height"] - 12
    phone.fingers.drag((corner, (corner[0] + 60, corner[1] - 20)))
    assert phone.run(TURN) != turn
    assert studio.session.state()["undo"] == 0
    one, two, *_ = phone.visible_vertices(5)
    phone.page.locator("#tool-no_seam").tap()
    turn = phone.run(TURN)
    phone.fingers.drag((phone.place_of(one), phone.place_of(two)))
    phone.settle()
    assert phone.run(TURN) == turn
    assert phone.run("studio.paint.count('no_seam')") > 10
    assert studio.session.state()["undo"] == 1
    # No circle of the brush stays where no finger is.
    assert phone.run("studio.brush.at") is None


def test_everything_is_on_the_screen(phone):
    assert phone.run("document.documentElement.scrollWidth <= innerWidth")
    for name in ("undo", "tool-look", "tool-no_cone", "save-obj", "distortion", "stretch"):
        phone.page.locator(f"#{name}").scroll_into_view_if_needed()
        box = phone.page.locator(f"#{name}").bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= NARROW["width"] + 0.5
