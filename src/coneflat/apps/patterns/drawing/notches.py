"""Notches: marks at matching places on both sides of a seam, at which the sides are pinned together."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ....base import FloatArray, IntArray
from ..pieces.borders import Seam
from ..pieces.polylines import distances

# Shortest seam with a notch, distance of notches, mm, and their largest number along a seam.
MIN_SEAM, SPACING, MAX_NOTCHES = 25.0, 60.0, 12
# Place of the first notch between two divisions of a seam: if it is alone, the ends cannot be confused.
FIRST = 0.4
# Distance of the two lines of a double notch, and length of notches without an allowance, mm.
DOUBLE, INWARD = 3.0, 2.5


@dataclass(frozen=True, eq=False)
class Notch:
    """A mark across a seam line.

    Attributes:
        place: (2,) its place on the seam line, mm.
        outward: (2,) unit vector out of the piece.
        is_double: whether it has two lines: the first notch of a seam, so that its ends cannot be confused.
    """

    place: FloatArray
    outward: FloatArray
    is_double: bool

    def lines(self, width: float) -> Iterator[FloatArray]:
        """Yield its lines (2, 2), out of the piece as far as the allowance is wide, or else inward."""
        length = width if width > 0 else -INWARD
        along = np.array([-self.outward[1], self.outward[0]])
        for shift in (-DOUBLE / 2, DOUBLE / 2) if self.is_double else (0.0,):
            foot = self.place + shift * along
            yield np.stack([foot, foot + length * self.outward])


def notches_of(seam: Seam, points: FloatArray) -> tuple[list[Notch], list[Notch]]:
    """Return the notches of both sides of a seam, at matching distances from their matching ends.

    Where the sides differ in length, notches match at the same points of the surface. Darts, whose sides meet at
    their tip, have none.

    Args:
        seam: the seam.
        points: (u, 2) the points of the pieces.
    """
    length = min(seam.lengths)
    if seam.is_dart or length < MIN_SEAM:
        return [], []
    count = min(max(round(length / SPACING), 1), MAX_NOTCHES)
    first, second = (points[side.points] for side in seam.sides)
    along = distances(first)
    shares = (np.arange(count) + (FIRST if count == 1 else 0.5)) / count
    edge, part = _places(along, shares * along[-1])
    ours = [*_notches(first, edge, part)]
    theirs = [*_notches(second, len(second) - 2 - edge, 1 - part)]
    return ours, theirs


def _places(along: FloatArray, targets: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the edges in which targets lie, and how far along them, from 0 to 1."""
    edge = np.clip(np.searchsorted(along, targets, side="right") - 1, 0, len(along) - 2)
    return edge, (targets - along[edge]) / (along[edge + 1] - along[edge])


def _notches(line: FloatArray, edge: IntArray, part: FloatArray) -> Iterator[Notch]:
    for i, (e, share) in enumerate(zip(edge.tolist(), part.tolist(), strict=True)):
        tail, head = line[e], line[e + 1]
        along = (head - tail) / np.linalg.norm(head - tail)
        yield Notch(tail + share * (head - tail), np.array([along[1], -along[0]]), i == 0)
