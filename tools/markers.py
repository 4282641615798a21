"""Text between markers in the documentation; markers are comments that are not displayed.

A block stands between `<!-- name -->` and `<!-- /name -->`; only the first word of a name is repeated at its end, as in
`<!-- table gallery -->` and `<!-- /table -->`. A number in a sentence or a cell stands between `<!-- n what -->` and
`<!-- /n -->`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("**/*.md")))
NUMBER = re.compile(r"(<!-- n (?P<what>[^>]+?) -->)(?P<value>[^<]*)(<!-- /n -->)")


def _block(name: str) -> re.Pattern[str]:
    return re.compile(
        rf"(?<=<!-- {re.escape(name)} -->\n)(?P<body>.*?)(?=<!-- /{name.split()[0]} -->)", re.DOTALL
    )


def blocks(text: str, word: str) -> Iterator[tuple[str, str]]:
    """Yield the name and the content of each block of a page whose name begins with a word."""
    for match in re.finditer(rf"<!-- ({word}(?: [^>]+?)?) -->\n(.*?)<!-- /{word} -->", text, re.DOTALL):
        yield match[1], match[2].strip("\n")


def fill(text: str, name: str, body: str) -> str:
    """Return a page with a block of that name filled.

    Raises:
        KeyError: it has no such block.
    """
    filled, count = _block(name).subn(lambda _: f"\n{body}\n\n", text)
    if not count:
        raise KeyError(f"there is no <!-- {name} -->")
    return filled


def fill_numbers(text: str, value_of: Callable[[str, str], str]) -> str:
    """Return a page with its numbers filled: by what is said of each, and what stands there."""
    return NUMBER.sub(lambda match: match[1] + value_of(match["what"], match["value"]) + match[4], text)
