"""The viewer's page on small screens, by keyboard, and for assistive programs."""

from __future__ import annotations

import numpy as np
import pytest
from axe import axe_source, findings
from browsing import NARROW, SMALL, WIDE, Visit, need_browser

need_browser()

PHONE = {"viewport": NARROW, "has_touch": True, "is_mobile": True}
SIZES = {"wide": WIDE, "small": SMALL, "tablet": {"width": 820, "height": 1180}, "phone": NARROW}
#: Whether no elements of the header overlap, and all of their text is inside them and the window.
FITS = """
(() => {
  const parts = [...document.querySelectorAll("header button, header select, header label, h1, #title")]
    .filter((part) => part.getBoundingClientRect().width && !part.closest("label label"));
  const inside = parts.filter((part) => !(part.matches("select") || part.matches("label")));
  const clipped = inside.filter((part) => part.scrollWidth > part.clientWidth + 1
    || part.scrollHeight > part.clientHeight + 1);
  const boxes = parts.map((part) => [part, part.getBoundingClientRect()]);
  const outside = boxes.filter(([, box]) => box.left < 0 || box.right > innerWidth || box.top < 0);
  const crossed = boxes.filter(([part, a], i) => boxes.slice(i + 1).some(([other, b]) => !part.contains(other)
    && Math.min(a.right, b.right) > Math.max(a.left, b.left) + 1
    && Math.min(a.bottom, b.bottom) > Math.max(a.top, b.top) + 1));
  return [...clipped, ...[...outside, ...crossed].map(([part]) => part)].map((part) => part.id || part.outerHTML);
})()
"""


@pytest.mark.parametrize("size", SIZES.values(), ids=SIZES)
def test_the_header_is_complete(browser, viewed_page, size):
    visit = Visit(browser, viewed_page, viewport=size)
    for show in ("checker", "picture", "faults", "qc"):
        visit.run(f"coneflat.state.set({{show: '{show}'}})")
        assert visit.run(FITS) == [], show
    long = "A".join(["long name"] * 12)
    visit.run(f"document.getElementById('name').textContent = '{long}'")
    assert visit.run(FITS) == []
    visit.close()


def test_help_on_a_phone_begins_at_the_top_and_says_tap(browser, viewed_page):
    visit = Visit(browser, viewed_page, **PHONE)
    assert visit.page.inner_text("#facts").startswith("Tap a triangle")
    visit.page.tap("#help")
    assert visit.run("document.getElementById('keys').scrollTop") == 0
    for part in ("#keys h2", "#keys button"):
        box = visit.page.locator(part).bounding_box()
        assert 0 <= box["y"] < 200
    text = visit.page.inner_text("#keys")
    assert "Tap" in text
    assert "Mouse" not in text.replace("Keys, mouse", "")
    assert "click" not in text
    visit.page.tap("#keys button")
    assert not visit.page.is_visible("#keys")
    visit.close()


def test_help_with_a_mouse_names_it(visit):
    visit.page.keyboard.press("?")
    assert "wheel: zoom" in visit.page.inner_text("#keys")
    assert visit.run("document.getElementById('keys').scrollTop") == 0
    visit.page.keyboard.press("Escape")


def test_the_report_scrolls_by_keyboard(browser, viewed_page):
    visit = Visit(browser, viewed_page, viewport={"width": 1200, "height": 420})
    visit.page.keyboard.press("r")
    visit.page.focus("#table")
    before = visit.run("coneflat.panes[0].camera.turn")
    for _ in range(4):
        visit.page.keyboard.press("ArrowDown")
    visit.wait("document.getElementById('table').scrollTop > 0")
    assert visit.run("coneflat.panes[0].camera.turn") == before
    visit.close()


def test_measures_and_facts_are_announced(visit):
    for name in ("title", "facts"):
        assert visit.run(f"document.getElementById('{name}').closest('[aria-live]').ariaLive") == "polite"


@pytest.mark.parametrize("size", [WIDE, NARROW], ids=["wide", "narrow"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("state", ["{}", "{report: true}", "{show: 'faults'}", "{show: 'qc'}", "help"])
def test_axe_finds_nothing_serious(browser, viewed_page, size, scheme, state):
    source = axe_source()
    visit = Visit(browser, viewed_page, viewport=size, color_scheme=scheme, bypass_csp=True)
    visit.run(
        "document.getElementById('help').click()" if state == "help" else f"coneflat.state.set({state})"
    )
    assert findings(visit.page, source) == []
    visit.close()


def luminance(colours):
    """Relative luminance of (..., 3) colours from 0 to 255, by WCAG 2."""
    parts = colours / 255
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return linear @ [0.2126, 0.7152, 0.0722]


@pytest.mark.parametrize("layer", [0, 1, 2])
@pytest.mark.parametrize("ground", ["#f7f7fa", "#5b77a5", "#303030", "#d0a090"])
def test_paint_has_contrast_on_any_ground(visit, layer, ground):
    """The paint has two tones with a contrast of 3:1, so that it is seen on light and on dark grounds."""
    visit.run(
        "(() => { const strengths = new Uint8Array(12 * coneflat.model.triangleCount);"
        f"for (let i = {layer}; i < strengths.length; i += 4) strengths[i] = 255;"
        "coneflat.renderer.setMarks(strengths);"
        "document.documentElement.style.setProperty('--paint', '" + ground + "'); coneflat.readColours();"
        "coneflat.state.set({show: 'plain', marked: 1, seams: false, cones: false}); coneflat.redraw(); })()"
    )
    picture = visit.picture("layout")
    covered = np.abs(picture - picture[-3, 3]).max(axis=2) > 12
    tones = np.sort(luminance(picture[covered].astype(float)))
    dark, light = tones[int(0.1 * len(tones))], tones[int(0.9 * len(tones))]
    visit.run(
        "coneflat.renderer.setMarks(null); document.documentElement.style.removeProperty('--paint');"
        "coneflat.readColours()"
    )
    assert (light + 0.05) / (dark + 0.05) >= 3
