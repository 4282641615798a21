"""Charts, the pieces into which they can be cut, and the cuts: shortest paths between places of a border."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..atlas import as_disk, filled_disk, straight_angle
from ..base import BoolArray, ComplexArray, FloatArray, IntArray
from ..geometry import signed_double_areas
from ..linalg import MultiGraph
from ..mesh import label_charts
from ..mesh.connectivity import TriangleMesh

# Points of a border between which cuts are searched. Cuts whose ends are closer than MIN_SEPARATION of it are alike.
SAMPLES, MIN_SEPARATION = 96, 0.06
# Number of cuts of a piece that are considered.
MAX_CUTS = 6


@dataclass(frozen=True, eq=False)
class Outline:
    """The outline of a chart.

    Attributes:
        sides: (s, 2) start and end of each side; the rectangle of least area around them is along the axes, and the
            half with more area is below.
        area: the enclosed area.
    """

    sides: ComplexArray
    area: float

    @classmethod
    def of(cls, sides: ComplexArray) -> Outline:
        """Return the outline with given sides (s, 2) in any position."""
        turned = sides * np.exp(1j * straight_angle(sides.ravel(), np.empty(0)))
        swept, height = swept_areas(sides), turned.imag
        is_top_heavy = swept @ (height.sum(axis=1) / 3 - (height.min() + height.max()) / 2) > 0
        return cls(-turned if is_top_heavy else turned, float(swept.sum()))


def swept_areas(sides: ComplexArray) -> FloatArray:
    """Return (s,) the signed areas of the triangles between sides (s, 2) and the origin."""
    return np.asarray((np.conj(sides[:, 0]) * sides[:, 1]).imag / 2)


@dataclass(frozen=True, eq=False)
class Cut:
    """A cut of a piece.

    Attributes:
        piece: the piece.
        edges: edges of its disk.
        cost: their cost.
        sides: the sides of the two outlines, (s, 2) each.
        area: the area of the smaller one.
    """

    piece: Piece
    edges: IntArray
    cost: float
    sides: tuple[ComplexArray, ComplexArray]
    area: float

    @property
    def score(self) -> float:
        """The cost relative to the root of the area of the smaller piece."""
        return self.cost / self.area**0.5

    @cached_property
    def outlines(self) -> list[Outline]:
        """The two outlines."""
        return [Outline.of(sides) for sides in self.sides]

    @cached_property
    def pieces(self) -> tuple[Piece, ...]:
        """The pieces, at least two."""
        is_joined = ~self.piece.disk.is_boundary_edge
        is_joined[self.edges] = False
        count, label = label_charts(self.piece.disk, is_joined)
        return tuple(self.piece.subset(label == i) for i in range(count))


@dataclass(frozen=True, eq=False)
class Piece:
    """A chart or a piece of one.

    Attributes:
        layout: the index of its layout.
        faces: (m,) indices of its triangles there.
        disk: the triangles as a mesh in the plane, before those that fill holes.
        costs: cost of cutting the side opposite each corner of the disk.
        min_area: smallest area of a piece to cut off.
    """

    layout: int
    faces: IntArray
    disk: TriangleMesh
    costs: FloatArray
    min_area: float

    @classmethod
    def of(
        cls, layout: int, faces: IntArray, disk: TriangleMesh, costs: FloatArray, min_area: float
    ) -> Piece:
        """Return a piece of triangles (m,) of a layout, which are those of the disk, with its holes filled."""
        return cls(layout, faces, *filled_disk(disk, costs), min_area)

    def subset(self, is_chosen: BoolArray) -> Piece:
        """Return the chosen triangles of the disk as a piece."""
        disk = as_disk(self.disk.vertices, self.disk.faces[is_chosen])
        costs = self.costs.reshape(-1, 3)[is_chosen].ravel()
        faces = self.faces[is_chosen[: len(self.faces)]]
        return Piece(self.layout, faces, disk, costs, self.min_area)

    @cached_property
    def places(self) -> ComplexArray:
        """(n,) the vertices as complex numbers."""
        return np.ascontiguousarray(self.disk.vertices).view(np.complex128)[:, 0]

    @cached_property
    def area(self) -> float:
        """The area of its triangles, without holes."""
        return float(
            np.abs(signed_double_areas(self.disk.vertices[self.disk.faces[: len(self.faces)]])).sum() / 2
        )

    @cached_property
    def outline(self) -> Outline:
        """The outline, without those of holes."""
        outer = self.disk.edge_halfedges[self.disk.is_boundary_edge, 0]
        return Outline.of(self.places[np.stack(self.disk.ends_of(outer), axis=1)])

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
    def cuts(self) -> list[Cut]:
        """Cuts that differ from each other, the shortest ones relative to the area that they separate."""
        if self.outline.area < 2 * self.min_area:
            return []
        border = _Border.of(self)
        starts, ends = _narrow_pairs(self, border)
        cuts = list[Cut]()
        for _ in range(3 * MAX_CUTS):
            if not len(starts) or len(cuts) == MAX_CUTS:
                break
            cut = _cut_between(self, border, starts[0], ends[0])
            if cut is not None:
                cuts.append(cut)
            straight = np.maximum(border.distances(starts, starts[0]), border.distances(ends, ends[0]))
            crossed = np.maximum(border.distances(starts, ends[0]), border.distances(ends, starts[0]))
            is_different = np.minimum(straight, crossed) >= MIN_SEPARATION
            starts, ends = starts[is_different], ends[is_different]
        return cuts


@dataclass(frozen=True, eq=False)
class _Border:
    """The b vertices of the border of a piece in order; the first is the farthest from their mean.

    Attributes:
        vertices: (b,) the vertices.
        places: (b,) their places.
        positions: (b,) their positions along the border, as fractions of its length.
    """

    vertices: IntArray
    places: ComplexArray
    positions: FloatArray

    @classmethod
    def of(cls, piece: Piece) -> _Border:
        vertices = piece.disk.tails[piece.disk.boundary_walks()[0]]
        places = piece.places[vertices]
        shift = -int(np.abs(places - places.mean()).argmax())
        vertices, places = np.roll(vertices, shift), np.roll(places, shift)
        length = np.cumsum(np.abs(np.roll(places, -1) - places))
        return cls(vertices, places, np.append(0.0, length[:-1]) / length[-1])

    def distances(self, indices: IntArray, origin: IntArray) -> FloatArray:
        """Return distances along the border from one of its vertices to others, as fractions of its length."""
        way = np.abs(self.positions[indices] - self.positions[origin])
        return np.minimum(way, 1 - way)

    def surroundings(self, index: IntArray) -> IntArray:
        """Return the vertices near one of the border."""
        return self.vertices[self.distances(np.arange(len(self.vertices)), index) < MIN_SEPARATION / 3]


def _narrow_pairs(piece: Piece, border: _Border) -> tuple[IntArray, IntArray]:
    """Return (p,), (p,) pairs of samples of the border, by their distance relative to the area that they separate.

    Only pairs that separate enough area are among them.
    """
    places = border.places
    swept = np.append(0.0, np.cumsum((np.conj(places) * np.roll(places, -1)).imag))
    samples = np.searchsorted(border.positions, np.arange(SAMPLES) / SAMPLES, side="right") - 1
    samples = np.unique(samples)
    starts, ends = samples[np.stack(np.triu_indices(len(samples), 1))]
    # The area between the border from the start to the end and the chord between them.
    area = (swept[ends] - swept[starts] + (np.conj(places[ends]) * places[starts]).imag) / 2
    smaller = np.minimum(area, piece.outline.area - area)
    score = np.abs(places[ends] - places[starts]) / np.sqrt(np.maximum(smaller, piece.min_area))
    order = np.argsort(score, kind="stable")
    order = order[smaller[order] > piece.min_area]
    return starts[order], ends[order]


def _cut_between(piece: Piece, border: _Border, start: IntArray, end: IntArray) -> Cut | None:
    """Return the shortest cut between the surroundings of two vertices of the border, if it makes two pieces."""
    ends = border.surroundings(end)
    paths = piece.graph.shortest_paths(border.surroundings(start), ends)
    nearest = ends[np.argsort(paths.distance[ends], kind="stable")[:1]]
    path = np.append(paths.nodes_to(nearest), paths.source[nearest])
    inner, edges = path[1:-1], paths.edge[path[:-1]]
    if len(path) < 2 or path[-1] < 0 or piece.disk.is_boundary_vertex[inner].any():
        return None
    low, high = (int(np.flatnonzero(border.vertices == vertex)[0]) for vertex in (path[-1], path[0]))
    if low > high:
        low, high, inner = high, low, inner[::-1]
    loops = (
        np.concatenate([border.vertices[low : high + 1], inner]),
        np.concatenate([border.vertices[high:], border.vertices[: low + 1], inner[::-1]]),
    )
    first_sides, second_sides = (piece.places[np.column_stack([loop, np.roll(loop, -1)])] for loop in loops)
    area = min(swept_areas(sides).sum() for sides in (first_sides, second_sides))
    if area < piece.min_area:
        return None
    cost = float(piece.graph.costs[edges].sum())
    return Cut(piece, edges, cost, (first_sides, second_sides), float(area))
