"""Tables of pieces and seams on pages."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ....base import FloatArray
from ..drawing.drawing import Line, Text
from ..drawing.labels import text_width

# Height of a row, of its text and of headings, and distance of tables, mm.
ROW, SIZE, HEADING, SPACE = 4.6, 2.1, 3.2, 8.0
# Smallest number of rows of a part of a table.
MIN_ROWS = 3
# Space between columns, mm.
COLUMN_SPACE = 4.0


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        title: its heading.
        columns: the headings of the columns.
        rows: the texts of the rows.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    @property
    def widths(self) -> list[float]:
        """The widths of the columns, mm."""
        return [
            max(text_width(text, SIZE) for text in column) + COLUMN_SPACE
            for column in zip(self.columns, *self.rows, strict=True)
        ]


def laid_out(
    tables: Sequence[Table], low: FloatArray, high: FloatArray
) -> list[tuple[list[Line], list[Text]]]:
    """Return the lines and texts of tables on as many pages as they need, in columns from the left.

    Args:
        tables: the tables.
        low, high: (2,) the corners of the part of a page that may be used, mm.
    """
    pages: list[tuple[list[Line], list[Text]]] = [([], [])]
    left, top, widest = float(low[0]), float(high[1]), 0.0
    for table in tables:
        width, rows = sum(table.widths), list(table.rows)
        widest = max(width, widest if top < high[1] else 0.0)
        while rows:
            room = int((top - low[1] - HEADING - 3 * ROW) / ROW)
            if left + width > high[0] + 1e-6 and left > low[0]:
                pages.append(([], []))
                left, top = float(low[0]), float(high[1])
                continue
            if room < min(len(rows), MIN_ROWS):
                left, top, widest = left + widest + SPACE, float(high[1]), width
                continue
            part, rows = rows[:room], rows[room:]
            lines, texts = pages[-1]
            bottom = _draw(table, part, left, top, lines, texts)
            top = bottom - SPACE
    return pages


def _draw(
    table: Table,
    rows: Sequence[tuple[str, ...]],
    left: float,
    top: float,
    lines: list[Line],
    texts: list[Text],
) -> float:
    """Draw a part of a table, and return its lower end."""
    widths = table.widths
    middle = left + np.cumsum(widths) - np.array(widths) / 2
    texts.append(Text(table.title, np.array([left, top - HEADING / 2]), HEADING, is_left=True))
    y = top - HEADING - ROW
    texts += _row(table.columns, middle, y)
    y -= ROW / 2
    lines.append(Line("mark", np.array([[left, y], [left + sum(widths), y]])))
    for row in rows:
        y -= ROW
        texts += _row(row, middle, y + ROW / 2)
    return y


def _row(cells: Sequence[str], middle: FloatArray, y: float) -> Iterator[Text]:
    return (
        Text(cell, np.array([x, y]), SIZE) for cell, x in zip(cells, middle.tolist(), strict=True) if cell
    )
