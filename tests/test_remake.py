"""What the documentation says in tables, drawings and numbers is what the program says of itself."""

from __future__ import annotations

import re

import pytest
from markers import NUMBER, PAGES, ROOT, blocks, fill, fill_numbers
from measured import Measured
from messages import list_messages
from remake import remake_options
from structure import draw_structure, names_by_level, packages_by_level, packages_drawn
from tables import TABLES, fill_page

SAYS = "python tools/remake.py remakes it"


def test_tables_of_options_are_those_declared():
    for page, text in remake_options():
        assert page.read_text(encoding="utf-8") == text, f"{page.name} is out of date: {SAYS}"


def test_the_drawing_shows_the_structure():
    drawing = (ROOT / "docs" / "images" / "structure.svg").read_text(encoding="utf-8")
    assert packages_drawn(drawing) == names_by_level(), f"structure.svg: {SAYS}"


def test_messages_are_listed():
    assert (ROOT / "tools" / "messages.txt").read_text(encoding="utf-8") == list_messages(), SAYS


def numbers_in(text: str) -> list[float]:
    return [float(word.replace(",", "")) for word in re.findall(r"[-+]?\d[\d,]*\.?\d*(?:e[-+]?\d+)?", text)]


def test_numbers_of_the_sample_are_those_of_today():
    """Counts exactly, what is measured to a hundredth; what is rounding stays rounding."""
    measured = Measured(ROOT / "no models")
    for page in (ROOT / "README.md", ROOT / "docs" / "index.md", ROOT / "docs" / "reference" / "python.md"):
        text = page.read_text(encoding="utf-8")
        made = fill_page(text, measured)
        for written, line in zip(text.splitlines(), made.splitlines(), strict=True):
            for was, now in zip(numbers_in(written), numbers_in(line), strict=True):
                is_equal = was == now if now == int(now) and now else abs(was - now) <= 0.01 * abs(now)
                assert is_equal or max(abs(was), abs(now)) < 1e-10, (
                    f"{page.name}: {written!r} is {line!r} now"
                )
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert any(match["what"].startswith("sample ") for match in NUMBER.finditer(readme))


def test_text_between_markers_is_replaced():
    page = "a\n\n<!-- table x -->\n\nold\n\n<!-- /table -->\n\n<!-- table y -->\n<!-- /table -->\n"
    filled = fill(page, "table x", "new")
    assert filled == page.replace("old", "new")
    assert list(blocks(filled, "table")) == [("table x", "new"), ("table y", "")]
    assert fill(filled, "table x", "new") == filled
    with pytest.raises(KeyError, match="there is no <!-- table z -->"):
        fill(page, "table z", "")
    cell = "| <!-- n hand cones -->14<!-- /n --> |"
    assert fill_numbers(cell, lambda definition, was: f"{definition} {was}") == cell.replace(
        "14", "hand cones 14"
    )


def test_numbers_of_models_that_are_not_there_stay(tmp_path, capsys):
    always = ("| sample |", "<!-- n sample", "table atlases", "table convergence")  # shapes are made, too
    stay = [page for page in PAGES if not any(word in page.read_text(encoding="utf-8") for word in always)]
    assert {"gallery.md", "cones.md"} <= {page.name for page in stay}
    for page in stay:
        text = page.read_text(encoding="utf-8")
        assert fill_page(text, Measured(tmp_path)) == text
    assert "is not in" in capsys.readouterr().out


def test_names_of_tables_and_numbers_are_known():
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        assert {name.split()[1] for name, _ in blocks(text, "table")} <= set(TABLES)
        for match in NUMBER.finditer(text):
            assert re.search(r"\d", match["value"]), match["what"]


def test_the_structure_is_drawn_from_imports(tmp_path):
    (tmp_path / "base.py").write_text('"""What every package uses."""\n')
    (tmp_path / "mesh.py").write_text('"""Meshes."""\n\nfrom . import base\n')
    drawn = packages_by_level(tmp_path)
    assert [[package.name for package in level] for level in drawn] == [["base"], ["mesh"]]
    (mesh,) = drawn[1]
    assert (mesh.size.files, mesh.size.lines, mesh.below) == (1, 1, {"base"})
    drawing = draw_structure(tmp_path)
    assert packages_drawn(drawing) == [["base"], ["mesh"]]
    assert drawing.count("marker-end") == 1
