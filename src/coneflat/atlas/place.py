"""The search for a tight packing: charts placed one after the other, in orders and at angles that are tried."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.compiled import compiled
from ..base.progress import check_cancelled
from ..errors import OptionError
from .charts import Outlines

# Columns of the grid at least, those that so many charts need, and cells of all tiles at most.
MIN_COLUMNS, COLUMNS_PER_CHART, MAX_CELLS = 400, 24.0, 4_000_000
# Changes that are tried, and work that ends them earlier, in comparisons of runs of cells: about a second.
MAX_TRIES, MAX_WORK = 150, 40_000_000
# So few charts may keep to the right, too, and one does in this part of the tries. Of more, that does harm.
ASIDE_CHARTS, ASIDE_SHARE = 5, 0.3
# Of more charts than GROUPED_CHARTS, those whose boxes differ by less than this factor count as alike.
GROUPED_CHARTS, GROUP_RATIO = 1000, 1.02
# The grid is so much wider than charts without gaps would need, and than the longest of them; no round number, so that
# simple charts do not end where cells do and leave it to rounding which cell is the last.
GRID_MARGIN = 1.2347


@dataclass(frozen=True, eq=False)
class Packing:
    """Charts in square tiles.

    Attributes:
        side: of a tile, without its margins, in the unit of the outlines.
        angle: (k,) that each chart is turned by, radians.
        shift: (k,) that it is then moved by, as complex numbers.
        tile: (k,) the tile that it is in.
    """

    side: float
    angle: FloatArray
    shift: NDArray[np.complex128]
    tile: IntArray


class Masks(NamedTuple):
    """j = k * t shapes, which are k charts at t angles each; every cell that a chart has a point in belongs to it.

    Attributes:
        cell: width of a cell, in the unit of the outlines.
        angle: (j,) that the chart is turned by, radians; those of chart 0 come first.
        low: (j,) lower left corner of the turned chart, which is that of the shape's lower left cell.
        size: (j, 2) columns and rows.
        runs: (r, 3) row, first and last column of cells in a row.
        first: (j + 1,) the first run of each shape.
    """

    cell: float
    angle: FloatArray
    low: NDArray[np.complex128]
    size: IntArray
    runs: IntArray
    first: IntArray


def cover_charts(outlines: Outlines, angles: FloatArray, cell: float) -> Masks:
    """Return the cells, of the given width, of charts turned by (k, t) angles."""
    low, extent = turned_boxes(outlines, angles)
    size = np.column_stack([extent.real.ravel() // cell, extent.imag.ravel() // cell]).astype(np.int64) + 1
    runs, first = cover(outlines.sides, outlines.start, angles, low, size, cell)
    return Masks(cell, angles.ravel(), low.ravel(), size, runs, first)


def turned_boxes(
    outlines: Outlines, angles: FloatArray
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return (k, t) lower left corners of the boxes around charts turned by angles, and their widths and heights."""
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
    """Return the cells that a chart has a point in, at several angles, as runs (r, 3): row, first and last column.

    And (j + 1,) the first run of each shape.

    Args:
        sides: (s, 2) ends of the sides of outlines.
        start: (k + 1,) the first side of each chart.
        angles: (k, t) that charts are turned by.
        low: (k, t) lower left corner of the turned chart.
        size: (j, 2) the columns and rows of cells from there.
        cell: width of a cell.
    """
    runs, found, first = np.empty((1024, 3), np.int64), 0, np.zeros(angles.size + 1, np.int64)
    for j in range(angles.size):
        chart, t = j // angles.shape[1], j % angles.shape[1]
        turn, left, below = (
            np.exp(1j * angles[chart, t]),
            low[chart, t].real / cell,
            low[chart, t].imag / cell,
        )
        cosine, sine = turn.real / cell, turn.imag / cell
        columns, rows = size[j]
        winding = np.zeros((rows, columns + 1), np.int32)
        touched = np.zeros((rows, columns + 1), np.int32)
        for k in range(start[chart], start[chart + 1]):
            x0, y0 = sides[k, 0].real, sides[k, 0].imag
            x1, y1 = sides[k, 1].real, sides[k, 1].imag
            x0, y0 = x0 * cosine - y0 * sine - left, x0 * sine + y0 * cosine - below
            x1, y1 = x1 * cosine - y1 * sine - left, x1 * sine + y1 * cosine - below
            sign = 1
            if y0 > y1:
                x0, y0, x1, y1, sign = x1, y1, x0, y0, -1
            slope = (x1 - x0) / (y1 - y0) if y1 > y0 else 0.0
            # The cells that the side runs through, and where rows of cell centres cross it.
            for row in range(max(int(y0), 0), min(int(y1), rows - 1) + 1):
                a, b = x0, x1
                if y1 > y0:
                    a, b = x0 + (max(y0, row) - y0) * slope, x0 + (min(y1, row + 1.0) - y0) * slope
                touched[row, min(max(int(min(a, b)), 0), columns - 1)] += 1
                touched[row, min(max(int(max(a, b)), 0), columns - 1) + 1] -= 1
                if y0 <= row + 0.5 < y1:
                    column = int(np.ceil(x0 + (row + 0.5 - y0) * slope - 0.5))
                    winding[row, min(max(column, 0), columns)] += sign
        for row in range(rows):
            around, on, inside = 0, 0, False
            for column in range(columns):
                if winding[row, column] == 0 and touched[row, column] == 0:
                    continue
                around += winding[row, column]
                on += touched[row, column]
                is_in = around != 0 or on > 0
                if is_in and not inside:
                    if found == len(runs):
                        runs = np.concatenate((runs, np.empty_like(runs)))
                    runs[found, 0], runs[found, 1], runs[found, 2] = row, column, columns - 1
                    found += 1
                elif inside and not is_in:
                    runs[found - 1, 2] = column - 1
                inside = is_in
        first[j + 1] = found
    return runs[:found], first


