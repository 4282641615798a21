"""The triangles of the common subdivision of two triangulations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from .._arrays import ComplexArray, FloatArray, IntArray
from ..compiled import compiled
from ..geometry.intrinsic import IntrinsicTriangulation
from ..mesh import NEXT, PREVIOUS
from .overlay import Overlay, corner_counts

# A piece is what two triangles have in common.
MOST_CORNERS = 6


@dataclass(frozen=True, eq=False)
class Pieces:
    """r triangles, each in an input triangle and in a flat one.

    Attributes:
        origin: (r,) the input triangle.
        corners: (r, 3) vertices; n + x stands for crossing x.
        sides: (r, 3) sides as vectors in the frame of the flat triangle.
        on_flat: (r, 3) the flat half-edge that each side lies on, -1 for none.
        on_input: (r, 3) the input half-edge that each side lies on, -1 for none.
    """

    origin: IntArray
    corners: IntArray
    sides: ComplexArray
    on_flat: IntArray
    on_input: IntArray


def find_pieces(
    source: IntrinsicTriangulation,
    flat: IntrinsicTriangulation,
    sides: ComplexArray,
    crossings: Overlay,
    positions: FloatArray,
) -> Pieces:
    """Return the triangles of the common subdivision, in the order of the input triangles.

    Args:
        source, flat: the triangulations.
        sides: (3m,) sides of the flat triangles as vectors, each in the frame of its triangle.
        crossings: where their edges cross.
        positions: (n + x, 3) vertices and crossings on the input triangles.
    """
    is_cut = (crossings.counts > 0).reshape(-1, 3).any(axis=1)
    whole = np.flatnonzero(np.repeat(~is_cut, 3))
    on_flat = np.full(len(flat.twin), -1, dtype=np.int64)
    on_flat[crossings.first[whole]] = whole
    uncut = np.flatnonzero(on_flat[::3] >= 0)
    on_flat = on_flat.reshape(-1, 3)[uncut]
    on_input = 3 * uncut[:, None] + np.arange(3)
    parts = [Pieces(uncut, source.faces[uncut], sides[on_flat], on_flat, on_input)]

    outline, size, triangle = _outlines(crossings.counts, np.flatnonzero(is_cut))
    for corners in range(3, MOST_CORNERS + 1):
        chosen = size == corners
        polygons = _Polygons(source, flat, sides, crossings, triangle[chosen], outline[chosen, :corners])
        parts.append(polygons.triangulate(positions))
    order = np.argsort(np.concatenate([part.origin for part in parts]), kind="stable")
    names = ("origin", "corners", "sides", "on_flat", "on_input")
    return Pieces(*(np.concatenate([getattr(part, name) for part in parts])[order] for name in names))


def _outlines(counts: IntArray, cut: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return the outlines of the pieces of triangles, see `outline_pieces`, and the triangle of each piece."""
    ends = np.maximum(counts, 0).reshape(-1, 3)[cut]
    # Edges that start from a corner end once on a side, the others twice.
    starting = np.maximum(2 * ends.max(axis=1, initial=0) - ends.sum(axis=1), 0)
    number = 1 + (ends.sum(axis=1) + starting) // 2
    outline = np.full((number.sum(), MOST_CORNERS, 3), -1, dtype=np.int64)
    size = np.zeros(len(outline), dtype=np.int64)
    outline_pieces(counts, cut, np.cumsum(number) - number, outline, size)
    return outline, size, np.repeat(cut, number)


