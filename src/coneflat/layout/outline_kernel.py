"""The pieces into which the given edges cut flat triangles, compiled."""

from __future__ import annotations

from .._arrays import IntArray
from ..geometry.compiled import compiled
from .overlay_kernel import corner_counts


@compiled
def outline_pieces(
    counts: IntArray, cut: IntArray, start: IntArray, outline: IntArray, size: IntArray
) -> None:
    """Fill the outlines of all pieces of some triangles, counterclockwise.

    Args:
        counts: crossings on each half-edge, see `overlay.Overlay`.
        cut: (k,) triangles with crossings on their sides.
        start: (k,) the first piece of each; it has one more than given edges run across it.
        outline: (p, 6, 3) filled; for each corner of a piece the half-edge that it lies on and its place among
            the crossings on it, or -1 and the corner of the triangle that it is; and the half-edge that the
            side after it lies on, -1 if this side is a given edge.
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
