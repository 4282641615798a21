"""A bounded surface glued to its mirror image along the boundary."""

from __future__ import annotations

import numpy as np

from .._arrays import IntArray
from ..geometry.intrinsic import IntrinsicTriangulation


def double(triangulation: IntrinsicTriangulation) -> tuple[IntrinsicTriangulation, IntArray]:
    """Return the double of a bounded triangulation, and which vertex each of its vertices is a copy of.

    Triangles and vertices keep their numbers; triangle m + f mirrors triangle f, with its sides 1 and 2
    exchanged; boundary vertices are their own images. Edges of the boundary become inner edges, which can be
    flipped: no obtuse angle opposite a boundary edge is in the way of a Delaunay triangulation any more.
    """
    twin, tail, n = triangulation.twin, triangulation.tail, triangulation.vertex_count
    slots = np.arange(len(twin))
    head = tail[slots - slots % 3 + (slots + 1) % 3]
    mirror = len(twin) + slots - slots % 3 + np.array([0, 2, 1])[slots % 3]
    outer = twin < 0
    inside = np.ones(n, dtype=bool)
    inside[tail[outer]] = False
    inside[head[outer]] = False
    image = np.arange(n)
    image[inside] = n + np.arange(inside.sum())

    both = 2 * len(twin)
    new_twin, new_tail, length = np.empty(both, np.int64), np.empty(both, np.int64), np.empty(both)
    new_twin[slots] = np.where(outer, mirror, twin)
    new_twin[mirror] = np.where(outer, slots, mirror[twin])
    new_tail[slots], new_tail[mirror] = tail, image[head]
    length[slots] = length[mirror] = triangulation.length
    original = np.concatenate([np.arange(n), np.flatnonzero(inside)])
    return IntrinsicTriangulation(new_twin, new_tail, length, len(original)), original