class _Polygons:
    """Pieces with the same number k of corners.

    Attributes:
        vertex: (p, k) vertex at each corner.
        point: (p, k, 3) barycentric coordinates of the corners in the flat triangle.
        on_flat, on_input: (p, k) half-edges that the side after each corner lies on, -1 for none.
        shape: (p, 3) sides of the flat triangle.
    """

    def __init__(
        self,
        source: IntrinsicTriangulation,
        flat: IntrinsicTriangulation,
        sides: ComplexArray,
        crossings: Overlay,
        triangle: IntArray,
        outline: IntArray,
    ) -> None:
        slot, place, side = np.moveaxis(outline, 2, 0)
        self.shape = sides.reshape(-1, 3)[triangle]
        self.on_flat = side
        self.vertex = np.empty_like(slot)
        self.point = np.zeros((*slot.shape, 3))
        is_crossing = slot >= 0

        piece, corner = np.nonzero(~is_crossing)
        which = place[piece, corner]
        self.vertex[piece, corner] = flat.faces[triangle[piece], which]
        self.point[piece, corner, which] = 1.0

        piece, corner = np.nonzero(is_crossing)
        halfedge, which = slot[piece, corner], place[piece, corner]
        backwards = halfedge > flat.twin[halfedge]
        which = np.where(backwards, crossings.counts[halfedge] - 1 - which, which)
        x = crossings.number[crossings.offset[halfedge] + which]
        is_own = crossings.crossed[x] == halfedge
        self.vertex[piece, corner] = flat.vertex_count + x
        one, two = crossings.on_crossed[x].T
        self.point[piece, corner, NEXT[halfedge % 3]] = np.where(is_own, one, two)
        self.point[piece, corner, PREVIOUS[halfedge % 3]] = np.where(is_own, two, one)

        # The input half-edge through each crossing, out of the triangle. The side before the crossing, if it is
        # on an input edge, runs along it, the side after against it.
        leaving = np.full(slot.shape, -1, dtype=np.int64)
        through = crossings.leaving[x]
        leaving[piece, corner] = np.where(is_own, through, source.twin[through])
        entering = np.where(is_crossing, source.twin[leaving], np.roll(leaving, -1, axis=1))
        shared = np.where(crossings.counts[side] < 0, crossings.first[side], -1)
        self.on_input = np.where(side < 0, entering, shared)

    def triangulate(self, positions: FloatArray) -> Pieces:
        """Return triangles.

        The corners of a piece are in general position, in the plane as in the input triangle, because a line
        has one side of it at most. Of its triangulations the one is taken whose flattest triangle is least flat.
        """
        count = self.vertex.shape[1]
        choices = triangulations(count)
        triples, members = np.unique(choices.reshape(-1, 3), axis=0, return_inverse=True)
        quality = np.stack([self._heights(triple, positions) for triple in triples], axis=1)
        worst = quality[:, members.reshape(choices.shape[:2])].min(axis=2)
        chosen = choices[worst.argmax(axis=1)]
        triangle = chosen.reshape(-1, 3)
        piece = np.repeat(np.arange(len(chosen)), count - 2)
        sides = np.empty(triangle.shape, dtype=np.complex128)
        on_flat, on_input = np.full((2, *triangle.shape), -1, dtype=np.int64)
        for i in range(3):
            start, end = triangle[:, NEXT[i]], triangle[:, PREVIOUS[i]]
            sides[:, i] = _vectors(self.shape[piece], self.point[piece, start], self.point[piece, end])
            is_side = end == (start + 1) % count
            on_flat[is_side, i] = self.on_flat[piece, start][is_side]
            on_input[is_side, i] = self.on_input[piece, start][is_side]
        origin = self.on_input.max(axis=1, initial=0) // 3
        return Pieces(origin[piece], self.vertex[piece[:, None], triangle], sides, on_flat, on_input)

    def _heights(self, triple: IntArray, positions: FloatArray) -> FloatArray:
        """Return (p,) height over longest side of the triangle of three corners, the least in plane and space."""
        one, two, three = np.moveaxis(self.point[:, triple], 1, 0)
        a, b = _vectors(self.shape, one, two), _vectors(self.shape, one, three)
        longest = np.max([np.abs(a), np.abs(b), np.abs(b - a)], axis=0)
        # Where all corners are one point, there is no height.
        plane = (np.conj(a) * b).imag / np.maximum(longest**2, np.finfo(float).tiny)
        one, two, three = np.moveaxis(positions[self.vertex[:, triple]], 1, 0)
        u, v = two - one, three - one
        longest = np.max([(w * w).sum(axis=1) for w in (u, v, v - u)], axis=0)
        space = np.linalg.norm(np.cross(u, v), axis=1) / np.maximum(longest, np.finfo(float).tiny)
        least: FloatArray = np.minimum(plane, space)
        return least


