"""Charts as sets of cells of a grid, each at several angles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import FloatArray, IntArray
from ..compiled import compiled
from .charts import Outlines


@dataclass(frozen=True, eq=False)
class Masks:
    """j = k * t shapes, which are k charts at t angles each; every cell that a chart has a point in belongs to it.

    Attributes:
        cell: width of a cell, in the unit of the outlines.
        turns: t.
        angle: (j,) that the chart is turned by, radians; those of chart 0 come first.
        low: (j,) lower left corner of the turned chart, which is that of the shape's lower left cell.
        size: (j, 2) columns and rows.
        runs: (r, 3) row, first and last column of cells in a row.
        first: (j + 1,) the first run of each shape.
        widest: (j,) the longest run of each shape.
    """

    cell: float
    turns: int
    angle: FloatArray
    low: NDArray[np.complex128]
    size: IntArray
    runs: IntArray
    first: IntArray
    widest: IntArray

    @property
    def cells(self) -> IntArray:
        """(k,) how many cells each chart has at the first of its angles."""
        length = self.runs[:, 2] - self.runs[:, 1] + 1
        cells: IntArray = np.add.reduceat(length, self.first[:-1])[:: self.turns]
        return cells


def cover_charts(outlines: Outlines, angles: FloatArray, cell: float) -> Masks:
    """Return the cells, of the given width, of charts turned by (k, t) angles."""
    count, turns = angles.shape
    low, extent = turned_boxes(outlines, angles)
    size = np.column_stack([extent.real.ravel() // cell, extent.imag.ravel() // cell]).astype(np.int64) + 1
    first = np.empty(count * turns + 1, dtype=np.int64)
    runs = np.empty((0, 3), dtype=np.int64)
    found = 2 * int(size[:, 1].sum())
    while found > len(runs):
        runs = np.empty((found, 3), dtype=np.int64)
        found = cover(
            outlines.sides.view(np.float64),
            outlines.start,
            np.repeat(np.arange(count), turns),
            np.column_stack([np.cos(angles).ravel(), np.sin(angles).ravel()]),
            low.ravel().view(np.float64).reshape(-1, 2),
            size,
            cell,
            runs,
            first,
        )
    runs = runs[:found]
    shape = np.repeat(np.arange(count * turns), np.diff(first))
    longest = np.lexsort((runs[:, 1] - runs[:, 2], shape))[first[:-1]]
    return Masks(cell, turns, angles.ravel(), low.ravel(), size, runs, first, longest)


def turned_boxes(
    outlines: Outlines, angles: FloatArray
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return (k, t) lower left corners of the boxes around charts turned by angles, and their widths and heights."""
    low, high = np.empty((2, *angles.shape), dtype=np.complex128)
    points, start = outlines.sides.ravel(), 2 * outlines.start[:-1]
    chart = np.repeat(np.arange(len(outlines)), 2 * np.diff(outlines.start))
    for i, turn in enumerate(np.exp(1j * angles).T):
        turned = points * turn[chart]
        for part in ("real", "imag"):
            setattr(low[:, i], part, np.minimum.reduceat(getattr(turned, part), start))
            setattr(high[:, i], part, np.maximum.reduceat(getattr(turned, part), start))
    return low, high - low


@compiled
def cover(
    sides: FloatArray,
    start: IntArray,
    chart: IntArray,
    turn: FloatArray,
    low: FloatArray,
    size: IntArray,
    cell: float,
    runs: IntArray,
    first: IntArray,
) -> int:
    """Find the cells that a chart has a point in, at several angles, as runs along rows.

    Args:
        sides: (s, 4) ends of the sides of outlines.
        start: (k + 1,) the first side of each chart.
        chart, turn: (j,) the chart of each shape and (j, 2) cosine and sine of the angle it is turned by.
        low, size: (j, 2) lower left corner of the turned chart, and the columns and rows of cells from there.
        cell: width of a cell.
        runs: (r, 3) filled: row, first and last column.
        first: (j + 1,) filled: the first run of each shape.

    Returns:
        The number of runs; where r is smaller, the rest was left out.
    """
    found = 0
    for j in range(len(chart)):
        first[j] = found
        rows, columns = size[j, 1], size[j, 0]
        winding = np.zeros((rows, columns + 1), dtype=np.int32)
        touched = np.zeros((rows, columns + 1), dtype=np.int32)
        cosine, sine = turn[j, 0], turn[j, 1]
        for k in range(start[chart[j]], start[chart[j] + 1]):
            x0 = (sides[k, 0] * cosine - sides[k, 1] * sine - low[j, 0]) / cell
            y0 = (sides[k, 0] * sine + sides[k, 1] * cosine - low[j, 1]) / cell
            x1 = (sides[k, 2] * cosine - sides[k, 3] * sine - low[j, 0]) / cell
            y1 = (sides[k, 2] * sine + sides[k, 3] * cosine - low[j, 1]) / cell
            if y0 <= y1:
                _mark(x0, y0, x1, y1, 1, winding, touched)
            else:
                _mark(x1, y1, x0, y0, -1, winding, touched)
        for row in range(rows):
            around, on, inside = 0, 0, False
            for column in range(columns):
                around += winding[row, column]
                on += touched[row, column]
                if around != 0 or on > 0:
                    if found < len(runs):
                        if not inside:
                            runs[found, 0], runs[found, 1] = row, column
                        runs[found, 2] = column
                    inside = True
                elif inside:
                    found += 1
                    inside = False
            if inside:
                found += 1
    first[len(chart)] = found
    return found


@compiled
def _mark(
    x0: float, y0: float, x1: float, y1: float, sign: int, winding: IntArray, touched: IntArray
) -> None:
    """Mark the cells that a side going up runs through, and where rows of cell centres cross it."""
    rows, columns = touched.shape[0], touched.shape[1] - 1
    slope = (x1 - x0) / (y1 - y0) if y1 > y0 else 0.0
    for row in range(max(int(y0), 0), min(int(y1), rows - 1) + 1):
        if y1 > y0:
            a, b = x0 + (max(y0, row) - y0) * slope, x0 + (min(y1, row + 1.0) - y0) * slope
        else:
            a, b = x0, x1
        left = min(max(int(min(a, b)), 0), columns - 1)
        right = min(max(int(max(a, b)), 0), columns - 1)
        touched[row, left] += 1
        touched[row, right + 1] -= 1
        centre = row + 0.5
        if y0 <= centre < y1:
            column = int(np.ceil(x0 + (centre - y0) * slope - 0.5))
            winding[row, min(max(column, 0), columns)] += sign
