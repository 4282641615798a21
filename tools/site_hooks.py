"""Changes of the pages of the documentation's site, called by MkDocs."""

from __future__ import annotations

from typing import Any

#: Replacements in the pages of the theme: names for assistive programs.
REPLACEMENTS = {
    'data-md-component="search" role="dialog"': 'data-md-component="search" role="dialog" aria-label="Search"',
}


def on_post_page(output: str, **_: Any) -> str:
    """Return the text of a page with the replacements.

    Raises:
        ValueError: the theme has changed, so that nothing is replaced.
    """
    for text, replacement in REPLACEMENTS.items():
        if text not in output:
            raise ValueError(f"the theme has no {text}")
        output = output.replace(text, replacement)
    return output
