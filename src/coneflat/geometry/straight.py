"""The shapes of the triangles of the input in a flat metric that is given on a flipped triangulation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from ..base.jit import compiled
from ..mesh.connectivity import TriangleMesh
from .intrinsic import IntrinsicTriangulation, check_lengths, intrinsic_triangulation


@dataclass(frozen=True, eq=False)
class FlatTriangles:
    """Triangles in the plane, each in its own frame.

    Attributes:
        sides: (3m,) each half-edge as a vector in the frame of its triangle, a complex number.
        turns: (3m,) complex numbers of modulus 1. A vector in the frame of the twin of a half-edge, multiplied by
            this number, is the vector in the frame of the triangle of the half-edge. 1 on the boundary.
        twin: (3m,) the half-edge on the other side, -1 on the boundary.
    """

    sides: ComplexArray
    turns: ComplexArray
    twin: IntArray

    @cached_property
    def is_inverted(self) -> BoolArray:
        """(m,) True for triangles that are flipped or have no area."""
        sides = self.sides.reshape(-1, 3)
        return (np.conj(sides[:, 0]) * sides[:, 1]).imag <= 0

    def first(self, face_count: int) -> FlatTriangles:
        """Return the first triangles; edges shared with the others are on the boundary."""
        count = 3 * face_count
        twin, turns = self.twin[:count].copy(), self.turns[:count].copy()
        outside = twin >= count
        twin[outside], turns[outside] = -1, 1.0
        return FlatTriangles(self.sides[:count].copy(), turns, twin)


def flat_triangles(mesh: TriangleMesh, lengths: ArrayLike) -> FlatTriangles:
    """Return the triangles of a mesh in the plane, with given side lengths: a flat metric on the mesh itself.

    Args:
        mesh: the mesh, such as `check_mesh(vertices, faces).mesh`.
        lengths: (m, 3) side lengths, column i opposite corner i, in any unit.

    Raises:
        ArrayShapeError, NonFiniteError: the lengths do not fit the mesh, or are not finite.
        LengthError: a triangle has no area, or the two sides of an edge have different lengths.
    """
    triangulation = intrinsic_triangulation(mesh, check_lengths(mesh, lengths))
    return straight_triangles(triangulation, np.empty(0, dtype=np.int64))


def straight_triangles(
    triangulation: IntrinsicTriangulation, flips: IntArray, face_count: int | None = None
) -> FlatTriangles:
    """Return the triangles of the input with straight sides in a flat metric.

    An edge of the input is a geodesic of the metric of the input. The straight segment that replaces it in the flat
    metric is found by undoing the flips in reverse order, each by unfolding two triangles into the plane. If their
    quad is not convex, a triangle is flipped, which the sign of its area shows.

    Args:
        triangulation: flat triangles with their lengths; not modified.
        flips: half-edges flipped between the triangles of the input and these, in order.
        face_count: number of triangles of the input, which come first; None: all. The others are the mirror image of
            a doubled surface, and edges shared with them are on the boundary.
    """
    twin, tail = triangulation.twin.copy(), triangulation.tail.copy()
    sides = np.empty(len(twin), dtype=np.complex128)
    turns = np.empty(len(twin), dtype=np.complex128)
    place_triangles(triangulation.length, sides)
    undo_flips(twin, tail, sides, turns, np.asarray(flips, dtype=np.int64))
    triangles = FlatTriangles(sides, turns, twin)
    if face_count is None or 3 * face_count == len(twin):
        return triangles
    return triangles.first(face_count)


def rest_sides(lengths: FloatArray) -> ComplexArray:
    """Return (m, 3) the complex side vectors of triangles with given lengths (m, 3), positively oriented."""
    sides = np.empty(lengths.size, dtype=np.complex128)
    place_triangles(np.ascontiguousarray(lengths).ravel(), sides)
    return sides.reshape(-1, 3)


@compiled
def place_triangles(length: FloatArray, sides: ComplexArray) -> None:
    """Write the three sides of each triangle as vectors in its own frame, with the longest side along x."""
    for base in range(0, len(length), 3):
        i = 0
        for k in range(1, 3):
            if length[base + k] > length[base + i]:
                i = k
        h, h1, h2 = base + i, base + (i + 1) % 3, base + (i + 2) % 3
        a, b, c = length[h], length[h1], length[h2]
        slack_a = max(min(b, c) - (a - max(b, c)), 0.0)
        slack_b = min(c, a) - (b - max(c, a))
        slack_c = min(a, b) - (c - max(a, b))
        perimeter = a + b + c
        height = math.sqrt(perimeter * slack_a * slack_b * slack_c) / (2 * a)
        # b and c times the cosines at the longest side are computed from slacks, so that short sides are accurate.
        sides[h] = complex(a, 0.0)
        sides[h1] = complex(-(perimeter * slack_c - slack_a * slack_b) / (4 * a), height)
        sides[h2] = complex(-(perimeter * slack_b - slack_a * slack_c) / (4 * a), -height)


@compiled
def undo_flips(
    twin: IntArray, tail: IntArray, sides: ComplexArray, turns: ComplexArray, flips: IntArray
) -> None:
    """Write the rotations between frames, and undo flips in reverse order, each by unfolding its two triangles.

    The frames of the triangles are updated: vectors are added and rotated, but never divided by a side, which may have
    length zero in an intermediate step.
    """
    for h in range(len(twin)):
        t = twin[h]
        if t > h:
            turn = -sides[h] * sides[t].conjugate()
            size = abs(turn)
            turns[h] = complex(turn.real / size, turn.imag / size)
            turns[t] = turns[h].conjugate()
        elif t < 0:
            turns[h] = 1.0
    for k in range(len(flips) - 1, -1, -1):
        h = flips[k]
        t = twin[h]
        h1 = h - h % 3 + (h + 1) % 3
        h2 = h - h % 3 + (h + 2) % 3
        t1 = t - t % 3 + (t + 1) % 3
        t2 = t - t % 3 + (t + 2) % 3
        turn = turns[h]
        # The edge rotates clockwise: sides move h1 to h2, h2 to t1, t1 to t2, t2 to h1. The second of them changes
        # from the frame of h to that of t, the fourth from that of t to that of h.
        origins = (h1, h2, t1, t2)
        destinations = (h2, t1, t2, h1)
        into = (1.0 + 0.0j, turn.conjugate(), 1.0 + 0.0j, turn)
        moved = (sides[h1], sides[h2] * into[1], sides[t1], sides[t2] * into[3])
        twins = (twin[h1], twin[h2], twin[t1], twin[t2])
        outer = (turns[h1], turns[h2], turns[t1], turns[t2])
        p, u, q, v = tail[h1], tail[h2], tail[t1], tail[t2]
        for i in range(4):
            neighbour, total = twins[i], into[i] * outer[i]
            for j in range(4):
                if twins[i] == origins[j]:
                    neighbour = destinations[j]
                    total *= into[j].conjugate()
            total /= abs(total)
            sides[destinations[i]] = moved[i]
            twin[destinations[i]] = neighbour
            turns[destinations[i]] = total
            if neighbour >= 0:
                twin[neighbour] = destinations[i]
                turns[neighbour] = total.conjugate()
        sides[h] = -(sides[h1] + sides[h2])
        sides[t] = -sides[h] * turn.conjugate()
        tail[h], tail[h1], tail[h2] = u, v, p
        tail[t], tail[t1], tail[t2] = v, u, q
