"""Two results in one page, with linked views."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from axe import axe_source, findings
from browsing import AT_REST, NARROW, Visit, need_browser
from click.testing import CliRunner

import coneflat
from coneflat.apps.cli.main import cli
from coneflat.apps.view import Ranges, common_ranges, conformal_distortion
from coneflat.apps.view.quantity import stretch

need_browser()

FRAMES = "[...document.querySelectorAll('iframe')].map((frame) => frame.contentWindow.coneflat)"


@pytest.fixture(scope="module")
def results():
    """Two layouts of one surface, of different sizes and places in the plane."""
    vertices, faces = shapes.hill(10, 8)
    return (
        coneflat.flatten(vertices, faces, cone_count=0),
        coneflat.flatten(vertices, faces, cone_count=4, resolution=64, padding=9),
    )


@pytest.fixture(scope="module")
def pair_page(results, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pair")
    for name, result in zip(("old", "new"), results, strict=True):
        result.save(folder / f"{name}.npz")
    page = folder / "pair.html"
    done = CliRunner().invoke(
        cli, ["view", str(folder / "old.npz"), str(folder / "new.npz"), "-o", str(page)]
    )
    assert done.exit_code == 0, done.output
    return page


class Pair(Visit):
    def wait_until_drawn(self):
        self.wait(f"{FRAMES}.every((coneflat) => coneflat && {AT_REST})")

    def values(self, expression):
        """The values of an expression, in which `it` is a viewer, for both."""
        return self.run(f"{FRAMES}.map((it) => {expression})")


@pytest.fixture
def pair(browser, pair_page):
    visit = Pair(browser, pair_page, viewport={"width": 1500, "height": 700})
    yield visit
    visit.close()


def middle_and_scale(pair):
    """For each layout the UVs in the middle of the view, and the pixels per UV."""
    values = pair.values(
        "[...it.panes[1].camera.pan, it.panes[1].camera.scale, ...it.model.uvCentre, it.model.uvUnit]"
    )
    return [
        [pan / unit + centre for pan, centre in ((x, u), (y, v))] + [scale * unit]
        for x, y, scale, u, v, unit in values
    ]


def test_views_are_linked(pair):
    for press in ("ArrowRight", "ArrowDown", "+", "Shift+ArrowLeft"):
        for frame in (0, 1):
            pair.page.frames[1 + frame].focus("#model")
            pair.page.keyboard.press(press)
            pair.wait_until_drawn()
            for value in ("turn", "pan"):
                first, second = pair.values(f"it.panes[0].camera.{value}")
                np.testing.assert_allclose(first, second, atol=1e-9)
            assert np.ptp(pair.values("it.panes[0].camera.scale")) < 1e-6
    pair.page.frames[2].focus("#layout")
    for press in ("+", "+", "ArrowLeft", "ArrowUp"):
        pair.page.keyboard.press(press)
    pair.wait_until_drawn()
    first, second = middle_and_scale(pair)
    np.testing.assert_allclose(first, second, rtol=1e-6)
    assert pair.values("it.panes[1].camera.zoom") != [1, 1]


def test_what_is_shown_is_linked(pair):
    pair.page.frames[1].select_option("#show", "qc")
    pair.page.frames[2].click("#seams")
    assert pair.values("it.state.get('show')") == ["qc", "qc"]
    assert pair.values("it.state.get('seams')") == [False, False]
    scales = pair.values("it.model.head.scales.qc.high")
    assert scales[0] == scales[1]
    pair.run(f"{FRAMES}[0].find({{kind: 'triangle', index: 7}})")
    assert pair.values("it.state.get('picked').index") == [7, 7]


def test_one_lies_over_the_other(pair):
    def visible():
        return [pair.page.locator("iframe").nth(i).is_visible() for i in (0, 1)]

    assert visible() == [True, True]
    widths = [pair.page.locator("iframe").nth(i).bounding_box()["width"] for i in (0, 1)]
    pair.page.click("#over")
    pair.wait_until_drawn()
    assert visible() == [True, False]
    boxes = [pair.page.locator("iframe").nth(i).bounding_box() for i in (0, 1)]
    assert boxes[0] == boxes[1]
    assert boxes[0]["width"] > 1.8 * widths[0]
    pair.page.frames[1].focus("#model")
    pair.page.keyboard.press("x")
    assert visible() == [False, True]
    assert "new.npz" in pair.page.inner_text("#seen")
    pair.wait_until_drawn()
    np.testing.assert_allclose(*middle_and_scale(pair), rtol=1e-6)
    pair.page.keyboard.press("o")
    assert visible() == [True, True]


def test_panes_have_the_same_size(pair):
    pair.run(f"{FRAMES}[0].controls.part('title').textContent = 'long '.repeat(90)")
    pair.wait_until_drawn()
    first, second = pair.values("it.panes.map((pane) => [pane.top, pane.width, pane.height])")
    pair.wait(f"new Set({FRAMES}.map((it) => it.panes[0].height)).size === 1")
    assert len(first) == len(second)


def test_on_a_phone_one_is_over_the_other(browser, pair_page):
    visit = Pair(browser, pair_page, viewport=NARROW, has_touch=True, is_mobile=True)
    assert visit.page.is_visible("#swap")
    for pane in (0, 1):
        # The whole model, and the whole layout, are in sight.
        assert min(visit.values(f"it.panes[{pane}].camera.zoom")) > 0.5
        assert max(visit.values(f"it.panes[{pane}].camera.zoom")) < 2
    visit.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_serious(browser, pair_page, scheme):
    source = axe_source()
    visit = Pair(browser, pair_page, color_scheme=scheme, bypass_csp=True)
    assert findings(visit.page, source) == []
    visit.close()


def test_common_ends_of_scales(results):
    ranges = common_ranges(results, Ranges())
    assert ranges.qc_max == max(conformal_distortion(result).scale.high for result in results)
    assert ranges.scale_max == max(stretch(result).scale.high for result in results)
    assert common_ranges(results, Ranges(qc_max=3)).qc_max == 3
