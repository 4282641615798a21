"""The search for a tight packing: charts placed one after the other, in orders and at angles that are tried."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import BoolArray, FloatArray, IntArray
from ..compiled import compiled
from ..errors import OptionError
from .charts import Outlines
from .masks import Masks, cover_charts, turned_boxes

# Columns of the grids, from coarse to fine: the coarse one finds who goes where, the fine one closes the gaps.
GRIDS = (160, 400, 1000)
# Cells of all strips together at most, and the columns that so many charts need at least.
MOST_CELLS, COLUMNS_PER_CHART = 4_000_000, 8.0
# Tries on each grid, and work that ends them earlier, in comparisons of runs of cells: about half a second.
TRIES = (500, 120, 30)
WORK = 20_000_000
FILLS = 4  # but for so many charts that placing them all once is much of that
# Of more charts than MANY, those whose sizes differ by less than this factor count as alike.
MANY, ALIKE = 1000, 1.02
# The first grid is so much wider than charts without gaps would need, and than the longest of them; no round numbers,
# so that simple charts do not end where cells do and leave it to rounding which cell is the last.
ROOMY, LONGER = 1.2347, 1.0123
# Cells of all strips together after which the charts, small as they are by then, are not made smaller.
ROOM = 4 * MOST_CELLS


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


@dataclass(frozen=True, eq=False)
class _Placed:
    """Charts placed in an order, each as one of the shapes allowed; see `place_all`."""

    order: IntArray
    allowed: BoolArray
    height: int
    work: int
    chosen: IntArray
    place: IntArray


class _Strips:
    """Charts on a grid, to be placed in strips; counts its work."""

    def __init__(self, masks: Masks, tiles: int) -> None:
        self.masks, self.tiles, self.work = masks, tiles, 0
        self.group = np.arange(len(masks.size) // masks.turns)
        if len(self.group) > MANY:
            _, self.group = np.unique(np.log(masks.cells) // np.log(ALIKE), return_inverse=True)

    def fill(self, order: IntArray, allowed: BoolArray, reach: IntArray, width: int, limit: int) -> _Placed:
        """Return charts placed in strips so wide; higher than the limit if not all found a place below it."""
        masks = self.masks
        chosen, place = np.empty(len(order), dtype=np.int64), np.empty((len(order), 3), dtype=np.int64)
        height, work = place_all(
            order, self.group, masks.turns, allowed, masks.size, masks.runs, masks.first, masks.widest,
            reach, self.tiles, width, limit, chosen, place,
        )  # fmt: skip
        self.work += work
        return _Placed(order, allowed, height, work, chosen, place)

    def packing(self, placed: _Placed, width: int) -> Packing:
        """Return the packing in strips as high as wide."""
        masks, (tile, column, row) = self.masks, placed.place.T
        shift = (column + 1j * row) * masks.cell - masks.low[placed.chosen]
        return Packing(width * masks.cell, masks.angle[placed.chosen], shift, tile)


def pack(
    outlines: Outlines, area: float, angles: FloatArray, gap: float, tiles: int = 1, refine: bool = True
) -> Packing:
    """Return a tight packing of charts, none mirrored or scaled, in square tiles.

    Charts are placed one after the other, those in the largest boxes first, each where its top is lowest. The
    order, and the angles that each may take, are changed at random, a little each time, and a change is kept if the
    charts do not stand higher for it in strips of a given width; once they stand no higher than wide, the width is
    made smaller. On the finer grids this goes on, with angles closer and closer to those found.

    Args:
        outlines: of k charts.
        area: of all charts, about.
        angles: (k, t) radians, that charts may be turned by.
        gap: between charts, in units of the side of a tile, without its margins.
        tiles: number of tiles.
        refine: whether angles between the given ones may be taken.

    Raises:
        OptionError: the gap is too wide for so many charts.
    """
    rng = np.random.default_rng(0)
    most = int((MOST_CELLS / tiles) ** 0.5)
    coarse = min(max(GRIDS[0], int(COLUMNS_PER_CHART * (len(outlines) / tiles) ** 0.5)), most)
    strips, width, placed = _first(outlines, area, angles, gap, tiles, coarse)
    placed, best, width = _climb(strips, placed, _reach(gap * width), width, TRIES[0], rng)
    packing = strips.packing(best or placed, width)
    step = np.pi / angles.shape[1]
    for finer, tries in zip(GRIDS[1:], TRIES[1:], strict=True):
        columns = min(finer, most)
        if columns < 1.5 * coarse:
            continue
        coarse = columns
        angles = packing.angle[:, None]
        if refine:
            step /= 2
            angles = angles + np.array([0.0, -step, step])
        strips = _Strips(cover_charts(outlines, angles, packing.side / columns), tiles)
        reach, allowed = _reach(gap * columns), np.ones(angles.size, dtype=bool)
        placed = strips.fill(placed.order, allowed, reach, columns, _above(columns))
        placed, best, width = _climb(strips, placed, reach, columns, tries, rng)
        if best is not None:
            packing = strips.packing(best, width)
    return packing


def _first(
    outlines: Outlines, area: float, angles: FloatArray, gap: float, tiles: int, columns: int
) -> tuple[_Strips, int, _Placed]:
    """Return strips of cells, about so many columns, in which charts stand no higher than wide; the width, and how."""
    _, extent = turned_boxes(outlines, angles)
    longest = float(np.maximum(extent.real, extent.imag).min(axis=1).max())
    side = max(ROOMY * (area / tiles) ** 0.5, LONGER * longest)
    strips = _Strips(cover_charts(outlines, angles, (side or 1.0) / columns), tiles)
    order = np.argsort(-(extent.real + extent.imag).min(axis=1), kind="stable")
    allowed, width = np.ones(angles.size, dtype=bool), columns
    while tiles * width**2 <= ROOM:
        placed = strips.fill(order, allowed, _reach(gap * width), width, width)
        if placed.height <= width:
            return strips, width, placed
        width += width // 12 + 1
    raise OptionError(
        f"a gap of {100 * gap:.3g} % of the texture's width between {len(order):,} charts leaves no room for them: "
        "use less padding, a higher resolution or more tiles"
    )


def _climb(
    strips: _Strips, placed: _Placed, reach: IntArray, width: int, tries: int, rng: np.random.Generator
) -> tuple[_Placed, _Placed | None, int]:
    """Improve on charts placed in strips of a given width.

    Args:
        strips, placed: the charts.
        reach: see `place_all`; wide enough for strips of this width.
        width: of the strips; the charts need not be so low.
        tries: at most.
        rng: of the changes.

    Returns:
        The last charts placed; those in the narrowest strips in which they stand no higher than wide, None if there
        are none so narrow; and their width.
    """
    best, goal = None, width
    end = strips.work + max(WORK, FILLS * placed.work)
    for _ in range(tries):
        if placed.height <= goal:
            best, width = _narrow(strips, placed, reach, goal, end)
            goal = width - 1
            placed = strips.fill(best.order, best.allowed, reach, goal, _above(goal))
        if strips.work > end:
            break
        order, allowed = _changed(placed, strips.masks.turns, rng)
        changed = strips.fill(order, allowed, reach, goal, min(placed.height, _above(goal)))
        if changed.height <= placed.height:
            placed = changed
    if placed.height <= goal:
        best, width = _narrow(strips, placed, reach, goal, end)
    return placed, best, width


def _narrow(strips: _Strips, placed: _Placed, reach: IntArray, width: int, end: int) -> tuple[_Placed, int]:
    """Return charts placed alike in narrower strips, in which they stand no higher than wide; and the width.

    Steps get smaller until none is possible, or the work is up to `end`.
    """
    step = max(width // 64 + 1, (width - placed.height) // 2)
    while step and strips.work < end:
        step = min(step, width - 1)
        narrower = strips.fill(placed.order, placed.allowed, reach, width - step, width - step)
        if narrower.height <= width - step:
            width, placed = width - step, narrower
            step = max(step, (width - placed.height) // 2)
        else:
            step //= 2
    return placed, width


def _changed(placed: _Placed, turns: int, rng: np.random.Generator) -> tuple[IntArray, BoolArray]:
    """Return another order, one or two pairs of charts having changed places, and other shapes for one or two."""
    order, allowed = placed.order.copy(), placed.allowed.copy()
    count = len(order)
    if rng.random() < 0.7:
        for one, two in (rng.random((1 + int(2 * rng.random()), 2)) * count).astype(np.int64):
            order[[one, two]] = order[[two, one]]
    for chart in (rng.random(1 + int(2 * rng.random())) * count).astype(np.int64):
        share = (0.3, 0.6, 1.0)[int(3 * rng.random())]
        allowed[chart * turns : (chart + 1) * turns] = rng.random(turns) < share
    return order, allowed


def _above(width: int) -> int:
    """Return how high charts may stand in strips of a width before they are to be brought down to it."""
    return width + width // 4


def _reach(gap: float) -> IntArray:
    """Return (d,) how many columns away, or fewer, cells that are some rows apart are closer than the gap.

    Points of two cells that are a rows and b columns apart are at least (a - 1, b - 1) apart.
    """
    rows = np.arange(int(np.ceil(gap)) + 1)
    across = np.sqrt(np.maximum(gap**2 - np.maximum(rows - 1, 0) ** 2, 0.0))
    return np.ceil(across).astype(np.int64)


# Cells that are cleared in the time of a comparison.
CELLS_PER_WORK = 50


@compiled
def place_all(
    order: IntArray,
    group: IntArray,
    turns: int,
    allowed: BoolArray,
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
                    width - size[j, 0], floor[s, group[c]], best - size[j, 1],
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
    right: int,
    low: int,
    above: int,
) -> tuple[int, int, int]:
    """Return the lowest place where a shape fits, and the work.

    The row is from `low` to below `above`, -1 if there is none, the column at most `right`.
    """
    count, work = len(runs), 0
    need = runs[widest, 2] - runs[widest, 1] + 1
    probe = widest
    for y in range(low, above):
        work += 1
        if longest_gap[y + runs[widest, 0]] < need:
            continue
        x, free, k = 0, 0, probe
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
    return 0, -1, work


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
