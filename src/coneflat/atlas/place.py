"""Search for a tight packing: charts are placed one after the other, in varying orders and at varying angles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.jit import compiled
from ..base.progress import check_cancelled
from ..errors import OptionError
from .charts import Outlines

# Columns of the grid per square root of the number of charts, and the maximum number of cells of all tiles: at first,
# and where gaps between the charts need more.
COLUMNS_PER_CHART, MAX_CELLS, MAX_CELLS_WITH_GAPS = 24.0, 4_000_000, 16_000_000
# The work after which the search ends, in comparisons of runs of cells: about a second.
MAX_WORK = 40_000_000
# Up to OFFSET_CHARTS charts, a chart may be forced to the right, which happens in this fraction of the tries. With more
# charts this makes the packing worse.
OFFSET_CHARTS, OFFSET_SHARE = 5, 0.3
# With more charts than GROUPED_CHARTS, those whose boxes differ by less than this factor are treated as equal.
GROUPED_CHARTS, GROUP_RATIO = 1000, 1.02
# Number of widths in small steps that are too small, from which on the steps are larger.
MANY_FAILURES = 5
# Cells by which rounding enlarges a chart and the gap beside it.
ROUNDED_CELLS = 2.0
# Width of the grid relative to the width that charts without gaps would need, and to the longest chart. It is not a
# round number, so that simple charts do not end at cell borders, where rounding would decide which cell is the last.
GRID_MARGIN = 1.2347


@dataclass(frozen=True)
class Effort:
    """What a packing may cost.

    Attributes:
        columns: minimum number of columns of the grid.
        tries: number of changes that are tried.
        max_side: largest side that is of use; the search ends after a third of the tries if it is not reached.
    """

    columns: int = 400
    tries: int = 150
    max_side: float = np.inf


@dataclass(frozen=True, eq=False)
class Packing:
    """Placement of k charts in square tiles.

    Attributes:
        side: side of a tile without its margins, in the unit of the outlines.
        angle: (k,) angle by which each chart is rotated, radians.
        shift: (k,) translation after the rotation, as complex numbers.
        tile: (k,) the tile of each chart.
    """

    side: float
    angle: FloatArray
    shift: NDArray[np.complex128]
    tile: IntArray


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
            sign = 1
            if y0 > y1:
                x0, y0, x1, y1, sign = x1, y1, x0, y0, -1
            slope = (x1 - x0) / (y1 - y0) if y1 > y0 else 0.0
            # Mark the cells that the side passes through, and where it crosses the lines of cell centres.
            for row in range(max(int(y0), 0), min(int(y1), rows - 1) + 1):
                a, b = x0, x1
                if y1 > y0:
                    a, b = x0 + (max(y0, row) - y0) * slope, x0 + (min(y1, row + 1.0) - y0) * slope
                touched[row, min(max(int(min(a, b)), 0), columns - 1)] += 1
                touched[row, min(max(int(max(a, b)), 0), columns - 1) + 1] -= 1
                if y0 <= row + 0.5 < y1:
                    column = math.ceil(x0 + (row + 0.5 - y0) * slope - 0.5)
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
                    if count == len(runs):
                        larger = np.empty((2 * count, 3), np.int64)
                        for i in range(count):
                            for x in range(3):
                                larger[i, x] = runs[i, x]
                        runs = larger
                    runs[count, 0], runs[count, 1], runs[count, 2] = row, column, columns - 1
                    count += 1
                elif inside and not is_in:
                    runs[count - 1, 2] = column - 1
                inside = is_in
        first[j + 1] = count
    return runs[:count], first


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


class _Placed(NamedTuple):
    """Charts placed by a plan; the other fields are what `place_all` returns."""

    plan: Plan
    height: int
    work: int
    chosen: IntArray
    place: IntArray


@dataclass(frozen=True, eq=False)
class _Grid:
    """Shapes of k charts on a grid, to be placed in tiles of a varying width.

    Attributes:
        masks: the shapes.
        extent: (k, t) extents of the rotated charts, as complex numbers; infinite for angles that are not allowed.
        group: (k,) group of each chart, see `place_all`.
        gap: minimum distance between charts, relative to the width.
        tiles: number of tiles.
        columns: width to begin with.
        widest: largest width.
        narrowest: width that the longest chart needs.
    """

    masks: Masks
    extent: NDArray[np.complex128]
    group: IntArray
    gap: float
    tiles: int
    columns: int
    widest: int
    narrowest: int

    def place(self, plan: Plan, width: int, limit: int) -> _Placed:
        """Return the charts placed by a plan in tiles of a width, with at most `limit` rows."""
        reach = _reach(self.gap * width)
        return _Placed(plan, *place_all(plan, self.group, self.masks, reach, self.tiles, width, limit))

    def first_placed(self, plan: Plan) -> tuple[_Placed, int]:
        """Return the charts placed by a plan in the narrowest square tiles that it fits, and their width.

        Raises:
            OptionError: it fits none.
        """
        width, failures = self.columns, 0
        while (placed := self.place(plan, width, width)).height > width:
            failures += 1
            width += width // (12 if failures < MANY_FAILURES else 4) + 1
            if width > self.widest:
                raise _no_space(self.gap, len(plan.order))
        return placed, width

    def packing(self, placed: _Placed, width: int) -> Packing:
        """Return placed charts as a packing; the tile is cropped to the charts, not to the cells."""
        masks, chosen = self.masks, placed.chosen
        tile, column, row = placed.place.T
        shift = (column + 1j * row) * masks.cell - masks.low[chosen]
        low, high = masks.low[chosen] + shift, masks.low[chosen] + self.extent.ravel()[chosen] + shift
        corner = complex(low.real.min(), low.imag.min())
        side = max(high.real.max() - corner.real, high.imag.max() - corner.imag)
        return Packing(min(side, width * masks.cell), masks.angle[chosen], shift - corner, tile)


def pack(
    outlines: Outlines,
    area: float,
    angles: FloatArray,
    allowed: BoolArray,
    gap: float,
    tiles: int,
    effort: Effort = Effort(),
) -> Packing:
    """Return a tight packing of charts in square tiles, by rotations and translations alone.

    Charts are placed one after the other on a grid, those with the largest boxes first, each where its top is lowest.
    The order and the allowed angles are changed at random, a little each time. A change is kept if it does not
    increase the height of the packing in tiles of a given width; once the height is at most the width, the width is
    reduced.

    Args:
        outlines: outlines of k charts.
        area: approximate area of all charts.
        angles: (k, t) candidate rotation angles, radians.
        allowed: (k, t) True for the angles that a chart may take, at least one per chart.
        gap: minimum distance between charts, relative to the side of a tile without its margins.
        tiles: number of tiles.
        effort: what the search may cost.

    Returns:
        The best packing found.

    Raises:
        OptionError: the gap is too wide for this number of charts.
    """
    grid = _grid_of(outlines, area, angles, allowed, gap, tiles, effort.columns)
    boxes = (grid.extent.real + grid.extent.imag).min(axis=1)
    plan = Plan(np.argsort(-boxes, kind="stable"), allowed.ravel(), np.zeros(len(outlines)))
    placed, width = grid.first_placed(plan)
    return grid.packing(*_improved(grid, placed, width, effort))


def _grid_of(
    outlines: Outlines,
    area: float,
    angles: FloatArray,
    allowed: BoolArray,
    gap: float,
    tiles: int,
    min_columns: int,
) -> _Grid:
    """Return the shapes of charts on a grid; arguments as of `pack`, and the minimum number of columns.

    Raises:
        OptionError: the gap is too wide for this number of charts.
    """
    columns = int(max(min_columns, COLUMNS_PER_CHART * (len(outlines) / tiles) ** 0.5))
    columns = int(min(columns, (MAX_CELLS / tiles) ** 0.5))
    _, extent = rotated_boxes(outlines, angles)
    extent = np.where(allowed, extent, complex(np.inf, np.inf))
    longest = float(np.maximum(extent.real, extent.imag).min(axis=1).max())
    side = GRID_MARGIN * max((area / tiles) ** 0.5, longest) or 1.0
    widest = min(4 * columns, int((1.5 * MAX_CELLS_WITH_GAPS / tiles) ** 0.5))
    group = np.arange(len(outlines))
    if len(outlines) > GROUPED_CHARTS:
        # Charts in rows, with gaps that are a fraction of the width: so many cells of the width are left to each.
        in_row = (len(outlines) / tiles) ** 0.5
        cells = (MAX_CELLS_WITH_GAPS / tiles) ** 0.5 * (1 / in_row - gap) - ROUNDED_CELLS
        size = float(np.sqrt(extent.real * extent.imag).min(axis=1).mean())
        columns = int(min(columns, max(cells, 0.0) * side / size if size > 0 else columns))
    if columns < 1:
        raise _no_space(gap, len(outlines))
    if len(outlines) > GROUPED_CHARTS:
        boxes = (extent.real + extent.imag).min(axis=1)
        sizes = np.log(boxes + side / columns) // np.log(GROUP_RATIO)
        group = np.unique(sizes, return_inverse=True)[1].ravel()
    masks = cover_charts(outlines, angles, side / columns)
    return _Grid(masks, extent, group, gap, tiles, columns, widest, int(longest / masks.cell) + 1)


def _improved(grid: _Grid, placed: _Placed, width: int, effort: Effort) -> tuple[_Placed, int]:
    """Return charts placed in narrower tiles by random changes of their plan, and the width of the tiles.

    Args:
        grid: the shapes of the charts.
        placed, width: the charts as placed first, and the width of their tiles.
        effort: what the search may cost.
    """
    rng, permitted = np.random.default_rng(0), placed.plan.allowed
    best = last = placed
    step, work = width // 16, 0
    useful_width = int(min(effort.max_side / grid.masks.cell, width)) + 1
    for attempt in range(effort.tries):
        goal = max(min(width - step, useful_width), grid.narrowest)
        is_late = width > useful_width and attempt > effort.tries // 3
        if goal >= width or work > MAX_WORK or is_late:
            break
        check_cancelled()
        limit = goal + goal // 4 if last is best else min(last.height, goal + goal // 4)
        plan = best.plan if last is best else _changed(last.plan, permitted, rng)
        candidate = grid.place(plan, goal, limit)
        work += candidate.work
        if candidate.height <= goal:
            best, last, width = candidate, candidate, goal
            step = max(1, min((goal - candidate.height) // 2, goal // 16))
        elif step > 1 and width <= useful_width:
            step //= 2
        elif last is best or candidate.height <= last.height:
            last = candidate
    return best, width


def _no_space(gap: float, count: int) -> OptionError:
    return OptionError(
        f"a gap of {100 * gap:.3g} % of the texture's width between {count:,} charts leaves no space for them: use "
        "less padding, a higher resolution or more tiles"
    )


def _changed(plan: Plan, permitted: BoolArray, rng: np.random.Generator) -> Plan:
    """Return a randomly changed plan: some charts swapped in the order, and other angles allowed for one or two.

    With few charts, the offset of a chart may change too. permitted: (j,) the shapes that may be allowed.
    """
    order, allowed, offset = (array.copy() for array in plan)
    count = len(order)
    turns = len(permitted) // count
    for first_place, second_place in (rng.random((int(3 * rng.random()), 2)) * count).astype(np.int64):
        order[[first_place, second_place]] = order[[second_place, first_place]]
    for chart in (rng.random(1 + int(2 * rng.random())) * count).astype(np.int64):
        shapes = slice(chart * turns, (chart + 1) * turns)
        allowed[shapes] = permitted[shapes] & (rng.random(turns) < rng.choice([0.3, 0.6, 1.0]))
    if count <= OFFSET_CHARTS and rng.random() < OFFSET_SHARE:
        offset[int(rng.random() * count)] = rng.choice([0.0, rng.random(), 1.0])
    return Plan(order, allowed, offset)


def _reach(gap: float) -> IntArray:
    """Return (d,) for each distance in rows, the distance in columns up to which two cells are closer than the gap.

    Points of two cells at a distance of a rows and b columns differ by at least (a - 1, b - 1) cells.
    """
    rows = np.arange(int(np.ceil(gap)) + 1)
    across = np.sqrt(np.maximum(gap**2 - np.maximum(rows - 1, 0) ** 2, 0.0))
    return np.ceil(across).astype(np.int64)


@compiled
def place_all(
    plan: Plan, group: IntArray, masks: Masks, reach: IntArray, tiles: int, width: int, limit: int
) -> tuple[int, int, IntArray, IntArray]:
    """Fill tiles of cells from below: each chart is placed where its top is lowest, and leftmost among these places.

    Args:
        plan: the order of charts and the restrictions on their placement.
        group: (k,) group of each chart; charts of a group are so similar that none is tried below the previous one.
        masks: the shapes of charts, the same number for each chart.
        reach: (d,) two cells of different charts are too close if their distance is less than d rows and at most
            `reach[rows]` columns.
        tiles, width, limit: number of tiles, their columns, and the rows that may be used.

    Returns:
        The number of rows used, limit + 1 if a chart has no place; the work done, in comparisons of runs of cells; (k,)
        the shape of each chart; and (k, 3) its tile, and the column and row of its lower left cell.
    """
    size, runs, first, turns = masks.size, masks.runs, masks.first, len(masks.size) // len(plan.order)
    chosen, place = np.empty(len(plan.order), np.int64), np.empty((len(plan.order), 3), np.int64)
    # For each cell, the next occupied cell in its row, itself included, and the first free cell after that.
    taken = np.empty((tiles, limit, width), dtype=np.int16)
    clear = np.empty((tiles, limit, width), dtype=np.int16)
    for t in range(tiles):
        for y in range(limit):
            for x in range(width):
                taken[t, y, x] = clear[t, y, x] = width
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
                    best - size[j, 1],
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
            for y in range(
                max(row + runs[k, 0] - reach_rows, 0), min(row + runs[k, 0] + reach_rows + 1, limit)
            ):
                out = reach[abs(y - row - runs[k, 0])]
                for x in range(max(column + runs[k, 1] - out, 0), min(column + runs[k, 2] + out + 1, width)):
                    taken[tile, y, x] = x
        left, right = max(column - widest, 0), min(column + size[shape, 0] + widest, width)
        for y in range(max(row - reach_rows, 0), min(best + reach_rows, limit)):
            following, free = width, width
            if right < width:
                following, free = taken[tile, y, right], clear[tile, y, right]
            for x in range(right - 1, -1, -1):
                if taken[tile, y, x] == x:
                    free = free if following == x + 1 else x + 1
                    following = x
                elif x < left and taken[tile, y, x] == following and clear[tile, y, x] == free:
                    break  # What follows is the same as before, and so it is for all cells to the left.
                taken[tile, y, x], clear[tile, y, x] = following, free
        # About 50 cells are visited in the time of a comparison.
        work += (
            (best - row + 2 * reach_rows) * width
            + 4 * reach_rows * reach_rows * (first[shape + 1] - first[shape])
        ) // 50
    return top, work, chosen, place


@compiled
def find_lowest(
    taken: IntArray, clear: IntArray, runs: IntArray, left: int, right: int, low: int, above: int
) -> tuple[int, int, int]:
    """Return the column and row of the lowest place where a shape fits, and the work.

    The column is from `left` to `right`, the row from `low` to below `above`, or -1 if the shape does not fit.
    """
    work, k = 0, 0
    for y in range(low, above):
        x, fits = left, 0
        while x <= right and fits < len(runs):
            work += 1
            row, start = y + runs[k, 0], x + runs[k, 1]
            if taken[row, start] <= x + runs[k, 2]:
                # Skip all columns at which this run hits the same occupied cells. The next place is tested with this
                # run first.
                x, fits = clear[row, start] - runs[k, 1], 0
            else:
                fits += 1
                k = k + 1 if k + 1 < len(runs) else 0
        if x <= right:
            return x, y, work
    return left, -1, work
