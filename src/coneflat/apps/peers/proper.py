"""Edge flips after which no two edges have the same ends and vertices have triangles enough."""

from __future__ import annotations

import numpy as np

from ...base import BoolArray, FloatArray, IntArray
from ...geometry import IntrinsicTriangulation, corner_angles, euclidean_diagonal, relink
from ...mesh import NEXT, PREVIOUS


def make_proper(triangulation: IntrinsicTriangulation, wanted: IntArray) -> IntArray:
    """Flip edges, in place, that have the same ends as others, or one end only, and towards vertices of small degree.

    Intrinsic Delaunay triangulations have some such edges near vertices of large curvature. Of those that
    can be flipped the one with most room goes first; there are few, so each is looked for anew.

    Args:
        triangulation: changed in place, as far as quads are convex.
        wanted: (n,) number of triangles at each vertex, at least.

    Returns:
        The half-edges flipped, in order.
    """
    flipped: list[int] = []
    while True:
        slots, room = _candidates(triangulation, wanted)
        if not len(slots):
            return np.array(flipped, dtype=np.int64)
        h = int(slots[np.argmax(room)])
        twin, tail, length = triangulation.twin, triangulation.tail, triangulation.length
        one, two = _around(h), _around(int(twin[h]))
        sides = (h, one[1], one[0], two[0], two[1])
        diagonal = euclidean_diagonal(*(float(length[side]) for side in sides))
        relink(twin, tail, length, h, diagonal)
        flipped.append(h)


def _around(slots: int | IntArray) -> tuple[IntArray, IntArray]:
    """Return the next and the previous half-edge in the triangle of each."""
    base = slots - slots % 3
    return base + NEXT[slots % 3], base + PREVIOUS[slots % 3]


def _candidates(triangulation: IntrinsicTriangulation, wanted: IntArray) -> tuple[IntArray, FloatArray]:
    """Return the half-edges that should be flipped, and can without harm, and their room."""
    twin, tail, count = triangulation.twin, triangulation.tail, triangulation.vertex_count
    every = np.arange(len(twin))
    after, before = _around(every)
    keys = _pair(tail, tail[after], count)
    known, number, times = np.unique(keys[twin < every], return_inverse=True, return_counts=True)
    is_double = np.zeros(len(twin), dtype=bool)
    is_double[twin < every] = times[number.ravel()] > 1
    is_double |= tail == tail[after]
    degree = np.bincount(tail, minlength=count)
    should: BoolArray = is_double | (degree < wanted)[tail[before]]
    slots = every[should & (twin >= 0)]
    slots = slots[twin[slots] // 3 != slots // 3]

    other = twin[slots]
    new = tail[before[slots]], tail[before[other]]
    spare = degree > wanted
    fine = spare[tail[slots]] & spare[tail[other]] & (new[0] != new[1])
    fine &= ~np.isin(_pair(*new, count), known)
    slots = slots[fine]
    room = _room(triangulation, slots)
    wide = room > 1e-3  # radians that corners of the quad are short of straight
    return slots[wide], room[wide]


def _pair(one: IntArray, two: IntArray, count: int) -> IntArray:
    return np.minimum(one, two) * count + np.maximum(one, two)


def _room(triangulation: IntrinsicTriangulation, slots: IntArray) -> FloatArray:
    """Return by how much the wider corner at the ends of each edge is short of straight."""
    lengths, other = triangulation.length.reshape(-1, 3), triangulation.twin[slots]
    one, two = corner_angles(lengths[slots // 3]), corner_angles(lengths[other // 3])
    rows = np.arange(len(slots))
    # Of a half-edge in slot i, the corner at its tail is i + 1 and the one at its head i + 2.
    at_tail = one[rows, NEXT[slots % 3]] + two[rows, PREVIOUS[other % 3]]
    at_head = one[rows, PREVIOUS[slots % 3]] + two[rows, NEXT[other % 3]]
    room: FloatArray = np.pi - np.maximum(at_tail, at_head)
    return room
