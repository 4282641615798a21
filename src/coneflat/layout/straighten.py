"""The shapes of the input's own triangles in a flat metric that lives on flipped edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import BoolArray, ComplexArray, IntArray
from ..geometry.intrinsic import IntrinsicTriangulation


@dataclass(frozen=True, eq=False)
class FlatTriangles:
    """Triangles in the plane, each in a frame of its own.

    Attributes:
        sides: (3m,) each half-edge as a vector in the frame of its triangle, a complex number.
        turns: (3m,) unit numbers: a vector in the frame of a half-edge's twin, times this, is the vector in
            the frame of its own triangle. 1 on the boundary.
        twin: (3m,) the half-edge on the other side, -1 on the boundary.
    """

    sides: ComplexArray
    turns: ComplexArray
    twin: IntArray

    @property
    def is_inverted(self) -> BoolArray:
        """(m,) True for triangles that are turned over or have no area."""
        sides = self.sides.reshape(-1, 3)
        inverted: BoolArray = (np.conj(sides[:, 0]) * sides[:, 1]).imag <= 0
        return inverted


def straight_triangles(
    triangulation: IntrinsicTriangulation, flips: IntArray, face_count: int | None = None
) -> FlatTriangles:
    """Return the input's triangles with straight sides in a flat metric.

    An edge of the input is a geodesic of the input's metric; in the flat metric the straight segment in its
    place is found by undoing the flips, the last one first, each by unfolding two triangles into the plane.
    Where a quad is not convex this turns a triangle over: the signs of the areas tell.

    Args:
        triangulation: flat triangles with their lengths; left as it is.
        flips: half-edges flipped between the input's triangles and these, in order.
        face_count: how many triangles, the first ones, are the input's; None: all. The others are the mirror
            image of a doubled surface, and edges towards them are the boundary.
    """
    from .undo_kernel import find_turns, place_triangles, undo_flips

    twin, tail = triangulation.twin.copy(), triangulation.tail.copy()
    sides = np.empty(len(twin), dtype=np.complex128)
    turns = np.empty(len(twin), dtype=np.complex128)
    place_triangles(triangulation.length, sides)
    find_turns(twin, sides, turns)
    undo_flips(twin, tail, sides, turns, np.asarray(flips, dtype=np.int64))
    if face_count is not None and 3 * face_count < len(twin):
        count = 3 * face_count
        twin, sides, turns = twin[:count].copy(), sides[:count].copy(), turns[:count].copy()
        outside = twin >= count
        twin[outside] = -1
        turns[outside] = 1.0
    return FlatTriangles(sides, turns, twin)
