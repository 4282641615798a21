"""A fast test for triangles that may overlap others: they touch grid cells that are covered twice or meet an outline.

The number of triangles that cover a point is the winding number of their sides around it. Sides of opposite directions
between the same points cancel. In a grid cell that none of the remaining sides meets, the number is constant.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.arrays import BoolArray, FloatArray, Int32Array, IntArray
from ..base.jit import compiled

# Number of cells along a side of the grid, divided by the square root of the number of triangles, and its maximum.
CELLS_PER_ROOT, MAX_CELLS = 1.5, 2048
# Number of triangles below which no grid is used, and mean number of rows that a side crosses above which none is used.
MIN_TRIANGLES, MAX_ROWS_PER_SIDE = 2000, 20


def may_overlap(corners: FloatArray, signs: IntArray, is_open: BoolArray) -> IntArray:
    """Return the triangles with area that may overlap others; all that do overlap are among them.

    Args:
        corners: (m, 3, 2) corners of the triangles.
        signs: (m,) 1 counterclockwise, -1 clockwise, 0 without area.
        is_open: (3m,) True for half-edges that do not cancel in pairs; see `mesh.charts.open_sides`.
    """
    every = np.flatnonzero(signs)
    if len(every) < MIN_TRIANGLES:
        return every
    sides = np.flatnonzero(is_open & np.repeat(signs != 0, 3))
    face, corner = sides // 3, sides % 3
    ends = np.stack([corners[face, (corner + 1) % 3], corners[face, (corner + 2) % 3]], axis=1)
    ends = np.where((signs[face] < 0)[:, None, None], ends[:, ::-1], ends)
    flat = np.ascontiguousarray(corners).reshape(-1, 6)
    x, y = corners[..., 0], corners[..., 1]  # NumPy is slow at extrema of pairs
    low, extent = (float(x.min()), float(y.min())), float(max(np.ptp(x), np.ptp(y)))
    count = min(int(CELLS_PER_ROOT * math.sqrt(len(corners))), MAX_CELLS)
    # The extent is half a cell less than the grid, so that the points of largest coordinates are in the last cells.
    scale = (count - 0.5) / extent if extent > 0 else 0.0
    if not 0 < scale < np.inf or np.abs(np.diff(ends[..., 1])).sum() * scale > MAX_ROWS_PER_SIDE * len(every):
        return every
    grid = *low, scale
    marks, steps = np.zeros((2, count + 2, count + 2), dtype=np.int32)
    trace_sides(ends.reshape(-1, 4), *grid, marks, steps)
    sum_cells(marks, steps)
    return np.flatnonzero(find_suspected(flat, signs, *grid, marks))


@compiled
def trace_sides(
    sides: FloatArray, x: float, y: float, scale: float, marks: Int32Array, steps: Int32Array
) -> None:
    """Mark the cells in the bounding boxes of sides (k, 4), and count where sides cross the middle lines of rows.

    The column of a crossing may be wrong by rounding; both columns are then in the box of the side, which is marked.

    x, y, scale: the corner of the grid of square cells, and the number of cells per unit of length.
    marks, steps: (c + 1, c + 1) or larger, zeros on entry; differences between consecutive cells on return, see
        `sum_cells`.
    """
    for i in range(len(sides)):
        x0, y0, x1, y1 = sides[i]
        left, right = int((min(x0, x1) - x) * scale), int((max(x0, x1) - x) * scale)
        bottom, top = int((min(y0, y1) - y) * scale), int((max(y0, y1) - y) * scale)
        marks[bottom, left] += 1
        marks[bottom, right + 1] -= 1
        marks[top + 1, left] -= 1
        marks[top + 1, right + 1] += 1
        for row in range(bottom, top + 1):
            middle = y + (row + 0.5) / scale
            if (y0 <= middle) != (y1 <= middle):
                crossing = x0 + (middle - y0) / (y1 - y0) * (x1 - x0)
                column = min(max(int((crossing - x) * scale), left), right)
                # A side that runs downwards adds 1 to the winding number of all points to its right.
                steps[row, column + 1] += 1 if y1 < y0 else -1


@compiled
def sum_cells(marks: Int32Array, steps: Int32Array) -> None:
    """Sum the differences; on return, `marks` has the number of suspected cells up to each row and column.

    A cell is suspected if it is in the box of a side or is covered more than once. The last row and column are zeros.
    """
    rows, columns = marks.shape[0] - 1, marks.shape[1] - 1
    for row in range(rows):
        marked, layers = 0, 0
        for column in range(columns):
            marked += marks[row, column]
            layers += steps[row, column]
            marks[row, column] = marked + marks[row - 1, column]
            steps[row, column] = layers
    for row in range(rows):
        along = 0
        for column in range(columns):
            along += 1 if marks[row, column] > 0 or abs(steps[row, column]) > 1 else 0
            # This cell now has a two-dimensional prefix sum; the rows that follow still have their marks.
            marks[row, column] = along + marks[row - 1, column]


@compiled
def find_suspected(
    corners: FloatArray, signs: IntArray, x: float, y: float, scale: float, sums: Int32Array
) -> BoolArray:
    """Return (m,) which triangles (m, 6) with area have suspected cells in their bounding boxes."""
    is_suspected = np.zeros(len(corners), np.bool_)
    for t in range(len(corners)):
        c = corners[t]
        left, right = int((min(c[0], c[2], c[4]) - x) * scale), int((max(c[0], c[2], c[4]) - x) * scale)
        bottom, top = int((min(c[1], c[3], c[5]) - y) * scale), int((max(c[1], c[3], c[5]) - y) * scale)
        # The last row and column are zeros, at the index -1.
        inside = sums[top, right] - sums[top, left - 1] - sums[bottom - 1, right] + sums[bottom - 1, left - 1]
        is_suspected[t] = signs[t] != 0 and inside > 0
    return is_suspected
