"""Borders of pieces, divided into the sides of seams, and sides that are sewn to nothing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .... import TriangleMesh
from ....base import IntArray
from .cut_surface import CutSurface
from .numbering import DIRECTION, letters, order_by_size
from .polylines import distances

#: Difference of the lengths of the sides of a seam that can be neglected, mm.
NEGLIGIBLE = 0.01


@dataclass(frozen=True, eq=False)
class Side:
    """A part of the border of a piece: k half-edges, counterclockwise around the piece.

    Attributes:
        piece: the piece.
        points: (k + 1,) its points. The first and the last are the same one if it is a whole border.
        halfedges: (k,) its half-edges, 3 times the triangle plus the corner opposite, as in the mesh.
    """

    piece: int
    points: IntArray
    halfedges: IntArray


@dataclass(frozen=True, eq=False)
class Seam:
    """Two sides that are sewn together.

    Attributes:
        name: A, B, ..., Z, AA, ...
        sides: the two sides; edge i of the first is sewn to the edge i from the end of the second.
        lengths: the lengths of both sides in the plane, mm.
        surface_length: their length on the surface, mm.
        largest_gap: largest difference of the distances of matching points along both sides, mm.
    """

    name: str
    sides: tuple[Side, Side]
    lengths: tuple[float, float]
    surface_length: float
    largest_gap: float

    @property
    def ease(self) -> float:
        """The difference of the lengths of the sides, mm."""
        return abs(self.lengths[0] - self.lengths[1])

    @property
    def is_eased(self) -> bool:
        """Whether the sides differ in length by more than can be neglected."""
        return self.ease > NEGLIGIBLE

    @property
    def is_dart(self) -> bool:
        """Whether the sides meet at one end, the tip of a dart."""
        return self.tip is not None

    @cached_property
    def tip(self) -> int | None:
        """The point at the tip of a dart; None if the seam is no dart.

        Sides that meet at both ends close a piece like a ball, or leave a slit inside of it.
        """
        first, second = self.sides
        tips = [int(first.points[end]) for end in (-1, 0) if first.points[end] == second.points[-1 - end]]
        return tips[0] if len(tips) == 1 else None


@dataclass(frozen=True, eq=False)
class Borders:
    """The borders of all pieces.

    Attributes:
        loops: of each piece, the half-edges of its borders, the outer one first.
        seams: the seams, by name.
        hems: the sides that are sewn to nothing.
    """

    loops: tuple[tuple[IntArray, ...], ...]
    seams: tuple[Seam, ...]
    hems: tuple[Side, ...]


def find_borders(surface: CutSurface) -> Borders:
    """Return the borders of the pieces of a cut surface."""
    pieces = TriangleMesh(np.zeros((len(surface.points), 3)), surface.corners)
    walks = pieces.boundary_walks()
    of_piece: list[list[IntArray]] = [[] for _ in range(int(surface.pieces.max()) + 1)]
    for walk in walks:
        of_piece[int(surface.pieces[walk[0] // 3])].append(walk)
    loops = tuple(tuple(_ordered(pieces, surface, walks)) for walks in of_piece)
    twins = _twins(surface.mesh)
    following = np.full(3 * len(surface.corners), -1)
    for walk in walks:
        following[walk] = np.roll(walk, -1)
    sides = [
        [
            [*_sides(pieces, surface, _started(surface.mesh, walk, twins, following), twins, following)]
            for walk in walks_of_piece
        ]
        for walks_of_piece in loops
    ]
    return Borders(loops, tuple(_seams(surface, sides, twins)), tuple(_hems(sides, twins)))


def _ordered(pieces: TriangleMesh, surface: CutSurface, walks: Sequence[IntArray]) -> Iterator[IntArray]:
    """Yield the borders of a piece: the outer one, then holes, the largest first."""
    areas = np.array([_area(pieces, surface, walk) for walk in walks])
    vertices = surface.mesh.vertices
    centres = np.array([vertices[surface.mesh.tails[walk]].mean(axis=0) for walk in walks])
    # The area inside a hole is negative.
    holes = np.flatnonzero(areas <= 0)
    for i in (*np.flatnonzero(areas > 0), *holes[order_by_size(-areas[holes], centres[holes])]):
        yield walks[i]


def _twins(mesh: TriangleMesh) -> IntArray:
    """Return (3m,) the half-edge on the other side of each half-edge, -1 on the border of the mesh."""
    twins = np.full(3 * len(mesh.faces), -1)
    first, second = mesh.edge_halfedges[~mesh.is_boundary_edge].T
    twins[first], twins[second] = second, first
    return twins


def _area(pieces: TriangleMesh, surface: CutSurface, walk: IntArray) -> float:
    """Return the area inside a border, negative around holes."""
    x, y = surface.points[pieces.tails[walk]].T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def _breaks(walk: IntArray, twins: IntArray, following: IntArray) -> IntArray:
    """Return the positions in a border at which a side begins."""
    before, after = twins[np.roll(walk, 1)], twins[walk]
    is_hem = (before < 0) & (after < 0)
    goes_on = (before >= 0) & (after >= 0) & (following[after] == before) & (before != walk)
    return np.flatnonzero(~(is_hem | goes_on))


def _started(mesh: TriangleMesh, walk: IntArray, twins: IntArray, following: IntArray) -> IntArray:
    """Return a border that starts where a side begins.

    A border without such a place starts at the vertex that is last by position, as does its partner.
    """
    breaks = _breaks(walk, twins, following)
    if len(breaks):
        return np.roll(walk, -breaks[0])
    return np.roll(walk, -int((mesh.vertices[mesh.tails[walk]] @ DIRECTION).argmax()))


def _sides(
    pieces: TriangleMesh, surface: CutSurface, walk: IntArray, twins: IntArray, following: IntArray
) -> Iterator[Side]:
    starts = _breaks(walk, twins, following)
    for part in np.split(walk, starts[starts > 0]):
        points = np.append(pieces.tails[part], pieces.heads[part[-1]])
        yield Side(int(surface.pieces[part[0] // 3]), points, part)


def _seams(surface: CutSurface, sides: Sequence[Sequence[Sequence[Side]]], twins: IntArray) -> Iterator[Seam]:
    """Yield the seams in the order of their names.

    Args:
        surface: the surface.
        sides: of each piece and each of its borders, the sides.
        twins: (3m,) the half-edge on the other side of each half-edge.
    """
    borders = [border for borders_of_piece in sides for border in borders_of_piece]
    by_first = {int(side.halfedges[0]): side for border in borders for side in border}
    partners = {
        start: by_first[last]
        for start, side in by_first.items()
        if (last := int(twins[side.halfedges[-1]])) in by_first
    }
    numbers: dict[int, int] = {}
    for side in _along_borders(surface, borders, partners, numbers):
        start, partner = int(side.halfedges[0]), partners.get(int(side.halfedges[0]))
        if partner is None or partner is side or start in numbers:
            continue
        number = len(numbers) // 2
        numbers[start] = numbers[int(partner.halfedges[0])] = number
        yield _seam(surface, letters(number), side, partner)


def _along_borders(
    surface: CutSurface,
    borders: Sequence[Sequence[Side]],
    partners: Mapping[int, Side],
    numbers: Mapping[int, int],
) -> Iterator[Side]:
    """Yield all sides in the order in which their seams are numbered.

    Where pieces have an order, sides at the following piece come first. Each border begins after the side with the
    smallest number that is followed by one without a number, or at its longest side.

    Args:
        surface: the surface.
        borders: the sides of all borders.
        partners: the other side of the seam of each side, by the first half-edge of the side.
        numbers: the number of each side by its first half-edge; sides get their numbers when they are yielded.
    """
    if surface.sequence is not None:
        count = int(surface.pieces.max()) + 1
        for side in (side for border in borders for side in border):
            partner = partners.get(int(side.halfedges[0]))
            if partner is not None and partner.piece == (side.piece + 1) % count:
                yield side
    for border in borders:
        starts = [int(side.halfedges[0]) for side in border]
        after = [
            (numbers[starts[i - 1]], i)
            for i, start in enumerate(starts)
            if start not in numbers and starts[i - 1] in numbers
        ]
        first = min(after)[1] if after else _longest(surface, border)
        yield from (*border[first:], *border[:first])


def _longest(surface: CutSurface, border: Sequence[Side]) -> int:
    """Return the index of the longest side of a border on the surface."""
    mesh = surface.mesh
    lengths = [surface.edge_lengths[mesh.halfedge_edges[side.halfedges]].sum() for side in border]
    centres = [mesh.vertices[mesh.tails[side.halfedges]].mean(axis=0) for side in border]
    return int(order_by_size(np.array(lengths), np.array(centres))[0])


def _hems(sides: Sequence[Sequence[Sequence[Side]]], twins: IntArray) -> Iterator[Side]:
    return (
        side for borders in sides for border in borders for side in border if twins[side.halfedges[0]] < 0
    )


def _seam(surface: CutSurface, name: str, first: Side, second: Side) -> Seam:
    along = [distances(surface.points[side.points]) for side in (first, second)]
    matching = along[1][-1] - along[1][::-1]
    on_surface = surface.edge_lengths[surface.mesh.halfedge_edges[first.halfedges]].sum()
    gap = float(np.abs(along[0] - matching).max())
    return Seam(name, (first, second), (float(along[0][-1]), float(along[1][-1])), float(on_surface), gap)
