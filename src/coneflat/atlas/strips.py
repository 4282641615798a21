"""Placement of outlines at their true size on a strip, or on as few sheets of the same size as possible."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.progress import begin_step
from .charts import Outlines
from .grid import NO_OBSTACLES
from .masks import Masks, cover_charts
from .placement import Plan, place_all, reach_of
from .tight_packing import MAX_WORK, changed_plan

# Columns of the grid across a sheet by default, and the largest number of cells of all sheets.
COLUMNS, MAX_CELLS = 400, 16_000_000
# Number of random changes that are tried.
TRIES = 150


@dataclass(frozen=True, eq=False)
class SheetPacking:
    """Placement of k outlines.

    Attributes:
        angle: (k,) angle by which each outline is rotated, radians.
        shift: (k,) translation after the rotation, as complex numbers.
        sheet: (k,) the sheet of each outline, from 0; its lower left corner is at 0.
        height: how far the outlines reach on a sheet.
    """

    angle: FloatArray
    shift: NDArray[np.complex128]
    sheet: IntArray
    height: float


class _Try(NamedTuple):
    plan: Plan
    rows: int
    chosen: IntArray
    place: IntArray


def pack_strip(
    outlines: Outlines,
    angles: FloatArray,
    gap: float,
    width: float,
    columns: int = COLUMNS,
    tries: int = TRIES,
) -> SheetPacking | None:
    """Return outlines packed on a strip of a width, as short as possible; None if an outline is too wide for it.

    Args:
        outlines: outlines of k charts.
        angles: (k, t) candidate rotation angles, radians.
        gap: minimum distance between outlines.
        width: width of the strip.
        columns: columns of the grid across the width, whose cells outlines do not share.
        tries: number of random changes that are tried.
    """
    grid = _Grid.of(outlines, angles, gap, width, columns)
    if not grid.fits(width):
        return None
    # One above the other, the outlines fit in any case.
    heights = grid.masks.size[:, 1].reshape(angles.shape)
    rows = int(heights.max(axis=1).sum()) + (len(outlines) + 1) * len(grid.reach)
    rng, best = np.random.default_rng(0), grid.place(grid.first_plan, 1, rows)
    for _ in range(tries if best.rows <= rows and len(outlines) > 1 else 0):
        if grid.work > MAX_WORK:
            break
        begin_step()
        candidate = grid.place(changed_plan(best.plan, grid.allowed, rng), 1, best.rows)
        best = candidate if candidate.rows <= best.rows else best
    return grid.packing(best) if best.rows <= rows else None


def pack_sheets(
    outlines: Outlines, angles: FloatArray, gap: float, width: float, height: float, columns: int = COLUMNS
) -> SheetPacking | None:
    """Return outlines packed on as few sheets as possible; None if an outline is too large for a sheet.

    Args:
        outlines, angles, gap, columns: as for `pack_strip`.
        width, height: size of a sheet.
    """
    grid = _Grid.of(outlines, angles, gap, width, columns)
    rows = int(height / grid.masks.cell)
    if not grid.fits(width, height):
        return None
    rng, area = np.random.default_rng(0), grid.covered_cells
    count = max(int(np.ceil(area / (rows * grid.columns))), 1)
    while count < len(outlines) and count * rows * grid.columns <= MAX_CELLS:
        plan = grid.first_plan
        for _ in range(TRIES):
            begin_step()
            placed = grid.place(plan, count, rows)
            if placed.rows <= rows:
                return grid.packing(placed)
            if grid.work > MAX_WORK:
                break
            plan = changed_plan(grid.first_plan, grid.allowed, rng)
        count += 1
    placed = grid.place(grid.first_plan, len(outlines), rows)
    return grid.packing(placed) if placed.rows <= rows else None


class _Grid:
    """The cells that outlines cover, and the work that was done."""

    def __init__(self, masks: Masks, allowed: BoolArray, reach: IntArray, columns: int, count: int) -> None:
        self.masks, self.allowed, self.reach, self.columns, self.count = masks, allowed, reach, columns, count
        self.work = 0

    @classmethod
    def of(cls, outlines: Outlines, angles: FloatArray, gap: float, width: float, columns: int) -> _Grid:
        """Return the grid for outlines on a strip; arguments as of `pack_strip`."""
        cell = width / columns
        masks = cover_charts(outlines, angles, cell)
        return cls(masks, np.ones(angles.size, dtype=bool), reach_of(gap / cell), columns, len(outlines))

    @property
    def covered_cells(self) -> int:
        """The smallest number of cells that the outlines cover."""
        cells = self.masks.runs[:, 2] - self.masks.runs[:, 1] + 1
        sums = np.add.reduceat(cells, self.masks.first[:-1])
        return int(sums.reshape(self.count, -1).min(axis=1).sum())

    def fits(self, width: float, height: float = np.inf) -> bool:
        """Return whether each outline fits, and forbid the angles at which one does not."""
        size = self.masks.size * self.masks.cell
        self.allowed = (size[:, 0] <= width * (1 + 1e-9)) & (size[:, 1] <= height * (1 + 1e-9))
        return bool(self.allowed.reshape(self.count, -1).any(axis=1).all())

    @property
    def first_plan(self) -> Plan:
        """Those with the largest boxes first."""
        boxes = self.masks.size.sum(axis=1).reshape(self.count, -1).min(axis=1)
        return Plan(np.argsort(-boxes, kind="stable"), self.allowed, np.zeros(self.count))

    def place(self, plan: Plan, sheets: int, rows: int) -> _Try:
        """Return the outlines placed by a plan on sheets with a number of rows."""
        group = np.arange(self.count)
        used_rows, work, chosen, place = place_all(
            plan, group, self.masks, self.reach, sheets, self.columns, rows, 1, NO_OBSTACLES
        )
        self.work += work
        return _Try(plan, used_rows, chosen, place)

    def packing(self, placed: _Try) -> SheetPacking:
        """Return outlines placed on the grid as a packing."""
        sheet, column, row = placed.place.T
        masks, chosen = self.masks, placed.chosen
        shift = (column + 1j * row) * masks.cell - masks.low[chosen]
        return SheetPacking(masks.angle[chosen], shift, sheet, placed.rows * masks.cell)
