"""Connected components, and lengths of sides, one after the other in compiled loops."""

from __future__ import annotations

import math

import numpy as np

from .._arrays import FloatArray, IntArray
from .compiled import compiled


@compiled
def label_nodes(count: int, tails: IntArray, heads: IntArray) -> tuple[int, IntArray]:
    """Return the number of connected components of a graph and the component of each node, in the order of nodes.

    Of two trees of nodes that an edge joins, the root of larger index is put under the other; ways to roots are halved.
    """
    parent = np.arange(count)
    for e in range(len(tails)):
        one, two = tails[e], heads[e]
        while parent[one] != one:
            parent[one] = parent[parent[one]]
            one = parent[one]
        while parent[two] != two:
            parent[two] = parent[parent[two]]
            two = parent[two]
        if one < two:
            parent[two] = one
        else:
            parent[one] = two
    number = 0
    for v in range(count):  # a parent comes before its children
        if parent[v] == v:
            parent[v] = number
            number += 1
        else:
            parent[v] = parent[parent[v]]
    return number, parent


@compiled
def measure_sides(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return (m, 3) the lengths of sides, each opposite a corner; the same bits from both ends."""
    lengths = np.empty(faces.shape)
    for f in range(len(faces)):
        for i in range(3):
            one, two = faces[f, (i + 1) % 3], faces[f, (i + 2) % 3]
            square = 0.0
            for x in range(vertices.shape[1]):
                side = vertices[two, x] - vertices[one, x]
                square += side * side
            lengths[f, i] = math.sqrt(square)
    return lengths
