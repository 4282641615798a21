"""A page that compares two results: two pages of the viewer with linked views."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

from .page.webpage import POLICY, read_part
from .quantity import MAX_END, Ranges, conformal_distortion, stretch

if TYPE_CHECKING:
    from ... import Flattening


def common_ranges(results: Sequence[Flattening], ranges: Ranges) -> Ranges:
    """Return ends of colour scales that fit the values of all results; those that are given stay."""
    qc_max, scale_max = ranges.qc_max, ranges.scale_max
    if qc_max is None:
        qc_max = min(max(conformal_distortion(result).scale.high for result in results), MAX_END)
    if scale_max is None:
        scale_max = min(max(stretch(result).scale.high for result in results), MAX_END)
    return Ranges(qc_max, scale_max)


def comparison_html(first: str, second: str, *, names: tuple[str, str]) -> str:
    """Return the HTML page that shows two pages of `page_html` side by side, or one over the other.

    Their cameras and what they show are linked; layouts have the same UVs in the middle.

    Args:
        first, second: the two pages.
        names: what each shows.
    """
    frames = "\n".join(
        f'<iframe title="{escape(name)}" srcdoc="{escape(page)}"></iframe>'
        for page, name in zip((first, second), names, strict=True)
    )
    text = read_part("compare.html")
    for mark, content in (
        ("{{policy}}", POLICY),
        ("{{title}}", escape(" and ".join(names))),
        ("{{style}}", read_part("page.css") + read_part("compare.css")),
        ("{{script}}", read_part("compare.js")),
        ("{{frames}}", frames),
    ):
        text = text.replace(mark, content)
    return text
