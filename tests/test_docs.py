"""Every Python example in the documentation runs, and what it prints of itself is true."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import coneflat
from coneflat.apps.cli.main import cli

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("**/*.md"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_examples_run(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    for block in re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
        exec(compile(block, str(page), "exec"), names)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), target


def test_readme_gives_the_shape_of_the_sample():
    result = coneflat.flatten(coneflat.sample_path(), max_cones=20)
    assert f"{result.corner_uv.shape}" in (ROOT / "README.md").read_text(encoding="utf-8")


def test_every_option_is_described():
    text = {
        name: (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8")
        for name in ("command-line", "figures")
    }
    pages = {"flatten": text["command-line"], "figure": text["figures"]}
    for name, command in cli.commands.items():
        assert f"coneflat {name}" in text["command-line"]
        for parameter in command.params:
            if name in pages and parameter.param_type_name == "option":
                assert any(f"{option}" in pages[name] for option in parameter.opts), parameter.name