@cache
def triangulations(count: int) -> IntArray:
    """Return (t, count - 2, 3) all triangulations of a polygon by its corners."""

    def split(first: int, last: int) -> list[list[tuple[int, int, int]]]:
        if last == first + 1:
            return [[]]
        return [
            [(first, apex, last), *before, *after]
            for apex in range(first + 1, last)
            for before in split(first, apex)
            for after in split(apex, last)
        ]

    return np.array(split(0, count - 1), dtype=np.int64)


def _vectors(shape: ComplexArray, start: FloatArray, end: FloatArray) -> ComplexArray:
    """Return (p,) vectors between points of triangles.

    Args:
        shape: (p, 3) sides of the triangles.
        start, end: (p, 3) barycentric coordinates. The largest is left out: near a corner the others are small
            and good to all digits.
    """
    row = np.arange(len(shape))
    origin = (start + end).argmax(axis=1)
    one, two = NEXT[origin], PREVIOUS[origin]
    shift = end - start
    vectors: ComplexArray = shift[row, one] * shape[row, two] - shift[row, two] * shape[row, one]
    return vectors


@compiled
def outline_pieces(
    counts: IntArray, cut: IntArray, start: IntArray, outline: IntArray, size: IntArray
) -> None:
    """Fill the outlines of all pieces of some triangles, counterclockwise.

    Args:
        counts: crossings on each half-edge, see `overlay.Overlay`.
        cut: (k,) triangles with crossings on their sides.
        start: (k,) the first piece of each; it has one more than input edges run across it.
        outline: (p, 6, 3) filled; for each corner of a piece the half-edge that it lies on and its place among
            the crossings on it, or -1 and the corner of the triangle that it is; and the half-edge that the
            side after it lies on, -1 if this side is an input edge.
        size: (p,) the corners so far, 0.
    """
    for k in range(len(cut)):
        base, piece = 3 * cut[k], start[k]
        for i in range(3):
            pieces, _ = corner_counts(counts, base, i)
            out, into = base + (i + 2) % 3, base + (i + 1) % 3  # the sides from and to corner i
            for c in range(pieces):
                if c == 0:
                    _add(outline, size, piece, -1, i, out)
                else:
                    _add(outline, size, piece, out, c - 1, out)
                _add(outline, size, piece, out, c, -1)
                _add(outline, size, piece, into, counts[into] - 1 - c, into)
                if c > 0:
                    _add(outline, size, piece, into, counts[into] - c, -1)
                piece += 1
        _outline_core(counts, base, outline, size, piece)


@compiled
def _outline_core(counts: IntArray, base: int, outline: IntArray, size: IntArray, piece: int) -> None:
    """Outline what is left of a triangle when its corners are cut off: one piece, or a fan around a corner."""
    apex, starting = 0, 0
    for i in range(3):
        _, fan = corner_counts(counts, base, i)
        if fan > 0:
            apex, starting = i, fan
    before, _ = corner_counts(counts, base, (apex + 1) % 3)
    _add_corner(counts, base, apex, outline, size, piece)
    _add_corner(counts, base, (apex + 1) % 3, outline, size, piece)
    for c in range(before, before + starting):
        _add(outline, size, piece, base + apex, c, -1)
        piece += 1
        _add(outline, size, piece, -1, apex, -1)
        _add(outline, size, piece, base + apex, c, base + apex)
    _add_corner(counts, base, (apex + 2) % 3, outline, size, piece)


@compiled
def _add_corner(counts: IntArray, base: int, i: int, outline: IntArray, size: IntArray, piece: int) -> None:
    """Add corner i of a triangle, or the ends of the last edge that cuts it off."""
    pieces, _ = corner_counts(counts, base, i)
    out, into = base + (i + 2) % 3, base + (i + 1) % 3
    if pieces == 0:
        _add(outline, size, piece, -1, i, out)
    else:
        _add(outline, size, piece, into, counts[into] - pieces, -1)
        _add(outline, size, piece, out, pieces - 1, out)


@compiled
def _add(outline: IntArray, size: IntArray, piece: int, slot: int, place: int, side: int) -> None:
    corner = outline[piece, size[piece]]
    corner[0] = slot
    corner[1] = place
    corner[2] = side
    size[piece] += 1
