"""What is written at the sides of seams."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...base import FloatArray, IntArray
from .borders import Seam, Side
from .finish import SEWN

# Turn of a side at a point, radians, from which on it is a corner between two straight parts.
CORNER = np.radians(2)


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
    ends = _ends_of_parts(first, second[::-1])
    for i, (begin, end) in enumerate(pairwise(ends.tolist())):
        name = f"{seam.name}{i + 1}" if len(ends) > 2 else seam.name
        back = slice(len(second) - 1 - end, len(second) - begin)
        for side, partner, line in (
            (*seam.sides, first[begin : end + 1]),
            (*seam.sides[::-1], second[back]),
        ):
            yield SeamName(name if is_single else f"{name} ({partner.piece + 1})", side.piece, line)


def _name_of_side(seam: Seam, side: Side, partner: str) -> str:
    if seam.is_dart:
        return f"dart {seam.name}"
    length, length_there = seam.lengths if side is seam.sides[0] else seam.lengths[::-1]
    ease = f", ease {length - length_there:.1f} mm" if seam.is_eased and length > length_there else ""
    return f"{seam.name}{partner}{ease}"


def _ends_of_parts(first: FloatArray, second: FloatArray) -> IntArray:
    """Return the points at which straight parts of a seam begin and end; its sides run in the same direction."""
    is_corner = (_turns(first) > CORNER) | (_turns(second) > CORNER)
    return np.concatenate([[0], np.flatnonzero(is_corner) + 1, [len(first) - 1]])


def _turns(line: FloatArray) -> FloatArray:
    """Return (k - 2,) the angles by which a polyline turns at its inner points."""
    steps = np.diff(line, axis=0)
    before, after = steps[:-1], steps[1:]
    across = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.abs(np.arctan2(across, (before * after).sum(axis=1)))
