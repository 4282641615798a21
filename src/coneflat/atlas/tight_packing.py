"""Search for a tight packing: charts are placed one after the other, in varying orders and at varying angles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import BoolArray, FloatArray
from ..base.progress import begin_step
from ..base.search_time import is_time_up
from .charts import Outlines
from .grid import Grid, Packing, Placed, grid_of
from .placement import Plan

# The work after which the search ends, in comparisons of runs of cells: about a second. Without it, 20,000 cards take
# 29 s instead of 1.4, and cover 0.74 instead of 0.70.
MAX_WORK = 40_000_000
# The same once the time of the search is up: a tenth of a second.
MAX_LATE_WORK = MAX_WORK // 10
# Up to OFFSET_CHARTS charts, a chart may be forced to the right, which happens in this fraction of the tries: two or
# three charts that must not be rotated cover up to 29% more. With more charts this makes the packing worse.
OFFSET_CHARTS, OFFSET_SHARE = 5, 0.3


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


def pack_outlines(
    outlines: Outlines,
    area: float,
    angles: FloatArray,
    allowed: BoolArray,
    gap: float,
    tiles: int,
    effort: Effort = Effort(),
    block_count: int | None = None,
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
        block_count: number of blocks across a tile without its margins; the boxes of charts begin at corners of blocks.
            None for any places.

    Returns:
        The best packing found.

    Raises:
        OptionError: the gap is too wide for this number of charts.
    """
    grid = grid_of(outlines, area, angles, allowed, gap, tiles, effort.columns, block_count)
    boxes = (grid.extent.real + grid.extent.imag).min(axis=1)
    plan = Plan(np.argsort(-boxes, kind="stable"), allowed.ravel(), np.zeros(len(outlines)))
    placed, width = grid.first_placed(plan)
    return grid.packing(*_improved(grid, placed, width, effort))


def _improved(grid: Grid, placed: Placed, width: int, effort: Effort) -> tuple[Placed, int]:
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
        if goal >= width or work > MAX_WORK or is_late or (work > MAX_LATE_WORK and is_time_up()):
            break
        begin_step()
        limit = goal + goal // 4 if last is best else min(last.height, goal + goal // 4)
        plan = best.plan if last is best else changed_plan(last.plan, permitted, rng)
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


def changed_plan(plan: Plan, permitted: BoolArray, rng: np.random.Generator) -> Plan:
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
