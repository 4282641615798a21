"""All pages of a pattern: how it is put together, and its tiles."""

from __future__ import annotations

from ..result import Pattern
from .guide import guide_pages
from .pages import Page, tiled


def pattern_pages(pattern: Pattern, title: str) -> list[Page]:
    """Return the pages of a pattern: the assembly guide first on paper of a given size, else last.

    Args:
        pattern: the pattern.
        title: text in the margins.

    Raises:
        OptionError: a page as large as the pattern would be larger than a PDF allows.
    """
    tiles = tiled(pattern.drawing(), pattern.tiles, pattern.paper, title)
    guide = guide_pages(pattern, title)
    return [*guide, *tiles] if pattern.paper.height is not None else [*tiles, *guide]
