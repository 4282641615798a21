"""Packing of charts around others that stay where they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.progress import begin_step
from ..errors import OptionError
from .charts import Charts, Outlines
from .grid import COLUMNS_PER_CHART, GROUP_RATIO, GROUPED_CHARTS, MAX_CELLS, Blocks
from .masks import Masks, cover, cover_charts
from .orient import along_axes, border_directions
from .pack import MAX_PLACEMENTS, QUARTER_TURNS, Frame
from .placement import Plan, place_all, reach_of
from .tight_packing import MAX_WORK, changed_plan

#: Least number of columns of the grid.
MIN_COLUMNS = 500
#: Changes of the plan that are tried at a scale, and the factor from one scale to the next smaller one.
TRIES, SHRINKING = 40, 0.96
#: Steps of the scale, relative to the one that the charts had, below which it is not enlarged further.
SCALE_STEP = 0.002
#: The smallest scale that is tried.
MIN_SCALE = 0.02


@dataclass(frozen=True, eq=False)
class Moves:
    """Similarities of k charts: the point z = u + iv comes to factor * z + shift.

    Attributes:
        factor, shift: (k,) complex numbers.
    """

    factor: NDArray[np.complex128]
    shift: NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class _Ground:
    """The grid of a texture in which charts are placed around others.

    Attributes:
        frame: the square of the texture without its margins.
        cell: width of a cell, relative to the side of the texture.
        columns: columns and rows of the square.
        step: cells across a block at whose corners charts begin.
        obstacles: (r, 3) runs of the cells of the charts that stay: row, first and last column.
    """

    frame: Frame
    cell: float
    columns: int
    step: int
    obstacles: IntArray

    @classmethod
    def of(cls, outlines: Outlines, frame: Frame, count: int) -> _Ground:
        """Return the grid with the outlines of charts that stay; count: number of all charts."""
        columns = int(min(max(MIN_COLUMNS, COLUMNS_PER_CHART * count**0.5), MAX_CELLS**0.5))
        across, step = float(columns), 1
        if frame.block_count is not None:
            across, step = Blocks.of(frame.block_count, columns)
            columns = int(across)
        cell, still = frame.side / across, np.zeros((len(outlines), 1))
        low = np.full((len(outlines), 1), (1 + 1j) * frame.low)
        size = np.full((len(outlines), 2), columns)
        runs, _ = cover(outlines.sides, outlines.start, still, low, size, cell)
        return cls(frame, cell, columns, step, runs)

    def placed(self, plan: Plan, masks: Masks) -> tuple[bool, int, IntArray, IntArray]:
        """Return whether all charts fit, the work done, the shape of each, and its place, as of `place_all`."""
        boxes = (masks.size.sum(axis=1) * self.cell).reshape(len(plan.order), -1).min(axis=1)
        group = np.arange(len(boxes))
        if len(boxes) > GROUPED_CHARTS:
            group = np.unique(np.log(boxes) // np.log(GROUP_RATIO), return_inverse=True)[1].ravel()
        reach = reach_of(self.frame.gap / self.cell)
        size = self.columns
        rows, work, chosen, place = place_all(
            plan, group, masks, reach, 1, size, size, self.step, self.obstacles
        )
        return rows <= size, work, chosen, place


@dataclass(frozen=True, eq=False)
class _Fit:
    """Charts that fit at a scale.

    Attributes:
        scale: their scale, at most 1.
        plan: the plan by which they were placed.
        moves: where they are.
    """

    scale: float
    plan: Plan
    moves: Moves


def pack_around(charts: Charts, is_pinned: BoolArray, frame: Frame, turns: int | None = None) -> Moves:
    """Return the moves that pack charts around pinned ones, which stay where they are.

    The other charts keep their scale if there is space for them; otherwise they have the largest common scale that is
    found. Charts are placed one after the other where their top is lowest, in several orders and at several angles.

    Args:
        charts: k charts in a texture.
        is_pinned: (k,) True for those that stay.
        frame: the square of the texture.
        turns: number of equal turns by which charts may be rotated; None for those that the number of charts permits.

    Raises:
        OptionError: there is no space for the other charts.
    """
    moves = Moves(np.ones(charts.count, np.complex128), np.zeros(charts.count, np.complex128))
    if is_pinned.all():
        return moves
    outlines = charts.outlines()
    ground = _Ground.of(_chosen(outlines, is_pinned), frame, charts.count)
    fit = _largest(_Search(_chosen(outlines, ~is_pinned), ground, turns))
    moves.factor[~is_pinned], moves.shift[~is_pinned] = fit.moves.factor, fit.moves.shift
    return moves


def _chosen(outlines: Outlines, is_chosen: BoolArray) -> Outlines:
    """Return the outlines of some charts."""
    lengths = np.diff(outlines.start)
    sides = outlines.sides[np.repeat(is_chosen, lengths)]
    return Outlines(sides, np.concatenate([[0], np.cumsum(lengths[is_chosen])]))


class _Search:
    """A search for a place of charts around others."""

    def __init__(self, outlines: Outlines, ground: _Ground, turns: int | None) -> None:
        count = len(outlines)
        finest = QUARTER_TURNS * min(max(MAX_PLACEMENTS // (QUARTER_TURNS * count), 1), 6)
        self._outlines, self._ground = outlines, ground
        self._angles = np.tile(np.arange(turns or finest) * (2 * np.pi / (turns or finest)), (count, 1))
        allowed = along_axes(border_directions(outlines), np.zeros(count), self._angles)
        self._permitted = allowed.ravel()
        boxes = [np.ptp(points.real) + np.ptp(points.imag) for points in map(outlines.points, range(count))]
        order = np.argsort(-np.array(boxes), kind="stable")
        self.first_plan = Plan(order, self._permitted, np.zeros(count))
        self._rng = np.random.default_rng(0)

    def fit(self, scale: float, plan: Plan, tries: int) -> _Fit | None:
        """Return charts that fit at a scale, by a plan or by random changes of it; None if none is found."""
        factors = np.full(len(self._outlines), scale + 0j)
        masks = cover_charts(self._outlines.times(factors), self._angles, self._ground.cell)
        total, candidate = 0, plan
        for _ in range(tries):
            begin_step()
            is_placed, work, chosen, place = self._ground.placed(candidate, masks)
            if is_placed:
                return _Fit(scale, candidate, self._moves(scale, masks, chosen, place))
            total += work
            if total > MAX_WORK:
                return None
            candidate = changed_plan(plan, self._permitted, self._rng)
        return None

    def _moves(self, scale: float, masks: Masks, chosen: IntArray, place: IntArray) -> Moves:
        corner = (place[:, 1] + 1j * place[:, 2]) * self._ground.cell + (1 + 1j) * self._ground.frame.low
        return Moves(scale * np.exp(1j * masks.angle[chosen]), corner - masks.low[chosen])


def _largest(search: _Search) -> _Fit:
    """Return charts at the largest scale at which they are found to fit, at most 1.

    Raises:
        OptionError: they do not fit.
    """
    fit, scale = search.fit(1.0, search.first_plan, TRIES), 1.0
    while fit is None:
        scale *= SHRINKING
        if scale < MIN_SCALE:
            raise OptionError(
                "the pinned charts leave no space for the others: move them, or use less padding or a higher resolution"
            )
        fit = search.fit(scale, search.first_plan, 1)
    step = (1.0 - fit.scale) / 2
    while fit.scale < 1 and step > SCALE_STEP:
        larger = search.fit(min(fit.scale + step, 1.0), fit.plan, TRIES)
        if larger is None:
            step /= 2
        else:
            fit = larger
    return fit


def similarities(before: FloatArray, after: FloatArray, chart: IntArray, count: int) -> Moves:
    """Return the similarity of each chart from one layout to another, by least squares.

    Args:
        before, after: (m, 3, 2) the corners of the triangles in both.
        chart: (m,) the chart of each triangle.
        count: number of charts k.
    """
    old, moved = (np.ascontiguousarray(uv).view(np.complex128)[..., 0] for uv in (before, after))

    def sums(values: NDArray[np.complex128]) -> NDArray[np.complex128]:
        real, imaginary = (np.bincount(chart, part.sum(axis=1), count) for part in (values.real, values.imag))
        return real + 1j * imaginary

    corners = 3 * np.bincount(chart, minlength=count)
    old_middle, new_middle = sums(old) / corners, sums(moved) / corners
    from_middle = old - old_middle[chart][:, None]
    spread = sums(np.abs(from_middle) ** 2 + 0j)
    factor = sums(np.conj(from_middle) * (moved - new_middle[chart][:, None])) / np.where(
        spread == 0, 1, spread
    )
    factor[spread == 0] = 1
    return Moves(factor, new_middle - factor * old_middle)