class Way(NamedTuple):
    """How k charts are placed.

    Attributes:
        order: (k,) of the charts.
        allowed: (j,) which shapes may be used.
        aside: (k,) how far to the right a chart is at least, relative to the room beside it.
    """

    order: IntArray
    allowed: BoolArray
    aside: FloatArray


class _Placed(NamedTuple):
    """Charts placed in a way; the others are what `place_all` returns."""

    way: Way
    height: int
    work: int
    chosen: IntArray
    place: IntArray


def pack(
    outlines: Outlines, area: float, angles: FloatArray, allowed: BoolArray, gap: float, tiles: int
) -> Packing:
    """Return a tight packing of charts, none mirrored or scaled, in square tiles.

    Charts are placed one after the other on a grid, those in the largest boxes first, each where its top is lowest.
    The order, and the angles that each may take, are changed at random, a little each time, and a change is kept if
    the charts do not stand higher for it in tiles of a given width; once they stand no higher than wide, the width is
    made smaller.

    Args:
        outlines: of k charts.
        area: of all charts, about.
        angles: (k, t) radians, that charts are turned by.
        allowed: (k, t) which of these angles a chart may be turned by, one at least.
        gap: between charts, in units of the side of a tile, without its margins.
        tiles: number of tiles.

    Raises:
        OptionError: the gap is too wide for so many charts.
    """
    rng = np.random.default_rng(0)
    columns = int(max(MIN_COLUMNS, COLUMNS_PER_CHART * (len(outlines) / tiles) ** 0.5))
    columns = min(columns, int((MAX_CELLS / tiles) ** 0.5))
    _, extent = turned_boxes(outlines, angles)
    extent = np.where(allowed, extent, complex(np.inf, np.inf))
    longest = float(np.maximum(extent.real, extent.imag).min(axis=1).max())
    side = GRID_MARGIN * max((area / tiles) ** 0.5, longest) or 1.0
    masks = cover_charts(outlines, angles, side / columns)
    box = (extent.real + extent.imag).min(axis=1)
    order = np.argsort(-box, kind="stable")
    group = np.arange(len(order))
    if len(order) > GROUPED_CHARTS:
        group = np.unique(np.log(box + side / columns) // np.log(GROUP_RATIO), return_inverse=True)[1].ravel()
    start, width = Way(order, allowed.ravel(), np.zeros(len(order))), columns

    def fill(way: Way, width: int, limit: int) -> _Placed:
        return _Placed(way, *place_all(way, group, masks, _reach(gap * width), tiles, width, limit))

    while (best := fill(start, width, width)).height > width:
        width += width // 12 + 1
        if tiles * width**2 > 4 * MAX_CELLS:
            raise OptionError(
                f"a gap of {100 * gap:.3g} % of the texture's width between {len(order):,} charts leaves no room for "
                "them: use less padding, a higher resolution or more tiles"
            )
    last, least, step, work = best, int(longest / masks.cell) + 1, width // 16, 0
    for _ in range(MAX_TRIES):
        goal = max(width - step, least)
        if goal >= width or work > MAX_WORK:
            break
        check_cancelled()
        limit = goal + goal // 4
        if last is best:
            found = fill(best.way, goal, limit)
        else:
            found = fill(_changed(last.way, start.allowed, rng), goal, min(last.height, limit))
        work += found.work
        if found.height <= goal:
            best, last, width = found, found, goal
            step = max(1, min((goal - found.height) // 2, goal // 16))
        elif step > 1:
            step //= 2
        elif last is best or found.height <= last.height:
            last = found
    tile, column, row = best.place.T
    shift = (column + 1j * row) * masks.cell - masks.low[best.chosen]
    # Tiles end where charts do, and not where cells do.
    low, high = masks.low[best.chosen] + shift, masks.low[best.chosen] + extent.ravel()[best.chosen] + shift
    corner = complex(low.real.min(), low.imag.min())
    side = max(high.real.max() - corner.real, high.imag.max() - corner.imag)
    return Packing(min(side, width * masks.cell), masks.angle[best.chosen], shift - corner, tile)


def _changed(way: Way, may: BoolArray, rng: np.random.Generator) -> Way:
    """Return charts of which some change places in the order, and of which one or two may take other angles.

    Of few, one or two keep to the right, by another part of the room there is.
    """
    order, allowed, aside = (each.copy() for each in way)
    count = len(order)
    turns = len(may) // count
    for one, two in (rng.random((int(3 * rng.random()), 2)) * count).astype(np.int64):
        order[[one, two]] = order[[two, one]]
    for chart in (rng.random(1 + int(2 * rng.random())) * count).astype(np.int64):
        shapes = slice(chart * turns, (chart + 1) * turns)
        allowed[shapes] = may[shapes] & (rng.random(turns) < rng.choice([0.3, 0.6, 1.0]))
    if count <= ASIDE_CHARTS and rng.random() < ASIDE_SHARE:
        aside[int(rng.random() * count)] = rng.choice([0.0, rng.random(), 1.0])
    return Way(order, allowed, aside)


def _reach(gap: float) -> IntArray:
    """Return (d,) how many columns away, or fewer, cells that are some rows apart are closer than the gap.

    Points of two cells that are a rows and b columns apart are at least (a - 1, b - 1) apart.
    """
    rows = np.arange(int(np.ceil(gap)) + 1)
    across = np.sqrt(np.maximum(gap**2 - np.maximum(rows - 1, 0) ** 2, 0.0))
    return np.ceil(across).astype(np.int64)


@compiled
def place_all(
    way: Way, group: IntArray, masks: Masks, reach: IntArray, tiles: int, width: int, limit: int
) -> tuple[int, int, IntArray, IntArray]:
    """Fill tiles of cells from below: each chart goes where its top is lowest, and leftmost there.

    Args:
        way: the order of charts, and what they may do.
        group: (k,) charts of a group are so much alike that none is tried below where the one before was placed.
        masks: the shapes of charts, as many of each.
        reach: (d,) a cell is too near to another chart's if they are less than d rows apart, and `reach` of the
            number of rows or fewer columns.
        tiles, width, limit: number of tiles, their columns, and the rows that may be used.

    Returns:
        The rows used, limit + 1 if a chart has no place; the work done, in comparisons of runs of cells; (k,) the shape
        of each chart; and (k, 3) its tile, and the column and row of its lower left cell.
    """
    size, runs, first, turns = masks.size, masks.runs, masks.first, len(masks.size) // len(way.order)
    chosen, place = np.empty(len(way.order), np.int64), np.empty((len(way.order), 3), np.int64)
    # For each cell the next taken one, itself included, and the first one after that which is free again.
    taken = np.full((tiles, limit, width), width, dtype=np.int16)
    clear = np.full((tiles, limit, width), width, dtype=np.int16)
    floor = np.zeros((tiles, group.max() + 1), np.int64)
    top, work, far = 0, tiles * limit, len(reach) - 1
    for c in way.order:
        best, shape, tile, column, row = limit + 1, -1, 0, 0, 0
        for j in range(c * turns, (c + 1) * turns):
            if not way.allowed[j] or size[j, 0] > width:
                continue
            own, right = runs[first[j] : first[j + 1]], width - size[j, 0]
            for t in range(tiles):
                x, y, steps = find_lowest(
                    taken[t], clear[t], own, int(way.aside[c] * right), right, floor[t, group[c]], best - size[j, 1]
                )  # fmt: skip
                work += steps
                if y >= 0:
                    best, shape, tile, column, row = y + size[j, 1], j, t, x, y
        if shape < 0:
            return limit + 1, work, chosen, place
        chosen[c], place[c, 0], place[c, 1], place[c, 2] = shape, tile, column, row
        floor[tile, group[c]] = row
        top = max(top, best)
        for k in range(first[shape], first[shape + 1]):
            for y in range(max(row + runs[k, 0] - far, 0), min(row + runs[k, 0] + far + 1, limit)):
                out = reach[abs(y - row - runs[k, 0])]
                for x in range(max(column + runs[k, 1] - out, 0), min(column + runs[k, 2] + out + 1, width)):
                    taken[tile, y, x] = x
        for y in range(max(row - far, 0), min(best + far, limit)):
            following, free = width, width
            for x in range(width - 1, -1, -1):
                if taken[tile, y, x] == x:
                    free = free if following == x + 1 else x + 1
                    following = x
                taken[tile, y, x], clear[tile, y, x] = following, free
            work += width // 50  # cells that are gone over in the time of a comparison
    return top, work, chosen, place


@compiled
def find_lowest(
    taken: IntArray, clear: IntArray, runs: IntArray, left: int, right: int, low: int, above: int
) -> tuple[int, int, int]:
    """Return the lowest place where a shape fits, and the work.

    The row is from `low` to below `above`, -1 if there is none, the column from `left` to `right`.
    """
    work, k = 0, 0
    for y in range(low, above):
        x, fits = left, 0
        while x <= right and fits < len(runs):
            work += 1
            row, start = y + runs[k, 0], x + runs[k, 1]
            if taken[row, start] <= x + runs[k, 2]:
                # Every place up to where this run has passed what it hit is out. It is the first to look at next time.
                x, fits = clear[row, start] - runs[k, 1], 0
            else:
                fits += 1
                k = k + 1 if k + 1 < len(runs) else 0
        if x <= right:
            return x, y, work
    return left, -1, work
