"""Strips of cells, filled from below with the shapes of charts."""

from __future__ import annotations

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from ..compiled import compiled

# Cells that are cleared in the time of a comparison.
CELLS_PER_WORK = 50


@compiled
def place_all(
    order: IntArray,
    group: IntArray,
    turns: int,
    allowed: BoolArray,
    aside: FloatArray,
    size: IntArray,
    runs: IntArray,
    first: IntArray,
    widest: IntArray,
    reach: IntArray,
    strips: int,
    width: int,
    limit: int,
    chosen: IntArray,
    place: IntArray,
) -> tuple[int, int]:
    """Fill strips of cells from below: each chart goes where its top is lowest, and leftmost there.

    Args:
        order: (k,) charts in the order in which they are placed.
        group: (k,) charts of a group are so much alike that none is tried below where the one before was placed.
        turns: how many shapes a chart has: its cells at so many angles, those of chart 0 first.
        allowed: (j,) which shapes may be used.
        aside: (k,) how far to the right a chart is at least, relative to the room beside it.
        size: (j, 2) columns and rows of each shape.
        runs, first: the cells of each shape, see `masks.cover`.
        widest: (j,) the longest run of each shape.
        reach: (d,) a cell is too near to another chart's if they are less than d rows apart, and `reach` of the
            number of rows or fewer columns.
        strips, width, limit: number of strips, their columns, and the rows that may be used.
        chosen: (k,) filled: the shape of each chart.
        place: (k, 3) filled: its strip, and the column and row of its lower left cell.

    Returns:
        The rows used, limit + 1 if a chart has no place; and the work done, in comparisons of runs of cells.
    """
    # For each cell the next taken one, itself included, and the last of the taken ones in a row from there.
    taken = np.full((strips, limit, width), width, dtype=np.int16)
    last = np.empty((strips, limit, width), dtype=np.int16)
    longest_gap = np.full((strips, limit), width, dtype=np.int64)
    floor = np.zeros((strips, group.max() + 1), dtype=np.int64)
    top, work = 0, strips * limit * width // CELLS_PER_WORK
    for c in order:
        best, shape, strip, column, row = limit + 1, -1, 0, 0, 0
        for j in range(c * turns, (c + 1) * turns):
            if not allowed[j] or size[j, 0] > width:
                continue
            for s in range(strips):
                x, y, steps = _lowest(
                    taken[s], last[s], longest_gap[s], runs[first[j] : first[j + 1]], widest[j] - first[j],
                    int(aside[c] * (width - size[j, 0])), width - size[j, 0], floor[s, group[c]], best - size[j, 1],
                )  # fmt: skip
                work += steps
                if y >= 0:
                    best, shape, strip, column, row = y + size[j, 1], j, s, x, y
        if shape < 0:
            return limit + 1, work
        chosen[c] = shape
        floor[strip, group[c]] = row
        place[c, 0], place[c, 1], place[c, 2] = strip, column, row
        top = max(top, best)
        work += _take(
            taken[strip],
            last[strip],
            longest_gap[strip],
            runs[first[shape] : first[shape + 1]],
            column,
            row,
            reach,
        )
    return top, work


@compiled
def _lowest(
    taken: IntArray,
    last: IntArray,
    longest_gap: IntArray,
    runs: IntArray,
    widest: int,
    left: int,
    right: int,
    low: int,
    above: int,
) -> tuple[int, int, int]:
    """Return the lowest place where a shape fits, and the work.

    The row is from `low` to below `above`, -1 if there is none, the column from `left` to `right`.
    """
    count, work = len(runs), 0
    need = runs[widest, 2] - runs[widest, 1] + 1
    probe = widest
    for y in range(low, above):
        work += 1
        if longest_gap[y + runs[widest, 0]] < need:
            continue
        x, free, k = left, 0, probe
        while x <= right and free < count:
            work += 1
            row = y + runs[k, 0]
            hit = taken[row, x + runs[k, 1]]
            if hit <= x + runs[k, 2]:
                # Every place up to where this run has passed what it hit is out. Look here first in the next row, too.
                x = last[row, hit] + 1 - runs[k, 1]
                free, probe = 0, k
            else:
                free += 1
                k = k + 1 if k + 1 < count else 0
        if x <= right:
            return x, y, work
    return left, -1, work


@compiled
def _take(
    taken: IntArray, last: IntArray, longest_gap: IntArray, runs: IntArray, x: int, y: int, reach: IntArray
) -> int:
    """Take the cells of a shape and those too near to it, and return the work."""
    rows, width = taken.shape
    far = len(reach) - 1
    near = np.zeros(width, dtype=np.bool_)
    work = 0
    begin = 0  # the first run that reaches the row
    for row in range(max(y + runs[0, 0] - far, 0), min(y + runs[-1, 0] + far, rows - 1) + 1):
        while begin < len(runs) and y + runs[begin, 0] < row - far:
            begin += 1
        left, right, k = width, -1, begin
        while k < len(runs) and y + runs[k, 0] <= row + far:
            out = reach[abs(row - y - runs[k, 0])]
            start, stop = max(x + runs[k, 1] - out, 0), min(x + runs[k, 2] + out, width - 1)
            near[start : stop + 1] = True
            left, right = min(left, start), max(right, stop)
            work += 1 + (stop - start) // CELLS_PER_WORK
            k += 1
        if right < 0:
            continue
        _take_in_row(taken[row], last[row], near, left, right)
        near[left : right + 1] = False
        column, longest = 0, 0
        while column < width:
            longest = max(longest, taken[row, column] - column)
            column = last[row, taken[row, column]] + 1 if taken[row, column] < width else width
        longest_gap[row] = longest
    return work


@compiled
def _take_in_row(taken: IntArray, last: IntArray, near: BoolArray, left: int, right: int) -> None:
    """Take the near cells of a row, which lie from `left` to `right`, both near themselves."""
    following = taken[right + 1] if right + 1 < len(taken) else len(taken)
    end = last[following] if following == right + 1 and right + 1 < len(taken) else right
    column = right
    while column >= 0:
        if taken[column] == column or (column >= left and near[column]):
            if following != column + 1:
                if column < left:
                    return
                end = column
            following = column
            last[column] = end
        taken[column] = following
        column -= 1
