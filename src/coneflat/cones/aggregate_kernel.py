"""Small loops over the neighbours of vertices and the rows of sparse matrices."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray, IntArray
from ..compiled import compiled

# Couplings that differ by less, relatively, are equal: regular meshes have many that differ by rounding only.
TIE = 1 + 1e-9


@compiled
def aggregate(
    indptr: IntArray,
    indices: IntArray,
    weights: FloatArray,
    diagonal: FloatArray,
    order: IntArray,
    size: float,
    weak: float,
) -> tuple[IntArray, int]:
    """Return (n,) the aggregate of each vertex, and their number.

    A vertex whose strong neighbours are mostly free takes the strongest of them; leftovers join their strongest
    neighbour's aggregate.
    """
    count = len(diagonal)
    labels = np.full(count, -1, np.int64)
    number = 0
    for vertex in order:
        if labels[vertex] >= 0:
            continue
        free = 0
        taken = 0
        for e in range(indptr[vertex], indptr[vertex + 1]):
            other = indices[e]
            if other != vertex and -weights[e] > weak * np.sqrt(diagonal[vertex] * diagonal[other]):
                if labels[other] < 0:
                    free += 1
                else:
                    taken += 1
        if free + 1 < 0.6 * size and taken > 0:
            continue
        labels[vertex] = number
        room = size - 1 if free + 1 > size else free
        # A fractional size is met on average: the remainder decides for every so many aggregates.
        room = np.floor((number + 1) * room) - np.floor(number * room) if room != free else free
        while room >= 1:
            strongest, best = -1, 0.0
            for e in range(indptr[vertex], indptr[vertex + 1]):
                other = indices[e]
                if other != vertex and labels[other] < 0:
                    strength = -weights[e] / np.sqrt(diagonal[vertex] * diagonal[other])
                    if strength > max(weak, best * TIE):
                        strongest, best = other, strength
            if strongest < 0:
                break
            labels[strongest] = number
            room -= 1
        number += 1
    joined = labels.copy()
    for vertex in order:
        if labels[vertex] >= 0:
            continue
        strongest, best = -1, 0.0
        for e in range(indptr[vertex], indptr[vertex + 1]):
            other = indices[e]
            if other != vertex and labels[other] >= 0 and -weights[e] > best * TIE:
                strongest, best = other, -weights[e]
        if strongest >= 0:
            joined[vertex] = labels[strongest]
        else:
            joined[vertex] = number
            number += 1
    return joined, number


@compiled
def ball(indptr: IntArray, indices: IntArray, centre: int, size: int) -> IntArray:
    """Return the `size` vertices nearest to a vertex in steps along edges, whole rings of them, itself first."""
    seen = {centre}
    found = [centre]
    start = 0
    while len(found) < size and start < len(found):
        end = len(found)
        for i in range(start, end):
            vertex = found[i]
            for e in range(indptr[vertex], indptr[vertex + 1]):
                other = indices[e]
                if other not in seen:
                    seen.add(other)
                    found.append(other)
        start = end
    return np.array(found)


@compiled
def squared_distances(
    indptr: IntArray, indices: IntArray, data: FloatArray, kernel: FloatArray, one: int, others: IntArray
) -> FloatArray:
    """Return (p,) the squared norm of the difference of row `one` and each other row of a sparse matrix.

    Args:
        indptr, indices, data: the matrix (n, m).
        kernel: (m, m) the inner product.
        one, others: a row, and (p,) rows.
    """
    found = np.zeros(len(others))
    start, stop = indptr[one], indptr[one + 1]
    own = 0.0
    image = np.zeros(len(kernel))
    for e in range(start, stop):
        for j in range(len(kernel)):
            image[j] += data[e] * kernel[indices[e], j]
    for e in range(start, stop):
        own += data[e] * image[indices[e]]
    for i in range(len(others)):
        start, stop = indptr[others[i]], indptr[others[i] + 1]
        value = own
        for e in range(start, stop):
            value -= 2.0 * data[e] * image[indices[e]]
            for d in range(start, stop):
                value += data[e] * data[d] * kernel[indices[e], indices[d]]
        found[i] = max(value, 0.0)
    return found
