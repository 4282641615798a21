"""Algebraic coarsening of a Laplacian by smoothed aggregation.

Reference: P. Vanek, J. Mandel, M. Brezina, "Algebraic multigrid by smoothed aggregation for second and fourth
order elliptic problems", Computing 56, 1996.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, diags, eye

from ...base.arrays import FloatArray, IntArray
from ...base.jit import compiled
from ..solution import TIE_TOLERANCE

# Largest coarsening factor of a level: an aggregate is a vertex with its neighbours.
MAX_AGGREGATE = 7.0
# Couplings below this fraction of the geometric mean of the diagonals do not join vertices. Such couplings are across
# slivers, and to vertices of high valence, whose aggregates would otherwise absorb all their neighbours.
MIN_COUPLING = 0.02
# Damping of the Jacobi step that smooths the aggregates: 4/3 over the largest eigenvalue of D^-1 L, about 2.
DAMPING = 2 / 3
# Entries below this fraction of the size of their row are rounding errors.
RELATIVE_ROUNDING = 1e-12
# Largest number of functions that meet at an unknown which is smoothed. An unknown of higher valence would couple all
# of them with one another.
MAX_MEETING_FUNCTIONS = 100
# Largest number of functions on the last level, relative to the requested number, if larger aggregates can attain it.
MAX_SIZE_RATIO = 1.05
# Fraction of the unknowns of the previous level above which a level is rejected, as it hardly reduces them.
MAX_LEVEL_SHARE = 0.9


def coarse_basis(
    laplacian: csr_matrix, areas: FloatArray, size: int
) -> tuple[csr_matrix, csr_matrix, csr_matrix]:
    """Return about `size` basis functions that approximate smooth functions on the mesh.

    Args:
        laplacian: (n, n) positive (semi)definite; vertices become centres of aggregates in its order.
        areas: (n,) vertex areas.
        size: requested number of basis functions.

    Returns:
        (n, m) the basis functions, the identity on small meshes; (m, m) the Laplacian and (m, m) the mass matrix
        between basis functions.
    """
    count = laplacian.shape[0]
    functions, level, mass = eye(count, format="csr"), laplacian, diags(areas, format="csr")
    order = np.arange(count)
    while level.shape[0] > 1.2 * size:
        level = _without_rounding(level, level.diagonal())
        ratio = level.shape[0] / size
        steps = max(1, round(np.log(ratio) / np.log(MAX_AGGREGATE)))
        max_count = size if steps == 1 else None
        for min_coupling in (MIN_COUPLING, 0.0):  # 0 if all couplings are weak, as on slivers
            prolongation = _smoothed_aggregates(level, order, ratio ** (1 / steps), max_count, min_coupling)
            if prolongation.shape[1] <= MAX_LEVEL_SHARE * level.shape[0]:
                break
        else:
            # Hardly any unknowns are coupled, as on a strip between two boundaries: aggregate consecutive unknowns.
            prolongation = _indicators(np.argsort(order, kind="stable") * size // len(order), size)
        transposed = csr_matrix(prolongation.T)
        level = csr_matrix(transposed @ (level @ prolongation))
        mass = csr_matrix(transposed @ (mass @ prolongation))
        functions = csr_matrix(functions @ prolongation)
        order = _order_of_aggregates(prolongation, order)
    return functions, level, mass


def _indicators(labels: IntArray, number: int) -> csr_matrix:
    """Return (n, number) the indicator functions of the labels 0 to number - 1 of n unknowns."""
    count = len(labels)
    return csr_matrix((np.ones(count), (np.arange(count), labels)), shape=(count, number))


def _smoothed_aggregates(
    level: csr_matrix, order: IntArray, size: float, max_count: int | None, min_coupling: float
) -> csr_matrix:
    """Return basis functions of about `size` vertices each, and about `max_count` functions if that is possible.

    Couplings below the fraction `min_coupling` do not join vertices.
    """
    count = level.shape[0]
    diagonal = np.maximum(level.diagonal(), 1e-300)
    rows = level.indptr.astype(np.int64), level.indices.astype(np.int64), level.data, diagonal, order
    labels, number = aggregate(*rows, size, min_coupling)
    before = count + 1
    while max_count is not None and max_count * MAX_SIZE_RATIO < number < before:
        # Leftover vertices make aggregates smaller than requested; another level instead would make the matrix dense.
        size *= number / max_count
        before = number
        labels, number = aggregate(*rows, size, min_coupling)
    pieces = _indicators(labels, number)
    image = csr_matrix(level @ pieces)
    damping = np.where(np.diff(image.indptr) > MAX_MEETING_FUNCTIONS, 0.0, DAMPING / diagonal)
    smoothed = csr_matrix(pieces - diags(damping) @ image)
    return _without_rounding(smoothed, np.ones(count))


def _without_rounding(matrix: csr_matrix, sizes: FloatArray) -> csr_matrix:
    """Return a matrix without the entries that are rounding errors, given the sizes (n,) of its rows.

    Edges opposite right angles have weights of about 0. Whether SciPy drops such an entry depends on rounding, and the
    order of the aggregates must not depend on it.
    """
    cleaned = matrix.copy()
    cleaned.data[np.abs(cleaned.data) <= RELATIVE_ROUNDING * np.repeat(sizes, np.diff(cleaned.indptr))] = 0.0
    cleaned.eliminate_zeros()
    return cleaned


@compiled
def aggregate(
    indptr: IntArray,
    indices: IntArray,
    weights: FloatArray,
    diagonal: FloatArray,
    order: IntArray,
    size: float,
    min_coupling: float,
) -> tuple[IntArray, int]:
    """Return (n,) the aggregate of each vertex, and the number of aggregates.

    A vertex whose neighbours are mostly free forms an aggregate with those that are coupled most strongly. Remaining
    vertices join the aggregate of their most strongly coupled neighbour. Couplings below the fraction `min_coupling` of
    the geometric mean of the diagonals do not count.
    """
    labels = np.empty(len(diagonal), np.int64)
    for vertex in range(len(diagonal)):
        labels[vertex] = -1
    number = 0
    for vertex in order:
        if labels[vertex] >= 0:
            continue
        free = 0
        taken = 0
        for e in range(indptr[vertex], indptr[vertex + 1]):
            neighbour = indices[e]
            if neighbour != vertex and -weights[e] > min_coupling * math.sqrt(
                diagonal[vertex] * diagonal[neighbour]
            ):
                if labels[neighbour] < 0:
                    free += 1
                else:
                    taken += 1
        if free + 1 < 0.6 * size and taken > 0:
            continue
        labels[vertex] = number
        space = size - 1 if free + 1 > size else free
        # A fractional size is attained on average, by rounding the cumulative size.
        space = math.floor((number + 1) * space) - math.floor(number * space) if space != free else free
        while space >= 1:
            strongest, best = -1, min_coupling
            for e in range(indptr[vertex], indptr[vertex + 1]):
                neighbour = indices[e]
                if neighbour != vertex and labels[neighbour] < 0:
                    strength = -weights[e] / math.sqrt(diagonal[vertex] * diagonal[neighbour])
                    if strength > best * (1 + TIE_TOLERANCE):
                        strongest, best = neighbour, strength
            if strongest < 0:
                break
            labels[strongest] = number
            space -= 1
        number += 1
    return join_remaining(indptr, indices, weights, order, labels, number)


@compiled
def join_remaining(
    indptr: IntArray, indices: IntArray, weights: FloatArray, order: IntArray, labels: IntArray, number: int
) -> tuple[IntArray, int]:
    """Return (n,) the aggregate of each vertex, and the number of aggregates.

    Vertices without an aggregate, whose label is -1, join that of their most strongly coupled neighbour, or form one.
    """
    joined = np.empty(len(labels), np.int64)
    for vertex in order:
        joined[vertex] = labels[vertex]
        if labels[vertex] >= 0:
            continue
        strongest, best = -1, 0.0
        for e in range(indptr[vertex], indptr[vertex + 1]):
            neighbour = indices[e]
            if neighbour != vertex and labels[neighbour] >= 0 and -weights[e] > best * (1 + TIE_TOLERANCE):
                strongest, best = neighbour, -weights[e]
        if strongest >= 0:
            joined[vertex] = labels[strongest]
        else:
            joined[vertex] = number
            number += 1
    return joined, number


def _order_of_aggregates(prolongation: csr_matrix, order: IntArray) -> IntArray:
    """Return the order of aggregates by their first members."""
    place = np.argsort(order)
    columns = prolongation.tocsc()
    first = np.minimum.reduceat(place[columns.indices], columns.indptr[:-1])
    return np.argsort(first, kind="stable")


def representatives(basis: csr_matrix, fitness: FloatArray) -> IntArray:
    """Return the vertices where a coarse function times the fitness is largest, ascending and without repetitions.

    Among equal values, the first vertex is taken. Functions that are nowhere positive have none.
    """
    columns = csc_matrix(diags(fitness) @ basis)
    column = np.repeat(np.arange(basis.shape[1]), np.diff(columns.indptr))
    largest = np.zeros(basis.shape[1])
    np.maximum.at(largest, column, columns.data)
    is_largest = (columns.data > 0) & (columns.data >= largest[column] * (1 - TIE_TOLERANCE))
    _, first = np.unique(column[is_largest], return_index=True)
    return np.unique(columns.indices[is_largest][first]).astype(np.int64)
