"""Cuts of charts that let them be packed more tightly: branches are cut off where they are narrow.

As by Limper et al., cuts are searched with a beam, and what they gain is found by packing. A cut is a shortest path
between two places of a chart's border that are close to each other, compared with the area that it separates.

References:
    M. Limper, N. Vining, A. Sheffer, "Box Cutter: atlas refinement for efficient packing via void elimination", 2018.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..atlas import ChartLayout, Effort, Outlines, as_disk, pack_outlines, square_angle, with_charts
from ..base import FloatArray, check_cancelled, part_of_work, within_time
from ..errors import OptionError
from ..stages import Layout
from .chart_pieces import MAX_CUTS, Cut, Outline, Piece
from .free_seams import seam_edges
from .small_charts import SMALL_AREA, count_charts

# A cut must increase the covered fraction of the square by PRICE, over the root of the strength, for each length of the
# square root of the area. All cuts together may cost SHARE of the charts' borders, in which a seam counts twice, or the
# root of the area: with SHARE alone, 48 models have seams 2% shorter in total.
PRICE, SHARE = 0.1, 0.15
# Smallest area of a piece relative to that of all charts, and the largest number of charts that are considered. Smaller
# charts fit between larger ones.
MIN_PIECE, MAX_CHARTS = 0.02, 32
# Sets of charts that are continued per step of the beam search, and steps without a gain after which it ends.
CONTINUED, PATIENCE = 2, 2
# Fraction of the work that is left, for the progress, that a step is.
STEP_SHARE = 0.25
QUICK = Effort(columns=128, tries=12)


def cut_for_packing(
    layouts: Sequence[Layout], costs: Callable[[int], FloatArray], gap: float, strength: float
) -> list[Layout]:
    """Return layouts whose charts are cut such that they cover more of a square, where this is worth the seams.

    The cuts of a layout are at most the share of its seams, these cuts included, that the strength is. With less than
    1, layouts without seams are not cut.

    Args:
        layouts: layouts of one or several meshes, which are packed together.
        costs: returns for a layout, by its index, (e,) the costs of cutting its mesh's edges, infinite for those not to
            cut.
        gap: minimum distance between charts, relative to the side of the square.
        strength: from 0, for no cuts, to 1.
    """
    is_cut = [len(layout.seams) > 0 for layout in layouts]
    seams = np.array([_seam_cost(layout, costs(i)) if is_cut[i] else 0.0 for i, layout in enumerate(layouts)])
    if strength == 0 or not (seams.any() or strength == 1):
        return list(layouts)
    charts = _largest_charts(layouts, costs)
    area = sum(chart.area for chart in charts)
    if not area > 0:
        return list(layouts)
    borders = sum(float(chart.border_costs[np.isfinite(chart.border_costs)].sum()) for chart in charts)
    search = _BeamSearch(area, max(SHARE * borders, area**0.5), seams, strength, gap)
    return with_pieces(layouts, charts, search.best_from(charts).pieces)


def _seam_cost(layout: Layout, costs: FloatArray) -> float:
    """Return the cost of the seams of a layout that need not be avoided."""
    seam_costs = costs[seam_edges(layout)]
    return float(seam_costs[np.isfinite(seam_costs)].sum())


def cut_into(layouts: Sequence[Layout], costs: Callable[[int], FloatArray], count: int) -> list[Layout]:
    """Return layouts whose charts are cut until there are `count`, as far as possible.

    The next cut is always the shortest one relative to the root of the area that it separates. Charts that are smaller
    than a piece may be, such as slivers that were overlaps, are not counted.

    Args:
        layouts, costs: as for `cut_for_packing`.
        count: the number of all charts.
    """
    min_piece = 1 / (4 * count)
    charts = _largest_charts(layouts, costs, min_piece)
    min_chart = min(min_piece, SMALL_AREA)
    pieces, missing = list(charts), count - sum(count_charts(layout, min_chart) for layout in layouts)
    while missing > 0:
        check_cancelled()
        cuts = within_time(partial(_shortest_cuts, pieces))
        if not cuts:
            break
        best = min(cuts, key=lambda cut: cut.score)
        pieces = [piece for piece in pieces if piece is not best.piece] + list(best.pieces)
        missing -= len(best.pieces) - 1
    return with_pieces(layouts, charts, pieces)


def _shortest_cuts(pieces: Sequence[Piece]) -> list[Cut]:
    """Return the shortest cut of each piece that has any, relative to the root of the area that it separates."""
    return [min(piece.cuts, key=lambda cut: cut.score) for piece in pieces if piece.cuts]


def _largest_charts(
    layouts: Sequence[Layout], costs: Callable[[int], FloatArray], min_piece: float = MIN_PIECE
) -> list[Piece]:
    """Return the largest charts of layouts, of which pieces may have a minimum share of the area."""
    sizes = list[tuple[float, int, int]]()  # area, index of the layout, chart
    for i, layout in enumerate(layouts):
        sides = layout.points[layout.corners[:, 1:]] - layout.points[layout.corners[:, :1]]
        areas = np.bincount(layout.chart, np.abs(np.linalg.det(sides)) / 2)
        largest = np.argsort(-areas, kind="stable")[:MAX_CHARTS]
        sizes += [(float(areas[chart]), i, int(chart)) for chart in largest]
    sizes.sort(key=lambda size: -size[0])
    min_area = min_piece * sum(area for area, _, _ in sizes)
    charts = []
    for _, i, chart in sizes[:MAX_CHARTS]:
        layout, faces = layouts[i], np.flatnonzero(layouts[i].chart == chart)
        disk = as_disk(layout.points, layout.corners[faces])
        side_costs = costs(i)[layout.mesh.halfedge_edges].reshape(-1, 3)[faces].ravel()
        charts.append(Piece.of(i, faces, disk, side_costs, min_area))
    return charts


def with_pieces(layouts: Sequence[Layout], charts: Sequence[Piece], pieces: Sequence[Piece]) -> list[Layout]:
    """Return layouts in which pieces replace the charts that they are pieces of."""
    labels = [layout.chart.copy() for layout in layouts]
    for piece in pieces:
        if piece not in charts:
            labels[piece.layout][piece.faces] = labels[piece.layout].max() + 1
    return [
        with_charts(
            layout, ChartLayout(layout.points, layout.corners, layout.chart).split(label).renumbered()
        )
        if label.max() > layout.chart.max()
        else layout
        for layout, label in zip(layouts, labels, strict=True)
    ]


@dataclass(frozen=True, eq=False)
class _State:
    """Pieces of charts.

    Attributes:
        pieces: the pieces.
        costs: (l,) cost of the cuts of each layout.
        value: the covered fraction of the square, less the price of the cuts.
    """

    pieces: tuple[Piece, ...]
    costs: FloatArray
    value: float

    def costs_after(self, cut: Cut) -> FloatArray:
        """Return (l,) the costs after a further cut."""
        costs = self.costs.copy()
        costs[cut.piece.layout] += cut.cost
        return costs


@dataclass(frozen=True, eq=False)
class _Trial:
    """A state with a further cut, and the costs (l,) and the value of the state after it."""

    state: _State
    cut: Cut
    costs: FloatArray
    value: float

    def state_after(self) -> _State:
        """Return the state after the cut."""
        uncut = [piece for piece in self.state.pieces if piece is not self.cut.piece]
        return _State((*uncut, *self.cut.pieces), self.costs, self.value)


@dataclass(frozen=True)
class _BeamSearch:
    """The search for cuts with the largest value.

    Attributes:
        area: area of all charts.
        budget: what all cuts together may cost.
        seams: (l,) cost of the seams of each layout before the cuts.
        strength: the largest share of cuts among the seams of a layout; 0 would be an infinite price.
        gap: minimum distance between charts, relative to the side of the square.
    """

    area: float
    budget: float
    seams: FloatArray
    strength: float
    gap: float

    @property
    def price(self) -> float:
        """The covered fraction that cuts must gain for each length of the root of the area."""
        return PRICE / self.strength**0.5

    def best_from(self, charts: Sequence[Piece]) -> _State:
        """Return the pieces of charts with the largest value."""
        outlines = [chart.outline for chart in charts]
        best = _State(
            tuple(charts), np.zeros(len(self.seams)), _covered_fraction(outlines, self.area, self.gap)
        )
        states, without_gain = [best], 0
        while states and without_gain < PATIENCE:
            check_cancelled()
            with part_of_work(STEP_SHARE, "cuts for packing"):
                states = within_time(partial(self._states_after, states)) or []
            without_gain += 1
            if states and states[0].value > best.value:
                best, without_gain = states[0], 0
        return best

    def _states_after(self, states: Sequence[_State]) -> list[_State]:
        """Return the best states after one further cut of given ones."""
        return [trial.state_after() for trial in self._best_trials(states)]

    def _best_trials(self, states: Sequence[_State]) -> list[_Trial]:
        """Return the trials with the largest values of one further cut of each state."""
        trials = list[_Trial]()
        for state in states:
            cuts = [cut for piece in state.pieces for cut in piece.cuts if self._allows(state, cut)]
            for cut in sorted(cuts, key=lambda cut: cut.score)[:MAX_CUTS]:
                costs = state.costs_after(cut)
                if any(np.allclose(costs, trial.costs, rtol=1e-9, atol=0) for trial in trials):
                    continue  # the same cuts in another order
                # A trial that cannot be among the best need not be packed well.
                needed = trials[CONTINUED - 1].value if len(trials) >= CONTINUED else -np.inf
                trials.append(_Trial(state, cut, costs, self._value_after(state, cut, needed)))
                trials.sort(key=lambda trial: -trial.value)
        return trials[:CONTINUED]

    def _allows(self, state: _State, cut: Cut) -> bool:
        """Return whether a further cut is within the budget and the share that cuts may be of the seams."""
        costs = state.costs_after(cut)
        is_share_small = (1 - self.strength) * costs <= self.strength * self.seams
        return bool(costs.sum() <= self.budget and is_share_small.all())

    def _value_after(self, state: _State, cut: Cut, needed: float) -> float:
        """Return the value after a cut; one that is below the needed value may be too small."""
        price = self.price * state.costs_after(cut).sum() / self.area**0.5
        outlines = [piece.outline for piece in state.pieces if piece is not cut.piece]
        return _covered_fraction([*outlines, *cut.outlines], self.area, self.gap, price + needed) - price


def _covered_fraction(outlines: Sequence[Outline], area: float, gap: float, needed: float = -np.inf) -> float:
    """Return about the fraction of a square that charts of a total area cover; 0 if the gap leaves no space.

    A fraction that is below the needed one may be too small.
    """
    if len(outlines) == 1:
        points = outlines[0].sides.ravel()
        points = points * np.exp(1j * square_angle(points, np.empty(0)))
        return float(area / max(np.ptp(points.real), np.ptp(points.imag)) ** 2)
    outlines = sorted(outlines, key=lambda outline: -outline.area)
    start = np.cumsum([0, *(len(outline.sides) for outline in outlines)])
    joined = Outlines(np.concatenate([outline.sides for outline in outlines]), start)
    angles = np.tile(np.arange(0, 2 * np.pi, np.pi / 4), (len(outlines), 1))
    effort = replace(QUICK, max_side=(area / max(needed, 1e-9)) ** 0.5)
    try:
        packing = pack_outlines(joined, area, angles, np.ones(angles.shape, dtype=bool), gap, 1, effort)
    except OptionError:
        return 0.0
    return area / packing.side**2
