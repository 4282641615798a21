"""The documentation's site: built with warnings as errors, complete, and loading nothing from anywhere."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest
from axe import axe_source, findings
from chromium import ARGUMENTS, browser_path

import coneflat

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "images"
MAX_FILE, MAX_SITE = 250_000, 6_000_000  # bytes


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    for module in ("mkdocs", "material", "mkdocstrings", "mkdocstrings_handlers.python"):
        pytest.importorskip(module, reason="the site's tools are not installed (extra docs)")
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    return folder


class Loads(HTMLParser):
    """What a page loads when it is opened, and the names of its parts."""

    def __init__(self, path):
        super().__init__()
        self.loads, self.parts = [], set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.parts.add(attributes.get("id"))
        is_loaded = tag in ("script", "img", "iframe", "source")
        if tag == "link" and attributes.get("rel") in ("stylesheet", "icon", "preconnect", "preload"):
            is_loaded = True
        if is_loaded:
            self.loads += [attributes[name] for name in ("src", "href") if attributes.get(name)]


@pytest.mark.slow
def test_every_page_is_there(site):
    for page in (ROOT / "docs").glob("**/*.md"):
        assert (site / page.relative_to(ROOT / "docs")).with_suffix(".html").exists()


@pytest.mark.slow
def test_nothing_is_loaded_from_elsewhere(site):
    for page in site.glob("**/*.html"):
        for target in Loads(page).loads:
            assert not re.match(r"[a-z]+:|//", target), (page.name, target)
            if page.name != "404.html":  # which knows not from where it is seen
                assert (page.parent / target.split("?")[0].split("#")[0]).exists(), (page.name, target)
    for style in site.glob("**/*.css"):
        assert not re.search(r"(?:@import|url\()\s*[\"']?(?:https?:)?//", style.read_text(encoding="utf-8"))


@pytest.mark.slow
def test_all_public_names_are_described(site):
    parts = Loads(site / "reference" / "api.html").parts
    missing = [
        f"coneflat.{name}"
        for name in coneflat.__all__
        if name not in ("__version__", "errors", "ConeflatError", "GuaranteeWarning")
    ]
    assert [name for name in missing if name not in parts] == []


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api")
    if browser_path() is None:
        pytest.skip("there is no Chromium here")
    with playwright.sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=browser_path(), args=ARGUMENTS)
        yield opened
        opened.close()


@pytest.fixture
def visit(browser, site):
    """Opens a page of the site as a file, of a width in pixels."""
    contexts, requests = [], []

    def opened(name, width=1200, scheme="light"):
        contexts.append(browser.new_context(viewport={"width": width, "height": 844}, color_scheme=scheme))
        page = contexts[-1].new_page()
        page.on("request", lambda request: requests.append(request.url))
        page.goto((site / name).as_uri())
        page.wait_for_load_state("load")
        return page

    yield opened
    for context in contexts:
        context.close()
    assert [address for address in requests if not address.startswith(("file:", "data:", "about:"))] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ["index.html", "how-to/check.html"])
def test_search_works_in_pages_opened_as_files(visit, name):
    page = visit(name)
    page.click("input[name=query]")
    page.keyboard.type("texel density")
    page.wait_for_selector(".md-search-result__item", timeout=30_000)
    titles = page.locator(".md-search-result__item h1, .md-search-result__item h2").all_inner_texts()
    assert any("Texel density" in title for title in titles)
    page.locator(".md-search-result__link").first.click()
    page.wait_for_url("**/texels.html*")
    assert page.locator("[role=dialog]").get_attribute("aria-label") == "Search"


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1200, 390])
@pytest.mark.parametrize("name", ["index.html", "how-to/game-engine.html", "reference/viewer.html"])
def test_axe_finds_nothing_serious(visit, name, width, scheme):
    source = axe_source()
    assert findings(visit(name, width, scheme), source) == []


@pytest.mark.slow
def test_links_are_underlined(visit):
    page = visit("how-to/check.html")
    lines = page.locator(".md-content p a").evaluate_all(
        "(links) => links.map((link) => getComputedStyle(link).textDecorationLine)"
    )
    assert lines
    assert {*lines} == {"underline"}


@pytest.mark.slow
def test_tables_of_options_fit_a_phone(visit):
    page = visit("reference/command-line.html", 390)
    tables = page.locator(".md-typeset table:has(tbody td:first-child > code:first-child)")
    assert tables.count() > 5
    widths = tables.evaluate_all("(tables) => tables.map((table) => table.getBoundingClientRect().right)")
    assert max(widths) <= 390
    # A description is a block below the name, of the whole width.
    name, meaning = (
        tables.first.locator("tbody tr").first.locator("td").nth(k).bounding_box() for k in (0, 3)
    )
    assert meaning["y"] >= name["y"] + name["height"] - 1
    assert meaning["width"] > 250


def test_pictures_are_small_and_used():
    text = "".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs").glob("**/*.md"))
    text += (ROOT / "README.md").read_text(encoding="utf-8")
    sizes = {path.name: path.stat().st_size for path in IMAGES.iterdir()}
    assert {name: size for name, size in sizes.items() if size > MAX_FILE} == {}
    assert sum(sizes.values()) < MAX_SITE
    assert [name for name in sizes if f"images/{name}" not in text] == []
