"""Allowances without room: in gaps that are narrower than the two beside them, such as slots, and at short seams."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ....base import FloatArray, IntArray, list_some, plural
from ....mesh import NEXT, PREVIOUS
from ..finish import HEM, Finish
from ..pieces.borders import Borders, Seam
from ..pieces.cut_surface import CutSurface
from .allowances import shapely
from .shapes import allowance_of_halfedges

# Length of a side that lacks allowance, relative to its width, up to which it is a corner, where allowances meet.
CORNER = 3.0
# Distance of the places along a border at which it is measured, relative to the allowance.
STEP = 0.5
# Distance from the border at which the measurement of a gap begins, and by which gaps may be narrower, mm.
ROUNDING = 1e-3


@dataclass(frozen=True, eq=False)
class _Places:
    """Places along the border of a piece.

    Attributes:
        halfedges: (k,) the half-edge of each place.
        places: (k, 2) the places.
        outward: (k, 2) unit vectors out of the piece.
        lengths: (k,) the length of the border around each place.
    """

    halfedges: IntArray
    places: FloatArray
    outward: FloatArray
    lengths: FloatArray

    @classmethod
    def along(cls, surface: CutSurface, halfedges: IntArray, width: FloatArray) -> _Places:
        """Return places along half-edges with an allowance; width: (3m,) that of each half-edge."""
        halfedges = halfedges[width[halfedges] > 0]
        tail, head = _ends(surface, halfedges)
        length = np.linalg.norm(head - tail, axis=1)
        count = np.ceil(length / (STEP * width[halfedges])).astype(np.int64)
        edge = np.repeat(np.arange(len(halfedges)), count)
        place = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
        share = ((place + 0.5) / count[edge])[:, None]
        along = (head - tail)[edge] / length[edge, None]
        outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
        return cls(
            halfedges[edge],
            tail[edge] * (1 - share) + head[edge] * share,
            outward,
            length[edge] / count[edge],
        )


def notes_on_gaps(surface: CutSurface, borders: Borders, finish: Finish) -> Iterator[str]:
    """Yield a sentence if gaps of pieces are narrower than the two allowances beside them.

    They are not cut out. Darts are excepted, whose wedges are not cut out either.

    Args:
        surface: the pieces.
        borders: their borders.
        finish: the widths of the allowances.
    """
    width = allowance_of_halfedges(len(surface.corners), borders, finish)
    gap, length = np.full(len(width), np.inf), np.zeros(len(width))
    for loops in borders.loops:
        _measure_gaps(surface, np.concatenate(loops), width, gap, length)
    names, gaps, lengths = [], [], []
    for name, halfedges in _sides(borders):
        if length[halfedges].sum() > CORNER * width[halfedges].max():
            names.append(name)
            gaps.append(gap[halfedges].min())
            lengths.append(length[halfedges].sum())
    if names:
        yield (
            f"less allowance than requested at {list_some(dict.fromkeys(names))}, along {sum(lengths):.0f} mm: gaps "
            f"down to {min(gaps):.1f} mm between parts of a piece are filled by the allowances of both sides; make the "
            f"allowance narrower there"
        )


def short_seams(seams: Sequence[Seam], finish: Finish) -> list[Seam]:
    """Return the seams that are shorter than their allowance is wide."""
    return [seam for seam in seams if min(seam.lengths) < finish.width(seam.name)]


def notes_on_short_seams(seams: Sequence[Seam], finish: Finish) -> Iterator[str]:
    """Yield a sentence if seams are shorter than their allowance is wide, as they are hard to sew.

    Args:
        seams: the seams.
        finish: the widths of the allowances.
    """
    short = [finish.width(seam.name) for seam in short_seams(seams, finish)]
    if not short:
        return
    allowance = (
        f"is shorter than its allowance of {short[0]:g} mm"
        if len(short) == 1
        else f"are shorter than their allowance of {short[0]:g} mm"
        if min(short) == max(short)
        else f"are shorter than their allowances of up to {max(short):g} mm"
    )
    yield (
        f"{plural(len(short), 'seam')} of {len(seams):,} {allowance}: more strain, a larger model or a smoother mesh "
        "needs fewer."
    )


def _sides(borders: Borders) -> Iterator[tuple[str, IntArray]]:
    """Yield the name and the half-edges of each side that is not the side of a dart."""
    for seam in borders.seams:
        if not seam.is_dart:
            yield from (
                (f"seam {seam.name} of piece {side.piece + 1}", side.halfedges) for side in seam.sides
            )
    for hem in borders.hems:
        yield f"{HEM} of piece {hem.piece + 1}", hem.halfedges


def _ends(surface: CutSurface, halfedges: IntArray) -> tuple[FloatArray, FloatArray]:
    triangle, corner = np.divmod(halfedges, 3)
    return tuple(surface.points[surface.corners[triangle, step[corner]]] for step in (NEXT, PREVIOUS))


def _measure_gaps(
    surface: CutSurface, border: IntArray, width: FloatArray, gap: FloatArray, length: FloatArray
) -> None:
    """Write the narrowest gap beside each half-edge of a piece, and the length along which allowances fill it.

    A gap is filled where a line out of the piece meets it again within both allowances.
    """
    places = _Places.along(surface, border, width)
    if not len(places.places):
        return
    reach = width[places.halfedges] + width[border].max()
    starts = places.places + ROUNDING * places.outward
    tail, head = _ends(surface, border)
    tree = shapely().STRtree(shapely().linestrings(np.stack([tail, head], axis=1)))
    rays = shapely().linestrings(np.stack([starts, places.places + reach[:, None] * places.outward], axis=1))
    ray, edge = tree.query(rays, predicate="intersects")
    along, outward = (head - tail)[edge], places.outward[ray]
    to_edge = tail[edge] - places.places[ray]
    turn = outward[:, 0] * along[:, 1] - outward[:, 1] * along[:, 0]
    distance = (to_edge[:, 0] * along[:, 1] - to_edge[:, 1] * along[:, 0]) / np.where(turn == 0, np.inf, turn)
    needed = width[places.halfedges[ray]] + width[border[edge]]
    is_filled = (turn != 0) & (distance < needed - ROUNDING)
    np.minimum.at(gap, places.halfedges[ray[is_filled]], distance[is_filled])
    filled = np.unique(ray[is_filled])
    np.add.at(length, places.halfedges[filled], places.lengths[filled])
