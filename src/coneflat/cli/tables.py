"""Comparisons in the terminal."""

from __future__ import annotations

import io
from collections.abc import Iterator

from rich.console import Console
from rich.table import Table

from ..compare import Comparison
from ..compare.table import COLUMNS, comparison_rows, notes

WIDTH = 150


def comparison_lines(comparison: Comparison) -> Iterator[str]:
    """Yield a line for each method, and the notes."""
    table = Table(box=None, pad_edge=False)
    for heading in ("method", *COLUMNS):
        table.add_column(heading, justify="left" if heading == "method" else "right")
    for cells in comparison_rows(comparison):
        table.add_row(*cells)
    text = io.StringIO()
    Console(file=text, width=WIDTH, highlight=False, color_system=None).print(table)
    yield from (line.rstrip() for line in text.getvalue().splitlines())
    yield from notes([comparison]).splitlines()
