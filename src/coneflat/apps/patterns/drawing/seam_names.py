"""What is written at the sides of seams."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from ....base import FloatArray
from ..finish import SEWN
from ..pieces.borders import Seam, Side
from ..pieces.polylines import ends_of_straight_parts


@dataclass(frozen=True, eq=False)
class SeamName:
    """The name of a part of a seam.

    Attributes:
        text: the name, the number of the piece on the other side, and the ease.
        piece: the piece at whose border it is written.
        line: (k, 2) the part of the border.
    """

    text: str
    piece: int
    line: FloatArray


def names_of(kind: str, seam: Seam, points: FloatArray, is_single: bool) -> Iterator[SeamName]:
    """Yield the names at both sides of a seam.

    Where a pattern is not sewn, each straight part of a seam has its name, such as A1, A2.

    Args:
        kind: the kind of the pattern.
        seam: the seam.
        points: (u, 2) the points of the pieces.
        is_single: whether there is only one piece, whose number is left out.
    """
    if kind in SEWN:
        for side, partner in (seam.sides, seam.sides[::-1]):
            text = _name_of_side(seam, side, "" if is_single else f" ({partner.piece + 1})")
            yield SeamName(text, side.piece, points[side.points])
        return
    first, second = (points[side.points] for side in seam.sides)
    for name, begin, end in straight_parts(seam, points):
        back = slice(len(second) - 1 - end, len(second) - begin)
        for side, partner, line in (
            (*seam.sides, first[begin : end + 1]),
            (*seam.sides[::-1], second[back]),
        ):
            yield SeamName(name if is_single else f"{name} ({partner.piece + 1})", side.piece, line)


def straight_parts(seam: Seam, points: FloatArray) -> Iterator[tuple[str, int, int]]:
    """Yield the name of each straight part of a seam, and where on its first side it begins and ends.

    Args:
        seam: the seam.
        points: (u, 2) the points of the pieces.
    """
    first, second = (points[side.points] for side in seam.sides)
    ends = ends_of_straight_parts(first, second[::-1])
    for i, (begin, end) in enumerate(pairwise(ends.tolist())):
        yield f"{seam.name}{i + 1}" if len(ends) > 2 else seam.name, begin, end


def _name_of_side(seam: Seam, side: Side, partner: str) -> str:
    if seam.is_dart:
        return f"dart {seam.name}"
    length, length_there = seam.lengths if side is seam.sides[0] else seam.lengths[::-1]
    ease = f", ease {length - length_there:.1f} mm" if seam.is_eased and length > length_there else ""
    return f"{seam.name}{partner}{ease}"
