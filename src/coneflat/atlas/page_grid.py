"""Placement of outlines on a sheet of pages that overlap, so that few pages are needed and few borders are crossed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.jit import compiled
from ..base.progress import begin_step
from .charts import Outlines
from .masks import Masks, cover_charts
from .placement import Plan, filled_tiles, find_lowest, link_cells, occupy, reach_of
from .strips import SheetPacking
from .tight_packing import changed_plan

# Number of random changes that are tried, and the work after which the search ends, in comparisons of runs of cells:
# about two tenths of a second.
TRIES, MAX_WORK = 150, 8_000_000
# Places across and upward that are tried for outlines on more than one page.
SHIFTS = 7


class PageGrid(NamedTuple):
    """Pages on a sheet.

    Attributes:
        width, height: size of what is printed on a page.
        overlap: how far neighbouring pages overlap.
        edge: distance of outlines from the border of the pages on which they are.
        columns, rows: number of pages side by side and above one another.
    """

    width: float
    height: float
    overlap: float
    edge: float
    columns: int
    rows: int


class _Spans(NamedTuple):
    """The cells of rows or columns of pages: (k, 2) the first and the last cell that outlines may have on each page,
    and those that are on no other page."""

    inner: IntArray
    alone: IntArray


class _Placed(NamedTuple):
    """Outlines placed by a plan: the pages that are needed, -1 if an outline has no place; the outlines that are on
    more than one; the rows used; the work; (k,) the shape of each outline; (k, 2) its lower left cell."""

    pages: int
    crossings: int
    rows: int
    work: int
    chosen: IntArray
    place: IntArray

    @property
    def cost(self) -> tuple[int, int, int]:
        return self.pages, self.crossings, self.rows


def pack_page_grid(
    outlines: Outlines, angles: FloatArray, gap: float, pages: PageGrid, columns: int
) -> SheetPacking | None:
    """Return outlines on the fewest pages that were found, and then with the fewest that cross borders of pages.

    An outline is placed within as few rows and columns of pages as it can be. None if one has no place.

    Args:
        outlines: outlines of k charts.
        angles: (k, t) candidate rotation angles, radians.
        gap: minimum distance between outlines.
        pages: the pages.
        columns: cells of the grid across all pages; outlines do not share cells.
    """
    size = np.array([pages.width, pages.height])
    step = size - pages.overlap
    cell = float((pages.columns * step[0] + pages.overlap) / columns)
    across, upward = (
        _spans(count, float(extent), float(pitch), pages.edge, cell)
        for count, extent, pitch in zip((pages.columns, pages.rows), size, step, strict=True)
    )
    masks, reach = cover_charts(outlines, angles, cell), reach_of(gap / cell)
    permitted = np.ones(angles.size, dtype=bool)
    boxes = masks.size.sum(axis=1).reshape(len(outlines), -1).min(axis=1)
    plan = Plan(np.argsort(-boxes, kind="stable"), permitted, np.zeros(len(outlines)))
    best, work, rng = _Placed(*_place(plan, masks, reach, across, upward)), 0, np.random.default_rng(0)
    if best.pages < 0:
        return None
    for _ in range(TRIES):
        if work > MAX_WORK or best.cost[:2] == (1, 0):
            break
        begin_step()
        candidate_plan = changed_plan(plan, permitted, rng)
        candidate = _Placed(*_place(candidate_plan, masks, reach, across, upward))
        work += candidate.work
        if candidate.pages >= 0 and candidate.cost <= best.cost:
            best, plan = candidate, candidate_plan
    shift = (best.place[:, 0] + 1j * best.place[:, 1]) * cell - masks.low[best.chosen]
    sheet = np.zeros(len(outlines), dtype=np.int64)
    return SheetPacking(masks.angle[best.chosen], shift, sheet, best.rows * cell)


def _spans(count: int, extent: float, step: float, edge: float, cell: float) -> _Spans:
    low = step * np.arange(count)
    overlap = extent - step
    inner = np.stack([np.ceil((low + edge) / cell), np.floor((low + extent - edge) / cell) - 1], axis=1)
    # The first and the last page have no neighbour beyond them.
    alone_low, alone_high = low + overlap, low + step
    alone_low[0], alone_high[-1] = 0.0, low[-1] + extent
    alone = np.stack([np.floor(alone_low / cell), np.ceil(alone_high / cell) - 1], axis=1)
    return _Spans(inner.astype(np.int64), alone.astype(np.int64))


@compiled
def _place(
    plan: Plan, masks: Masks, reach: IntArray, across: _Spans, upward: _Spans
) -> tuple[int, int, int, int, IntArray, IntArray]:
    """Place outlines one after the other where they need the fewest further pages; return the fields of _Placed.

    Args:
        plan: the order of charts and the restrictions on their placement.
        masks: the shapes of charts, the same number for each chart.
        reach: see `place_all`.
        across, upward: the cells of columns and rows of pages.
    """
    size, runs, first, turns = masks.size, masks.runs, masks.first, len(masks.size) // len(plan.order)
    chosen, place = np.empty(len(plan.order), np.int64), np.empty((len(plan.order), 2), np.int64)
    columns, rows = across.inner[-1, 1] + 1, upward.inner[-1, 1] + 1
    taken, clear = filled_tiles(1, rows, columns), filled_tiles(1, rows, columns)
    is_used = np.zeros((len(upward.alone), len(across.alone)), np.bool_)
    work, reach_rows, widest, crossings, top = rows, len(reach) - 1, reach.max(), 0, 0
    for c in plan.order:
        best_new, best_span, best_row, best_top = len(across.alone) * len(upward.alone) + 1, 0, 0, 0
        shape, column, row = -1, 0, 0
        for j in range(c * turns, (c + 1) * turns):
            if not plan.allowed[j]:
                continue
            shape_runs = runs[first[j] : first[j + 1]]
            wide, high = _page_count(across.inner, size[j, 0]), _page_count(upward.inner, size[j, 1])
            for r in range(len(upward.alone) - high + 1):
                for q in range(len(across.alone) - wide + 1):
                    work += 1
                    span = wide * high
                    new_at_least = 1 if not is_used[r : r + high, q : q + wide].any() else 0
                    if (new_at_least, span, r) > (best_new, best_span, best_row):
                        continue
                    left, right = across.inner[q, 0], across.inner[q + wide - 1, 1] + 1 - size[j, 0]
                    low, last = upward.inner[r, 0], upward.inner[r + high - 1, 1] + 1 - size[j, 1]
                    if left > right or low > last:
                        continue
                    # On a single page, the lowest place is as good as any.
                    shifts = SHIFTS if span > 1 else 1
                    for i in range(shifts * shifts):
                        start = left + (right - left) * (i % shifts) // max(shifts - 1, 1)
                        bottom = low + (last - low) * (i // shifts) // max(shifts - 1, 1)
                        x, y, steps = find_lowest(
                            taken[0], clear[0], shape_runs, start, right, bottom, last + 1, 1
                        )
                        work += steps
                        if y < 0:
                            continue
                        new_pages = _mark_pages(is_used, shape_runs, x, y, across.alone, upward.alone, False)
                        reached = y + size[j, 1]
                        if (new_pages, span, r, reached) < (
                            best_new,
                            best_span,
                            best_row,
                            best_top,
                        ) or shape < 0:
                            best_new, best_span, best_row, best_top = new_pages, span, r, reached
                            shape, column, row = j, x, y
        if shape < 0:
            return -1, crossings, top, work, chosen, place
        chosen[c], place[c, 0], place[c, 1] = shape, column, row
        shape_runs = runs[first[shape] : first[shape + 1]]
        _mark_pages(is_used, shape_runs, column, row, across.alone, upward.alone, True)
        crossings += best_span > 1
        top = max(top, best_top)
        occupy(taken[0], shape_runs, column, row, reach)
        left, right = max(column - widest, 0), min(column + size[shape, 0] + widest, columns)
        link_cells(
            taken[0], clear[0], left, right, max(row - reach_rows, 0), min(best_top + reach_rows, rows)
        )
        work += ((best_top - row) * columns + 4 * reach_rows * reach_rows * len(shape_runs)) // 50
    return is_used.sum(), crossings, top, work, chosen, place


@compiled
def _page_count(inner: IntArray, cells: int) -> int:
    """Return the number of neighbouring pages that are needed for a number of cells."""
    count = 1
    while count < len(inner) and inner[count - 1, 1] + 1 - inner[0, 0] < cells:
        count += 1
    return count


@compiled
def _mark_pages(
    is_used: BoolArray,
    runs: IntArray,
    column: int,
    row: int,
    across: IntArray,
    upward: IntArray,
    stores: bool,
) -> int:
    """Return the number of further pages that a shape needs: cells in the overlap of pages need none of them.

    Args:
        is_used: (rows, columns) whether a page is used; changed in place if `stores` is true.
        runs: (r, 3) the runs of the shape.
        column, row: the place of its lower left cell.
        across, upward: (k, 2) the cells of columns and rows of pages that are on no other page.
        stores: whether the pages are used afterwards.
    """
    is_new = np.zeros(is_used.shape, np.bool_)
    r, count = 0, 0
    for k in range(len(runs)):
        y, left, right = row + runs[k, 0], column + runs[k, 1], column + runs[k, 2]
        while r + 1 < len(upward) and y > upward[r, 1]:
            r += 1
        while r > 0 and y < upward[r, 0] and y <= upward[r - 1, 1]:
            r -= 1
        if y < upward[r, 0] or y > upward[r, 1]:
            continue
        for q in range(len(across)):
            if left <= across[q, 1] and right >= across[q, 0] and not is_used[r, q] and not is_new[r, q]:
                is_new[r, q] = True
                count += 1
    if stores:
        is_used |= is_new
    return count
