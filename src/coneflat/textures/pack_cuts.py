"""Cuts of charts that let them be packed more tightly: branches are cut off where they are narrow.

M. Limper, N. Vining, A. Sheffer, "Box Cutter: atlas refinement for efficient packing via void elimination", 2018. As
there, cuts are searched with a beam, and what they gain is found by packing. A cut is a shortest path between two
places of a chart's border that are close to each other, compared with the area that it separates.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..atlas import ChartLayout, Effort, Outlines, as_disk, pack, square_angle, straight_angle, with_charts
from ..base import BoolArray, ComplexArray, FloatArray, IntArray, check_cancelled
from ..errors import OptionError
from ..linalg import MultiGraph
from ..mesh import label_charts
from ..mesh.connectivity import TriangleMesh
from ..stages import Layout

# A cut must increase the covered fraction of the square by PRICE for each length of the square root of the area, and
# all cuts together may cost SHARE of the charts' borders, in which a seam counts twice, or the root of the area: with
# SHARE alone, 48 models have seams 2% shorter in total, and fandisk covers 0.57 of the texture instead of 0.76.
PRICE, SHARE = 0.1, 0.15
# Smallest area of a piece relative to that of all charts, and the largest number of charts that are considered. Smaller
# charts fit between larger ones.
MIN_PIECE, MAX_CHARTS = 0.02, 32
# Points of a border between which cuts are searched. Cuts whose ends are closer than MIN_SEPARATION of it are alike.
SAMPLES, MIN_SEPARATION = 96, 0.06
# Cuts tried per set of charts, sets continued per step, and steps without a gain after which the search ends.
TRIED, CONTINUED, PATIENCE = 6, 2, 2
QUICK = Effort(columns=128, tries=12)


def cut_for_packing(
    layouts: Sequence[Layout], costs: Callable[[int], FloatArray], gap: float
) -> list[Layout]:
    """Return layouts whose charts are cut such that they cover more of a square, where this is worth the seams.

    Args:
        layouts: layouts of one or several meshes, which are packed together.
        costs: returns for a layout, by its index, (e,) the costs of cutting its mesh's edges, infinite for those not to
            cut.
        gap: minimum distance between charts, relative to the side of the square.
    """
    charts = _largest_charts(layouts, costs)
    area = sum(chart.shape.area for chart in charts)
    if not area > 0:
        return list(layouts)
    borders = sum(float(chart.border_costs[np.isfinite(chart.border_costs)].sum()) for chart in charts)
    return _cut(layouts, charts, _search(charts, area, max(SHARE * borders, area**0.5), gap).pieces)


def cut_into(layouts: Sequence[Layout], costs: Callable[[int], FloatArray], count: int) -> list[Layout]:
    """Return layouts whose charts are cut until there are `count`, as far as possible.

    The next cut is always the shortest one relative to the root of the area that it separates.

    Args:
        layouts, costs: as for `cut_for_packing`.
        count: the number of all charts.
    """
    charts = _largest_charts(layouts, costs, 1 / (4 * count))
    pieces, missing = list(charts), count - sum(int(layout.chart.max()) + 1 for layout in layouts)
    while missing > 0:
        check_cancelled()
        cuts = [min(piece.cuts, key=lambda cut: cut.score) for piece in pieces if piece.cuts]
        if not cuts:
            break
        best = min(cuts, key=lambda cut: cut.score)
        pieces = [piece for piece in pieces if piece is not best.piece] + list(best.pieces)
        missing -= len(best.pieces) - 1
    return _cut(layouts, charts, pieces)


def _cut(layouts: Sequence[Layout], charts: Sequence[_Piece], pieces: Sequence[_Piece]) -> list[Layout]:
    """Return layouts in which pieces replace the charts that they are pieces of."""
    label = [layout.chart.copy() for layout in layouts]
    for piece in pieces:
        if piece not in charts:
            label[piece.layout][piece.faces] = label[piece.layout].max() + 1
    return [
        with_charts(
            layout, ChartLayout(layout.points, layout.corners, layout.chart).split(chart).renumbered()
        )
        if chart.max() > layout.chart.max()
        else layout
        for layout, chart in zip(layouts, label, strict=True)
    ]


@dataclass(frozen=True, eq=False)
class _Shape:
    """The outline of a chart.

    Attributes:
        sides: (s, 2) start and end of each side; the rectangle of least area around them is along the axes, and the
            half with more area is below.
        area: the enclosed area.
    """

    sides: ComplexArray
    area: float

    @classmethod
    def of(cls, sides: ComplexArray) -> _Shape:
        turned = sides * np.exp(1j * straight_angle(sides.ravel(), np.empty(0)))
        swept, height = _swept(sides), turned.imag
        is_top_heavy = swept @ (height.sum(axis=1) / 3 - (height.min() + height.max()) / 2) > 0
        return cls(-turned if is_top_heavy else turned, float(swept.sum()))


def _swept(sides: ComplexArray) -> FloatArray:
    """Return (s,) the signed areas of the triangles between sides (s, 2) and the origin."""
    return np.asarray((np.conj(sides[:, 0]) * sides[:, 1]).imag / 2)


@dataclass(frozen=True, eq=False)
class _Cut:
    """A cut of a piece.

    Attributes:
        piece: the piece.
        edges: edges of its disk.
        cost: their cost.
        outlines: the sides of the two outlines, (s, 2) each.
        area: the area of the smaller one.
    """

    piece: _Piece
    edges: IntArray
    cost: float
    outlines: tuple[ComplexArray, ComplexArray]
    area: float

    @property
    def score(self) -> float:
        """The cost relative to the root of the area of the smaller piece."""
        return self.cost / self.area**0.5

    @cached_property
    def shapes(self) -> list[_Shape]:
        """The two outlines."""
        return [_Shape.of(sides) for sides in self.outlines]

    @cached_property
    def pieces(self) -> tuple[_Piece, ...]:
        """The pieces, at least two."""
        joined = ~self.piece.disk.is_boundary_edge
        joined[self.edges] = False
        count, label = label_charts(self.piece.disk, joined)
        return tuple(self.piece.part(label == i) for i in range(count))


@dataclass(frozen=True, eq=False)
class _Piece:
    """A chart or a piece of one.

    Attributes:
        layout: the index of its layout.
        faces: (m,) indices of its triangles there.
        disk: the triangles as a mesh in the plane.
        costs: (3m,) cost of cutting the side opposite each corner.
        min_area: smallest area of a piece to cut off.
    """

    layout: int
    faces: IntArray
    disk: TriangleMesh
    costs: FloatArray
    min_area: float

    def part(self, chosen: BoolArray) -> _Piece:
        """Return the chosen triangles (m,) as a piece."""
        disk = as_disk(self.disk.vertices, self.disk.faces[chosen])
        costs = self.costs.reshape(-1, 3)[chosen].ravel()
        return _Piece(self.layout, self.faces[chosen], disk, costs, self.min_area)

    @cached_property
    def _places(self) -> ComplexArray:
        return np.ascontiguousarray(self.disk.vertices).view(np.complex128)[:, 0]

    @cached_property
    def shape(self) -> _Shape:
        """The outline."""
        outer = self.disk.edge_halfedges[self.disk.is_boundary_edge, 0]
        return _Shape.of(self._places[np.stack(self.disk.ends_of(outer), axis=1)])

    @cached_property
    def _rim(self) -> IntArray:
        """The vertices of the border in order; the first is farthest from their mean."""
        rim = self.disk.tails[self.disk.boundary_walks()[0]]
        return np.roll(rim, -int(np.abs(self._places[rim] - self._places[rim].mean()).argmax()))

    @cached_property
    def _along(self) -> FloatArray:
        """The position of each vertex of the border along it, as a fraction of its length."""
        loop = self._places[self._rim]
        until = np.cumsum(np.abs(np.roll(loop, -1) - loop))
        return np.append(0.0, until[:-1]) / until[-1]

    def _away(self, at: IntArray, from_one: IntArray) -> FloatArray:
        """Return distances along the border between its vertices, as fractions of its length."""
        way = np.abs(self._along[at] - self._along[from_one])
        return np.minimum(way, 1 - way)

    @property
    def border_costs(self) -> FloatArray:
        """The costs of the sides on the border."""
        return self.costs[self.disk.edge_halfedges[self.disk.is_boundary_edge, 0]]

    @cached_property
    def graph(self) -> MultiGraph:
        """The inner edges with their costs."""
        costs = np.where(self.disk.is_boundary_edge, np.inf, self.costs[self.disk.edge_halfedges[:, 0]])
        return MultiGraph(len(self.disk.vertices), self.disk.edges, costs, self.disk.incident_edges)

    @cached_property
    def cuts(self) -> list[_Cut]:
        """Cuts that differ from each other, the shortest ones relative to the area that they separate."""
        if self.shape.area < 2 * self.min_area or self.disk.boundary_loops[0] > 1:
            return []
        loop = self._places[self._rim]
        swept = np.append(0.0, np.cumsum((np.conj(loop) * np.roll(loop, -1)).imag))
        chosen = np.unique(np.searchsorted(self._along, np.arange(SAMPLES) / SAMPLES, side="right") - 1)
        starts, ends = chosen[np.stack(np.triu_indices(len(chosen), 1))]
        # The area between the border from one to the other and the chord between them.
        part = (swept[ends] - swept[starts] + (np.conj(loop[ends]) * loop[starts]).imag) / 2
        smaller = np.minimum(part, self.shape.area - part)
        score = np.abs(loop[ends] - loop[starts]) / np.sqrt(np.maximum(smaller, self.min_area))
        order = np.argsort(score, kind="stable")
        order = order[smaller[order] > self.min_area]
        starts, ends, cuts = starts[order], ends[order], list[_Cut]()
        for _ in range(3 * TRIED):
            if not len(starts) or len(cuts) == TRIED:
                break
            cut = self._cut_between(starts[0], ends[0])
            cuts += [] if cut is None else [cut]
            straight = np.maximum(self._away(starts, starts[0]), self._away(ends, ends[0]))
            crossed = np.maximum(self._away(starts, ends[0]), self._away(ends, starts[0]))
            is_other = np.minimum(straight, crossed) >= MIN_SEPARATION
            starts, ends = starts[is_other], ends[is_other]
        return cuts

    def _cut_between(self, start: IntArray, end: IntArray) -> _Cut | None:
        """Return the shortest cut between the surroundings of two vertices of the border, if it makes two pieces."""
        every = np.arange(len(self._rim))
        starts, ends = (self._rim[self._away(every, at) < MIN_SEPARATION / 3] for at in (start, end))
        paths = self.graph.shortest_paths(starts, ends)
        nearest = ends[np.argsort(paths.distance[ends], kind="stable")[:1]]
        path = np.append(paths.nodes_to(nearest), paths.source[nearest])
        inner, edges = path[1:-1], paths.edge[path[:-1]]
        if len(path) < 2 or path[-1] < 0 or self.disk.is_boundary_vertex[inner].any():
            return None
        low, high = (int(np.flatnonzero(self._rim == corner)[0]) for corner in (path[-1], path[0]))
        if low > high:
            low, high, inner = high, low, inner[::-1]
        loops = (
            np.concatenate([self._rim[low : high + 1], inner]),
            np.concatenate([self._rim[high:], self._rim[: low + 1], inner[::-1]]),
        )
        one_side, other_side = (self._places[np.column_stack([loop, np.roll(loop, -1)])] for loop in loops)
        area = min(_swept(sides).sum() for sides in (one_side, other_side))
        if area < self.min_area:
            return None
        return _Cut(self, edges, float(self.graph.costs[edges].sum()), (one_side, other_side), float(area))


@dataclass(frozen=True, eq=False)
class _State:
    """Pieces of charts.

    Attributes:
        pieces: the pieces.
        cost: cost of the cuts.
        value: the covered fraction of the square, less the price of the cuts.
    """

    pieces: tuple[_Piece, ...]
    cost: float
    value: float


def _largest_charts(
    layouts: Sequence[Layout], costs: Callable[[int], FloatArray], min_piece: float = MIN_PIECE
) -> list[_Piece]:
    """Return the largest charts of layouts, of which pieces may have a minimum share of the area."""
    largest = []
    for i, layout in enumerate(layouts):
        sides = layout.points[layout.corners[:, 1:]] - layout.points[layout.corners[:, :1]]
        areas = np.bincount(layout.chart, np.abs(np.linalg.det(sides)) / 2)
        largest += [(float(areas[c]), i, int(c)) for c in np.argsort(-areas, kind="stable")[:MAX_CHARTS]]
    largest.sort(key=lambda chart: -chart[0])
    min_area = min_piece * sum(chart[0] for chart in largest)
    charts = []
    for _, i, c in largest[:MAX_CHARTS]:
        faces = np.flatnonzero(layouts[i].chart == c)
        disk = as_disk(layouts[i].points, layouts[i].corners[faces])
        cost = costs(i)[layouts[i].mesh.halfedge_edges].reshape(-1, 3)[faces].ravel()
        charts.append(_Piece(i, faces, disk, cost, min_area))
    return charts


def _search(charts: Sequence[_Piece], area: float, budget: float, gap: float) -> _State:
    """Return the pieces of charts with the largest value; their cuts cost at most `budget`."""
    best = _State(tuple(charts), 0.0, _covered([piece.shape for piece in charts], area, gap))
    states, without_gain = [best], 0
    while states and without_gain < PATIENCE:
        check_cancelled()
        trials: list[tuple[float, float, _State, _Cut]] = []
        for state in states:
            cuts = [cut for piece in state.pieces for cut in piece.cuts if state.cost + cut.cost <= budget]
            for cut in sorted(cuts, key=lambda cut: cut.score)[:TRIED]:
                cost = state.cost + cut.cost
                if any(
                    abs(cost - trial_cost) <= 1e-9 * cost for _, trial_cost, *_ in trials
                ):  # in another order
                    continue
                price = PRICE * cost / area**0.5
                shapes = [piece.shape for piece in state.pieces if piece is not cut.piece]
                needed = price + trials[CONTINUED - 1][0] if len(trials) >= CONTINUED else 0.0
                covered = _covered([*shapes, *cut.shapes], area, gap, needed)
                trials.append((covered - price, cost, state, cut))
                trials.sort(key=lambda trial: -trial[0])
        states = [
            _State(
                (
                    *(piece for piece in state.pieces if piece is not cut.piece),
                    *cut.pieces,
                ),
                cost,
                value,
            )
            for value, cost, state, cut in trials[:CONTINUED]
        ]
        without_gain += 1
        if states and states[0].value > best.value:
            best, without_gain = states[0], 0
    return best


def _covered(shapes: Sequence[_Shape], area: float, gap: float, needed: float = 0.0) -> float:
    """Return about the fraction of a square that shapes of a total area cover; 0 if the gap leaves no space.

    A fraction that is below the needed one may be too small.
    """
    if len(shapes) == 1:
        points = shapes[0].sides.ravel()
        points = points * np.exp(1j * square_angle(points, np.empty(0)))
        return float(area / max(np.ptp(points.real), np.ptp(points.imag)) ** 2)
    shapes = sorted(shapes, key=lambda shape: -shape.area)
    start = np.cumsum([0, *(len(shape.sides) for shape in shapes)])
    outlines = Outlines(np.concatenate([shape.sides for shape in shapes]), start)
    angles = np.tile(np.arange(0, 2 * np.pi, np.pi / 4), (len(shapes), 1))
    effort = replace(QUICK, max_side=(area / max(needed, 1e-9)) ** 0.5)
    try:
        packing = pack(outlines, area, angles, np.ones(angles.shape, dtype=bool), gap, 1, effort)
    except OptionError:
        return 0.0
    return area / packing.side**2
