"""The studio's controls in a browser: clicks while answers arrive, and values that are not met."""
# ruff: noqa: F811  (fixtures that are imported)

from __future__ import annotations

import threading

import pytest
from browsing import need_browser
from studio_browsing import sample, studio, visit  # noqa: F401

need_browser()


@pytest.fixture
def held(visit):
    """Hold the actions of the page back until it is called."""
    waiting, are_free = [], threading.Event()

    def hold(route):
        if are_free.is_set():
            route.continue_()
        else:
            waiting.append(route)

    visit.page.route("**/act", hold)

    def release():
        are_free.set()
        while waiting:
            waiting.pop(0).continue_()

    return release


def tell(visit, studio):
    """Have the page hear of a change that its controls do not show."""
    before = studio.session.version
    studio.session.act({"do": "units", "of_file": "mm" if before % 2 else "cm", "shown": ""})
    visit.wait(f"studio.news.version > {before}")


def test_a_click_on_a_checkbox_holds_while_older_answers_arrive(visit, studio, held):
    page = visit.page
    visit.settle()
    page.select_option("#purpose", "texture")
    held_text = page.input_value("#purpose")
    tell(visit, studio)
    assert page.input_value("#purpose") == held_text == "texture"
    held()
    visit.settle()
    assert visit.choices()["for_texture"]
    assert not page.is_checked("#no-more")


def test_a_checkbox_stays_checked_while_older_answers_arrive(visit, studio, held):
    page = visit.page
    visit.settle()
    studio.session.act({"do": "texture", "value": True})
    visit.settle()
    page.click("#no-more")
    tell(visit, studio)
    assert page.is_checked("#no-more")
    held()
    visit.settle()
    assert page.is_checked("#no-more")
    assert visit.choices()["options"] == {"seams": "none"}


def test_a_refused_value_is_shown_as_it_was(visit, studio):
    page = visit.page
    visit.settle()
    page.select_option("#purpose", "texture")
    visit.settle()
    page.fill("#max-energy", "3")
    page.keyboard.press("Enter")
    visit.wait("studio.refused && !studio.isBehind()")
    page.locator("#model").focus()
    tell(visit, studio)
    assert page.input_value("#max-energy") == "4.1"
    visit.troubles.clear()  # The browser reports the refused request.


def test_a_button_that_is_pressed_is_not_replaced(visit, studio):
    """Cones are listed again between the press and the release."""
    page = visit.page
    visit.settle()
    cone = visit.cones()[0]
    page.locator(f"#cone-list .cone[data-vertex='{cone}'] .toggle").hover()
    page.mouse.down()
    studio.session.act({"do": "set", "name": "stretch", "value": 0.3})
    visit.wait(f"studio.news.version >= {studio.session.version}")
    assert studio.session.wait_until_idle(60)
    visit.wait("studio.news.layout === studio.layout && !studio.news.busy")
    page.mouse.up()
    visit.settle()
    assert cone in [chosen["vertex"] for chosen in visit.choices()["cones"] if chosen["locked"]]
    visit.wait(
        f"document.querySelector('#cone-list .cone[data-vertex=\"{cone}\"] .toggle').ariaPressed === 'true'"
    )


def test_a_number_that_is_not_met_is_told_beside_its_field(visit):
    page = visit.page
    visit.settle()
    page.select_option("#cones-by", "cone_count")
    visit.settle()
    assert page.is_hidden("#on-cone_count")
    page.fill("#cone-count", "500")
    page.keyboard.press("Enter")
    visit.settle()
    assert page.inner_text("#on-cone_count").startswith(
        f"{len(visit.cones())} cones instead of the 500 asked for"
    )
    assert page.input_value("#cone-count") == "500"
    page.select_option("#cones-by", "distortion")
    visit.settle()
    assert page.is_hidden("#on-cone_count")
