"""The search for a tight packing: charts placed one after the other, in orders and at angles that are tried."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import BoolArray, FloatArray, IntArray
from ..errors import OptionError
from ..progress import go_on
from .charts import Outlines
from .masks import Masks, cover_charts, turned_boxes
from .strips import place_all

# Columns of the grids, from coarse to fine: the coarse one finds who goes where, the fine one closes the gaps.
GRIDS = (160, 400, 1000)
# Cells of all strips together at most, and the columns that so many charts need at least.
MOST_CELLS, COLUMNS_PER_CHART = 4_000_000, 8.0
# Tries on each grid, and work that ends them earlier, in comparisons of runs of cells: about a second.
TRIES = (1000, 240, 60)
WORK = 40_000_000
FILLS = 4  # but for so many charts that placing them all once is much of that
# Of more charts than MANY, those whose sizes differ by less than this factor count as alike.
MANY, ALIKE = 1000, 1.02
# The first grid is so much wider than charts without gaps would need, and than the longest of them; no round numbers,
# so that simple charts do not end where cells do and leave it to rounding which cell is the last.
ROOMY, LONGER = 1.2347, 1.0123
# How often, of all changes, charts change places; and, of so few charts, keep to the right. Of more, that does harm.
SWAPS, ASIDE, FEW = 0.7, 0.3, 5
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
    aside: FloatArray
    height: int
    work: int
    chosen: IntArray
    place: IntArray


class _Strips:
    """Charts on a grid, to be placed in strips, as the shapes that they may be; counts its work."""

    def __init__(self, masks: Masks, may: BoolArray, tiles: int) -> None:
        self.masks, self.may, self.tiles, self.work = masks, may, tiles, 0
        self.group = np.arange(len(masks.size) // masks.turns)
        if len(self.group) > MANY:
            _, self.group = np.unique(np.log(masks.cells) // np.log(ALIKE), return_inverse=True)

    def fill(
        self, order: IntArray, allowed: BoolArray, aside: FloatArray, reach: IntArray, width: int, limit: int
    ) -> _Placed:
        """Return charts placed in strips so wide; higher than the limit if not all found a place below it."""
        masks = self.masks
        chosen, place = np.empty(len(order), dtype=np.int64), np.empty((len(order), 3), dtype=np.int64)
        height, work = place_all(
            order, self.group, masks.turns, allowed, aside, masks.size, masks.runs, masks.first,
            masks.widest, reach, self.tiles, width, limit, chosen, place,
        )  # fmt: skip
        self.work += work
        return _Placed(order, allowed, aside, height, work, chosen, place)

    def packing(self, placed: _Placed, width: int) -> Packing:
        """Return the packing in strips as high as wide."""
        masks, (tile, column, row) = self.masks, placed.place.T
        shift = (column + 1j * row) * masks.cell - masks.low[placed.chosen]
        return Packing(width * masks.cell, masks.angle[placed.chosen], shift, tile)


def pack(
    outlines: Outlines,
    area: float,
    angles: FloatArray,
    allowed: BoolArray,
    gap: float,
    tiles: int,
    refine: BoolArray,
) -> Packing:
    """Return a tight packing of charts, none mirrored or scaled, in square tiles.

    Charts are placed one after the other, those in the largest boxes first, each where its top is lowest. The
    order, and the angles that each may take, are changed at random, a little each time, and a change is kept if the
    charts do not stand higher for it in strips of a given width; once they stand no higher than wide, the width is
    made smaller. On the finer grids this goes on, with angles closer and closer to those found.

    Args:
        outlines: of k charts.
        area: of all charts, about.
        angles: (k, t) radians, that charts are turned by.
        allowed: (k, t) which of these angles a chart may be turned by, one at least.
        gap: between charts, in units of the side of a tile, without its margins.
        tiles: number of tiles.
        refine: (k,) whether a chart may be turned by angles between the given ones.

    Raises:
        OptionError: the gap is too wide for so many charts.
    """
    rng = np.random.default_rng(0)
    most = int((MOST_CELLS / tiles) ** 0.5)
    coarse = min(max(GRIDS[0], int(COLUMNS_PER_CHART * (len(outlines) / tiles) ** 0.5)), most)
    strips, width, placed = _first(outlines, area, angles, allowed, gap, tiles, coarse)
    placed, best, width = _climb(strips, placed, _reach(gap * width), width, TRIES[0], rng)
    packing = strips.packing(best or placed, width)
    step = np.pi / angles.shape[1]
    for finer, tries in zip(GRIDS[1:], TRIES[1:], strict=True):
        columns = min(finer, most)
        if columns < 1.5 * coarse:
            continue
        coarse = columns
        step /= 2
        offsets = np.array([0.0, -step, step]) if refine.any() else np.zeros(1)
        angles = packing.angle[:, None] + offsets
        may = (refine[:, None] | (offsets == 0)).ravel()
        strips = _Strips(cover_charts(outlines, angles, packing.side / columns), may, tiles)
        reach = _reach(gap * columns)
        placed = strips.fill(placed.order, may, placed.aside, reach, columns, _above(columns))
        placed, best, width = _climb(strips, placed, reach, columns, tries, rng)
        if best is not None:
            packing = strips.packing(best, width)
    return _cropped(packing, outlines)


def _cropped(packing: Packing, outlines: Outlines) -> Packing:
    """Return charts in tiles that end where charts do, and not where cells do."""
    low, extent = turned_boxes(outlines, packing.angle[:, None])
    low, high = low[:, 0] + packing.shift, low[:, 0] + extent[:, 0] + packing.shift
    corner = complex(low.real.min(), low.imag.min())
    side = max(high.real.max() - corner.real, high.imag.max() - corner.imag)
    return Packing(min(side, packing.side), packing.angle, packing.shift - corner, packing.tile)


def _first(
    outlines: Outlines,
    area: float,
    angles: FloatArray,
    allowed: BoolArray,
    gap: float,
    tiles: int,
    columns: int,
) -> tuple[_Strips, int, _Placed]:
    """Return strips of cells, about so many columns, in which charts stand no higher than wide; the width, and how."""
    _, extent = turned_boxes(outlines, angles)
    extent = np.where(allowed, extent, complex(np.inf, np.inf))
    longest = float(np.maximum(extent.real, extent.imag).min(axis=1).max())
    side = max(ROOMY * (area / tiles) ** 0.5, LONGER * longest)
    strips = _Strips(cover_charts(outlines, angles, (side or 1.0) / columns), allowed.ravel(), tiles)
    order = np.argsort(-(extent.real + extent.imag).min(axis=1), kind="stable")
    width = columns
    while tiles * width**2 <= ROOM:
        placed = strips.fill(order, strips.may, np.zeros(len(order)), _reach(gap * width), width, width)
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
        go_on()
        if placed.height <= goal:
            best, width = _narrow(strips, placed, reach, goal, end)
            goal = width - 1
            placed = strips.fill(best.order, best.allowed, best.aside, reach, goal, _above(goal))
        if strips.work > end:
            break
        changed = strips.fill(
            *_changed(placed, strips.may, rng), reach, goal, min(placed.height, _above(goal))
        )
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
        narrower = strips.fill(placed.order, placed.allowed, placed.aside, reach, width - step, width - step)
        if narrower.height <= width - step:
            width, placed = width - step, narrower
            step = max(step, (width - placed.height) // 2)
        else:
            step //= 2
    return placed, width


def _changed(
    placed: _Placed, may: BoolArray, rng: np.random.Generator
) -> tuple[IntArray, BoolArray, FloatArray]:
    """Return another order, one or two pairs of charts having changed places, and other shapes for one or two.

    Or one or two keep to the right, by another part of the room there is.
    """
    order, allowed, aside = placed.order.copy(), placed.allowed.copy(), placed.aside.copy()
    count = len(order)
    turns = len(may) // count
    if rng.random() < SWAPS:
        for one, two in (rng.random((1 + int(2 * rng.random()), 2)) * count).astype(np.int64):
            order[[one, two]] = order[[two, one]]
    for chart in (rng.random(1 + int(2 * rng.random())) * count).astype(np.int64):
        share = (0.3, 0.6, 1.0)[int(3 * rng.random())]
        shapes = slice(chart * turns, (chart + 1) * turns)
        allowed[shapes] = may[shapes] & (rng.random(turns) < share)
    if count <= FEW and rng.random() < ASIDE:
        for chart in (rng.random(1 + int(2 * rng.random())) * count).astype(np.int64):
            aside[chart] = (0.0, rng.random(), 1.0)[int(3 * rng.random())]
    return order, allowed, aside


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
