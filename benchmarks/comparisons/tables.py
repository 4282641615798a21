"""Tables of comparisons: Markdown, comma-separated values, and aligned text."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence

from .comparison import Comparison, Entry
from .methods import label_of

#: Heading of each column, its measure, and the format of its numbers.
COLUMNS = {
    "curvature error, pi": ("curvature_error_max", ".1e"),
    "QC mean": ("qc_mean", ".4f"),
    "QC 95%": ("qc_p95", ".4f"),
    "area std": ("area_std", ".3f"),
    "energy": ("energy", ".3f"),
    "flipped": ("flipped", ",d"),
    "overlap": ("overlap", ".2%"),
    "charts": ("charts", ",d"),
    "seam length": ("seam_length", ".2f"),
    "seam mismatch": ("seam_mismatch_max", ".1e"),
    "time, s": ("seconds", ".2f"),
}


def numbers(entry: Entry) -> list[float | int]:
    """Return the values of the columns for a method; NaN if it failed."""
    if entry.result is None:
        return [math.nan] * len(COLUMNS)
    distortion = entry.result.distortion
    measures = {
        **vars(distortion),
        "flipped": distortion.flipped + distortion.degenerate,
        "seconds": entry.seconds,
    }
    return [measures[measure] for measure, _ in COLUMNS.values()]


def as_cell(value: float | int, form: str) -> str:
    """Return a number as the text of a table cell; empty for NaN."""
    if isinstance(value, float) and not math.isfinite(value):
        return ""
    return format(int(value) if form.endswith("d") else value, form)


def as_markdown(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table as Markdown."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "".join(f"| {' | '.join(cell.replace('|', '/') for cell in line)} |\n" for line in lines)


def as_csv(headings: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return rows as comma-separated values; NaN is empty."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(headings)
    for row in rows:
        writer.writerow(["" if isinstance(value, float) and math.isnan(value) else value for value in row])
    return file.getvalue()


def comparison_rows(comparison: Comparison) -> list[list[str]]:
    """Return a row of cell texts for each method, without its note."""
    forms = [form for _, form in COLUMNS.values()]
    return [[label_of(entry.method), *map(as_cell, numbers(entry), forms)] for entry in comparison.entries]


def comparison_markdown(comparison: Comparison) -> str:
    """Return the table of methods and their notes as Markdown."""
    return f"{as_markdown(['method', *COLUMNS], comparison_rows(comparison))}\n{_notes(comparison)}"


def comparison_csv(comparison: Comparison) -> str:
    """Return the table of methods as comma-separated values, at full precision."""
    rows = [[entry.method, *numbers(entry), entry.note] for entry in comparison.entries]
    return as_csv(["method", *COLUMNS, "note"], rows)


def comparison_lines(comparison: Comparison) -> Iterator[str]:
    """Yield the table of methods as aligned lines of text, and the notes."""
    rows = [["method", *COLUMNS], *comparison_rows(comparison)]
    name_width, *widths = (max(map(len, column)) for column in zip(*rows, strict=True))
    for name, *cells in rows:
        aligned = (f"{cell:>{width}}" for cell, width in zip(cells, widths, strict=True))
        yield "  ".join([f"{name:{name_width}}", *aligned]).rstrip()
    yield from _notes(comparison).splitlines()


def _notes(comparison: Comparison) -> str:
    """Return a line for each note on a method."""
    return "".join(f"- {entry.method}: {entry.note}.\n" for entry in comparison.entries if entry.note)
