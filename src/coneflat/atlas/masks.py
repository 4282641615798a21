"""Shapes of rotated charts on a grid: the cells that they touch."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import FloatArray, IntArray
from ..base.jit import compiled
from .charts import Outlines


class Masks(NamedTuple):
    """Rasterized shapes of k charts at t angles each, j = k * t in all; a shape has every cell that its chart touches.

    Attributes:
        cell: width of a cell, in the unit of the outlines.
        angle: (j,) angle by which the chart is rotated, radians; those of chart 0 come first.
        low: (j,) lower left corner of the box of the rotated chart and of the shape's lower left cell.
        size: (j, 2) columns and rows.
        runs: (r, 3) runs of adjacent cells: row, first and last column.
        first: (j + 1,) the first run of each shape.
    """

    cell: float
    angle: FloatArray
    low: NDArray[np.complex128]
    size: IntArray
    runs: IntArray
    first: IntArray


def cover_charts(outlines: Outlines, angles: FloatArray, cell: float) -> Masks:
    """Return the shapes of charts rotated by (k, t) angles, in radians, on a grid of the given cell width."""
    low, extent = rotated_boxes(outlines, angles)
    size = np.column_stack([extent.real.ravel() // cell, extent.imag.ravel() // cell]).astype(np.int64) + 1
    runs, first = cover(outlines.sides, outlines.start, angles, low, size, cell)
    return Masks(cell, angles.ravel(), low.ravel(), size, runs, first)


def rotated_boxes(
    outlines: Outlines, angles: FloatArray
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return (k, t) lower left corners and (k, t) extents, as complex numbers, of the boxes around rotated charts."""
    start, chart = 2 * outlines.start[:-1], np.repeat(np.arange(len(outlines)), 2 * np.diff(outlines.start))
    turned = outlines.sides.reshape(-1, 1) * np.exp(1j * angles)[chart]
    low, high = (
        pick.reduceat(turned.real, start) + 1j * pick.reduceat(turned.imag, start)
        for pick in (np.minimum, np.maximum)
    )
    return low, high - low


@compiled
def cover(
    sides: NDArray[np.complex128],
    start: IntArray,
    angles: FloatArray,
    low: NDArray[np.complex128],
    size: IntArray,
    cell: float,
) -> tuple[IntArray, IntArray]:
    """Return (r, 3) runs of the cells that rotated charts touch, and (j + 1,) the first run of each shape.

    A run is its row, its first and its last column.

    Args:
        sides: (s, 2) end points of the sides of outlines.
        start: (k + 1,) the first side of each chart.
        angles: (k, t) angles by which charts are rotated, radians.
        low: (k, t) lower left corner of the rotated chart.
        size: (j, 2) number of columns and rows of cells from there.
        cell: width of a cell.
    """
    runs, count, first = np.empty((1024, 3), np.int64), 0, np.zeros(angles.size + 1, np.int64)
    for j in range(angles.size):
        chart, t = j // angles.shape[1], j % angles.shape[1]
        left, below = low[chart, t].real / cell, low[chart, t].imag / cell
        cosine, sine = math.cos(angles[chart, t]) / cell, math.sin(angles[chart, t]) / cell
        columns, rows = size[j]
        winding = np.zeros((rows, columns + 1), np.int32)
        touched = np.zeros((rows, columns + 1), np.int32)
        for k in range(start[chart], start[chart + 1]):
            x0, y0 = sides[k, 0].real, sides[k, 0].imag
            x1, y1 = sides[k, 1].real, sides[k, 1].imag
            x0, y0 = x0 * cosine - y0 * sine - left, x0 * sine + y0 * cosine - below
            x1, y1 = x1 * cosine - y1 * sine - left, x1 * sine + y1 * cosine - below
            mark_side(x0, y0, x1, y1, winding, touched)
        runs, count = append_runs(winding, touched, runs, count)
        first[j + 1] = count
    return runs[:count], first


@compiled
def mark_side(x0: float, y0: float, x1: float, y1: float, winding: IntArray, touched: IntArray) -> None:
    """Mark the cells that a side passes through, and where it crosses the lines of cell centres.

    Args:
        x0, y0, x1, y1: the ends of the side, in cells.
        winding, touched: (rows, columns + 1) the changes from the cell on the left of the winding number, and of the
            number of sides that pass through; added to in place.
    """
    rows, columns, sign = touched.shape[0], touched.shape[1] - 1, 1
    if y0 > y1:
        x0, y0, x1, y1, sign = x1, y1, x0, y0, -1
    slope = (x1 - x0) / (y1 - y0) if y1 > y0 else 0.0
    for row in range(max(int(y0), 0), min(int(y1), rows - 1) + 1):
        a, b = x0, x1
        if y1 > y0:
            a, b = x0 + (max(y0, row) - y0) * slope, x0 + (min(y1, row + 1.0) - y0) * slope
        touched[row, min(max(int(min(a, b)), 0), columns - 1)] += 1
        touched[row, min(max(int(max(a, b)), 0), columns - 1) + 1] -= 1
        if y0 <= row + 0.5 < y1:
            column = math.ceil(x0 + (row + 0.5 - y0) * slope - 0.5)
            winding[row, min(max(column, 0), columns)] += sign


@compiled
def append_runs(winding: IntArray, touched: IntArray, runs: IntArray, count: int) -> tuple[IntArray, int]:
    """Return runs with those of a shape appended, in a longer array if necessary, and their number.

    Args:
        winding, touched: what the sides of the shape have marked, see `mark_side`.
        runs, count: an array of runs, and the number of its rows in use.
    """
    rows, columns = touched.shape[0], touched.shape[1] - 1
    for row in range(rows):
        around, on, inside = 0, 0, False
        for column in range(columns):
            if winding[row, column] == 0 and touched[row, column] == 0:
                continue
            around += winding[row, column]
            on += touched[row, column]
            is_in = around != 0 or on > 0
            if is_in and not inside:
                if count == len(runs):
                    runs = doubled(runs)
                runs[count, 0], runs[count, 1], runs[count, 2] = row, column, columns - 1
                count += 1
            elif inside and not is_in:
                runs[count - 1, 2] = column - 1
            inside = is_in
    return runs, count


@compiled
def doubled(runs: IntArray) -> IntArray:
    """Return an array of twice as many rows that begins with the given ones (r, 3)."""
    longer = np.empty((2 * len(runs), 3), np.int64)
    for i in range(len(runs)):
        for x in range(3):
            longer[i, x] = runs[i, x]
    return longer
