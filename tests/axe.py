"""Checks of pages by axe-core, where it is installed: AXE=/path/to/axe.min.js, or node_modules beside it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PLACES = [folder / "node_modules" / "axe-core" / "axe.min.js" for folder in (ROOT, ROOT.parent)]
GRAVE = ("serious", "critical")


def axe_source():
    """The script of axe-core; a test that asks for it is skipped where it is not installed."""
    named = os.environ.get("AXE")
    path = next((path for path in ([Path(named)] if named else PLACES) if path.exists()), None)
    if path is None:
        pytest.skip("axe-core is not installed: npm install axe-core, AXE=/path/to/axe.min.js")
    return path.read_text(encoding="utf-8")


def findings(page, source):
    """What axe-core finds on an open page, except what it calls minor or moderate; headings in order as well."""
    page.evaluate(source)
    results = page.evaluate("axe.run()")["violations"]
    return [
        f"{result['id']}: {node['html'][:120]}"
        for result in results
        for node in result["nodes"]
        if result["impact"] in GRAVE or result["id"] == "heading-order"
    ]
