"""Comparisons as tables."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence

from ...base import list_some
from .run import Comparison, Entry

#: Heading of each column, and how a number below it is written.
COLUMNS = {
    "curvature error, pi": ".1e",
    "QC mean": ".4f",
    "QC 95%": ".4f",
    "area std": ".3f",
    "flipped": ",d",
    "overlap": ".2%",
    "charts": ",d",
    "seam length": ".2f",
    "seam mismatch": ".1e",
    "time, s": ".2f",
}


def numbers(entry: Entry) -> list[float | int]:
    """Return what the columns show of a method; NaN where there is nothing."""
    if entry.result is None:
        return [math.nan] * len(COLUMNS)
    d = entry.result.distortion
    return [
        d.curvature_error_max,
        d.qc_mean,
        d.qc_p95,
        d.area_std,
        d.flipped + d.degenerate,
        d.overlap,
        d.charts,
        d.seam_length,
        d.seam_mismatch_max,
        entry.seconds,
    ]


def written(value: float | int, form: str) -> str:
    """Return a number as it stands in a table; nothing for NaN."""
    if isinstance(value, float) and not math.isfinite(value):
        return ""
    return format(int(value) if form.endswith("d") else value, form)


def markdown(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "".join(f"| {' | '.join(cell.replace('|', '/') for cell in line)} |\n" for line in lines)


def comparison_rows(comparison: Comparison) -> list[list[str]]:
    """Return a row of text for each method, without its note."""
    return [
        [entry.method, *(written(n, form) for n, form in zip(numbers(entry), COLUMNS.values(), strict=True))]
        for entry in comparison.entries
    ]


def comparison_markdown(comparison: Comparison) -> str:
    """Return the methods in a table, and what is to be said of them."""
    return f"{markdown(['method', *COLUMNS], comparison_rows(comparison))}\n{notes([comparison])}"


def notes(comparisons: Sequence[Comparison]) -> str:
    """Return a line for each note that methods have, with the meshes that it is about where there are several."""
    meshes: dict[tuple[str, str], list[str]] = {}
    for comparison in comparisons:
        for entry in comparison.entries:
            if entry.note:
                meshes.setdefault((entry.method, entry.note), []).append(comparison.name)
    about = len(comparisons) > 1
    return "".join(
        f"- {method}{f' ({list_some(names)})' if about else ''}: {note}.\n"
        for (method, note), names in sorted(meshes.items())
    )


def comparison_csv(comparison: Comparison) -> str:
    """Return the methods as comma separated values, at full precision."""
    rows = [[entry.method, *numbers(entry), entry.note] for entry in comparison.entries]
    return as_csv(["method", *COLUMNS, "note"], rows)


def as_csv(headings: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return comma separated values; NaN is left empty."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(headings)
    for row in rows:
        writer.writerow(["" if isinstance(value, float) and math.isnan(value) else value for value in row])
    return file.getvalue()


def comparison_lines(comparison: Comparison) -> Iterator[str]:
    """Yield a line for each method, and the notes."""
    rows = [["method", *COLUMNS], *comparison_rows(comparison)]
    first, *widths = (max(map(len, column)) for column in zip(*rows, strict=True))
    for name, *cells in rows:
        numbers = (f"{cell:>{width}}" for cell, width in zip(cells, widths, strict=True))
        yield "  ".join([f"{name:{first}}", *numbers]).rstrip()
    yield from notes([comparison]).splitlines()
