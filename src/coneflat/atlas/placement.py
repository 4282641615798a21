"""Placement of charts on a grid, one after the other: each where its top is lowest."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.jit import compiled
from .masks import Masks

#: Columns, one for each cell of tiles.
Cells: TypeAlias = NDArray[np.int16]


class Plan(NamedTuple):
    """The order in which k charts are placed, and restrictions on their placement.

    Attributes:
        order: (k,) the charts in the order of placement.
        allowed: (j,) True for the shapes that may be used.
        offset: (k,) minimum column of a chart, as a fraction of the free columns next to it.
    """

    order: IntArray
    allowed: BoolArray
    offset: FloatArray


def reach_of(gap: float) -> IntArray:
    """Return (d,) for each distance in rows, the distance in columns up to which two cells are closer than the gap.

    Points of two cells at a distance of a rows and b columns differ by at least (a - 1, b - 1) cells.
    """
    rows = np.arange(int(np.ceil(gap)) + 1)
    across = np.sqrt(np.maximum(gap**2 - np.maximum(rows - 1, 0) ** 2, 0.0))
    return np.ceil(across).astype(np.int64)


@compiled
def place_all(
    plan: Plan,
    group: IntArray,
    masks: Masks,
    reach: IntArray,
    tiles: int,
    width: int,
    limit: int,
    step: int,
    obstacles: IntArray,
) -> tuple[int, int, IntArray, IntArray]:
    """Fill tiles of cells from below: each chart is placed where its top is lowest, and leftmost among these places.

    Args:
        plan: the order of charts and the restrictions on their placement.
        group: (k,) group of each chart; charts of a group are so similar that none is tried below the previous one.
        masks: the shapes of charts, the same number for each chart.
        reach: (d,) two cells of different charts are too close if their distance is less than d rows and at most
            `reach[rows]` columns.
        tiles, width, limit: number of tiles, their columns, and the rows that may be used.
        step: columns and rows of lower left cells are multiples of it.
        obstacles: (r, 3) runs of cells of the first tile that other charts have: row, first and last column.

    Returns:
        The number of rows used, limit + 1 if a chart has no place; the work done, in comparisons of runs of cells; (k,)
        the shape of each chart; and (k, 3) its tile, and the column and row of its lower left cell.
    """
    size, runs, first, turns = masks.size, masks.runs, masks.first, len(masks.size) // len(plan.order)
    chosen, place = np.empty(len(plan.order), np.int64), np.empty((len(plan.order), 3), np.int64)
    # For each cell, the next occupied cell in its row, itself included, and the first free cell after that.
    taken, clear = filled_tiles(tiles, limit, width), filled_tiles(tiles, limit, width)
    if len(obstacles):
        occupy(taken[0], obstacles, 0, 0, reach)
        link_cells(taken[0], clear[0], 0, width, 0, limit)
    floor = np.zeros((tiles, group.max() + 1), np.int64)
    top, work, reach_rows, widest = 0, tiles * limit, len(reach) - 1, reach.max()
    for c in plan.order:
        best, shape, tile, column, row = limit + 1, -1, 0, 0, 0
        for j in range(c * turns, (c + 1) * turns):
            if not plan.allowed[j] or size[j, 0] > width:
                continue
            shape_runs, right = runs[first[j] : first[j + 1]], width - size[j, 0]
            for t in range(tiles):
                x, y, steps = find_lowest(
                    taken[t], clear[t], shape_runs, int(plan.offset[c] * right), right, floor[t, group[c]],
                    best - size[j, 1], step,
                )  # fmt: skip
                work += steps
                if y >= 0:
                    best, shape, tile, column, row = y + size[j, 1], j, t, x, y
        if shape < 0:
            return limit + 1, work, chosen, place
        chosen[c], place[c, 0], place[c, 1], place[c, 2] = shape, tile, column, row
        floor[tile, group[c]] = row
        top = max(top, best)
        occupy(taken[tile], runs[first[shape] : first[shape + 1]], column, row, reach)
        left, right = max(column - widest, 0), min(column + size[shape, 0] + widest, width)
        low, high = max(row - reach_rows, 0), min(best + reach_rows, limit)
        link_cells(taken[tile], clear[tile], left, right, low, high)
        # About 50 cells are visited in the time of a comparison.
        work += (
            (best - row + 2 * reach_rows) * width
            + 4 * reach_rows * reach_rows * (first[shape + 1] - first[shape])
        ) // 50
    return top, work, chosen, place


@compiled
def filled_tiles(tiles: int, rows: int, width: int) -> Cells:
    """Return (tiles, rows, width) cells that contain the width: tiles that are free."""
    cells = np.empty((tiles, rows, width), dtype=np.int16)
    for t in range(tiles):
        for y in range(rows):
            for x in range(width):
                cells[t, y, x] = width
    return cells


@compiled
def find_lowest(
    taken: Cells, clear: Cells, runs: IntArray, left: int, right: int, low: int, above: int, step: int
) -> tuple[int, int, int]:
    """Return the column and row of the lowest place where a shape fits, and the work.

    The column is from `left` to `right`, the row from `low` to below `above`, or -1 if the shape does not fit; both are
    multiples of `step`, as is `low`.
    """
    work, k = 0, 0
    left += -left % step
    for y in range(low, above, step):
        x, fits = left, 0
        while x <= right and fits < len(runs):
            work += 1
            row, start = y + runs[k, 0], x + runs[k, 1]
            if taken[row, start] <= x + runs[k, 2]:
                # Skip all columns at which this run hits the same occupied cells. The next place is tested with this
                # run first.
                x, fits = clear[row, start] - runs[k, 1], 0
                if step > 1:
                    x += -x % step
            else:
                fits += 1
                k = k + 1 if k + 1 < len(runs) else 0
        if x <= right:
            return x, y, work
    return left, -1, work


@compiled
def occupy(taken: Cells, runs: IntArray, column: int, row: int, reach: IntArray) -> None:
    """Mark the cells of a tile that are too close to a shape for other charts, each by its own column.

    Args:
        taken: (rows, columns) the cells of the tile, changed in place.
        runs: (r, 3) the runs of the shape.
        column, row: the place of its lower left cell.
        reach: see `place_all`.
    """
    (rows, columns), reach_rows = taken.shape, len(reach) - 1
    for k in range(len(runs)):
        middle, start, stop = row + runs[k, 0], column + runs[k, 1], column + runs[k, 2] + 1
        for y in range(max(middle - reach_rows, 0), min(middle + reach_rows + 1, rows)):
            out = reach[abs(y - middle)]
            for x in range(max(start - out, 0), min(stop + out, columns)):
                taken[y, x] = x


@compiled
def link_cells(taken: Cells, clear: Cells, left: int, right: int, low: int, high: int) -> None:
    """Update which occupied cell and which free cell follow each cell of some rows of a tile.

    Args:
        taken, clear: (rows, columns) the cells of the tile, changed in place; occupied cells contain their own column.
        left, right: columns between which cells were occupied; those to the left of them change as well.
        low, high: the rows.
    """
    width = taken.shape[1]
    for y in range(low, high):
        following, free = width, width
        if right < width:
            following, free = taken[y, right], clear[y, right]
        for x in range(right - 1, -1, -1):
            if taken[y, x] == x:
                free = free if following == x + 1 else x + 1
                following = x
            elif x < left and taken[y, x] == following and clear[y, x] == free:
                break  # What follows is the same as before, and so it is for all cells to the left.
            taken[y, x], clear[y, x] = following, free
