"""The biharmonic kernel of a mesh: what cones at given vertices contribute to the area distortion.

With G the inverse of the Laplacian and A the covariance under the vertex areas, A = diag(a) - a a^T, the distortion of
target curvatures k is E^2 = (K - k)^T G A G (K - k). An entry of G A G is a product of two Green's
functions, a back-substitution each.
"""

from __future__ import annotations

from copy import copy
from functools import cached_property

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix

from ..._arrays import BoolArray, FloatArray, Int32Array, IntArray
from ...compiled import compiled
from ...solver import Factor, aligned, factorize, used_again

# Right-hand sides solved at once: more gain nothing and cost memory, of which they take so many numbers at most.
BATCH, NUMBERS = 32, 50_000_000
# The last Green's functions of cones that the user places are kept, in so many numbers at most, and so many of them:
# cones seldom come back to where they were before the last hundreds of moves.
KEPT, MOST_KEPT = 8_000_000, 256
# So many are solved for at a time, whatever is wanted: on their number the last digits depend, and what was kept must
# be what would be found.
SIDE_BY_SIDE = 4


class GreenOperator:
    """The Laplacian of the vertices off the boundary in an order of choice, factorized when it is first needed.

    Attributes:
        vertices: (f,) the vertex of each unknown.
        laplacian: (f, f).
        areas: (f,) weights that sum to 1 together with those of the boundary.
        is_closed: whether there is no boundary.
    """

    def __init__(
        self, laplacian: csc_matrix, areas: FloatArray, is_boundary: BoolArray, order: IntArray
    ) -> None:
        self.vertices = order[~is_boundary[order]]
        self.laplacian = renumbered(laplacian, self.vertices)
        self.areas = areas[self.vertices]
        self.is_closed = len(self.vertices) == len(order)
        self._share = areas
        self._known: dict[int, FloatArray] = {}

    def weighing(self, areas: FloatArray) -> GreenOperator:
        """Return the operator with other weights (n,); the factorization is the same."""
        if np.array_equal(areas, self._share):
            return self
        _ = self._factorized  # which the copy has, too
        other = copy(self)
        other.areas, other._share, other._known = areas[self.vertices], areas, {}
        return other

    @property
    def _factor(self) -> Factor:
        return used_again(self._factorized)

    @cached_property
    def _factorized(self) -> Factor:
        inner = _grounded(self.laplacian) if self.is_closed else self.laplacian
        return factorize(csc_matrix(inner.T))  # symmetric: its rows are its columns

    @property
    def break_even(self) -> int:
        """How many solutions take as long as another factorization."""
        return self._factor.break_even

    def solve(self, source: FloatArray) -> FloatArray:
        """Return G source for (f,) or (f, k): zero on the boundary; without one, mean-free.

        What a closed surface's source has in sum is taken off in proportion to area.
        """
        if not self.is_closed:
            return self._factor.solve(source)
        # By rows, each in one piece: what sources look like as columns.
        rows = np.atleast_2d(source.T)
        rows = rows - np.outer(rows.sum(axis=1), self.areas)
        rows[:, 0] = 0.0
        solution = self._factor.solve(rows.T).T
        solution -= (solution @ self.areas)[:, None]
        return solution[0] if source.ndim == 1 else solution.T

    def weighted(self, values: FloatArray) -> FloatArray:
        """Return (f,) A values."""
        return self.areas * (values - self.areas @ values)

    def solve_at_vertices(self, source: FloatArray) -> FloatArray:
        """Return (n,) G source for (n,), both in the numbering of vertices.

        Without a boundary the source must sum to 0, and the solution is one of those that differ by a constant.
        """
        inside = source[self.vertices]
        if self.is_closed:
            inside[0] = 0.0
        solution = np.zeros(len(source))
        solution[self.vertices] = self._factor.solve(inside)
        return solution

    def batches(self, unknowns: IntArray) -> list[IntArray]:
        """Return unknowns in sets of as many as are best solved for at once."""
        size = min(BATCH, max(1, NUMBERS // max(1, len(self.vertices))))
        return [unknowns[start : start + size] for start in range(0, len(unknowns), size)]

    def responses(self, unknowns: IntArray, room: FloatArray | None = None) -> FloatArray:
        """Return (k, f) the Green's functions of sources at k unknowns; on a closed surface, each up to a constant.

        room: (k, f), aligned, for sources to be written to: memory that is used again need not be handed out.
        """
        sources = aligned((len(unknowns), len(self.vertices))) if room is None else room
        sources[:] = -self.areas if self.is_closed else 0.0
        sources[np.arange(len(unknowns)), unknowns] += 1.0
        if self.is_closed:
            sources[:, 0] = 0.0
        return self._factor.solve(sources.T).T

    def known_responses(self, unknowns: IntArray) -> FloatArray:
        """Return (k, f) the Green's functions of sources at some unknowns, of which those used last are kept."""
        wanted, known = unknowns.tolist(), self._known
        new = [unknown for unknown in dict.fromkeys(wanted) if unknown not in known]
        for start in range(0, len(new), SIDE_BY_SIDE):
            some = new[start : start + SIDE_BY_SIDE]
            block = np.array(some + some[:1] * (SIDE_BY_SIDE - len(some)))
            for unknown, response in zip(some, self.responses(block), strict=False):
                known[unknown] = response.copy()
        for unknown in wanted:
            # Taken out and put back, so that the first is the one that was used longest ago.
            known[unknown] = known.pop(unknown)
        rows = np.array([known[unknown] for unknown in wanted]).reshape(len(wanted), len(self.vertices))
        room = min(max(1, KEPT // len(self.vertices)), MOST_KEPT)
        for unknown in list(known)[: max(0, len(known) - room)]:
            del known[unknown]
        return rows


def renumbered(matrix: csc_matrix, order: IntArray) -> csr_matrix:
    """Return the rows and columns of a matrix (n, n) that are named in an order (f,), by rows with sorted columns."""
    number = np.full(matrix.shape[0], -1, dtype=np.int32)
    number[order] = np.arange(len(order))
    rows = matrix.indices.astype(np.int32, copy=False)
    starts = np.zeros(len(order) + 1, dtype=np.int32)
    columns, values = np.empty(len(rows), dtype=np.int32), np.empty(len(rows))
    spread_columns(
        matrix.indptr.astype(np.int32, copy=False), rows, matrix.data, order, number, starts, columns, values
    )
    count = int(starts[-1])
    return csr_matrix((values[:count], columns[:count], starts), shape=(len(order), len(order)))


@compiled
def spread_columns(
    starts: Int32Array,
    rows: Int32Array,
    values: FloatArray,
    order: IntArray,
    number: Int32Array,
    new_starts: Int32Array,
    new_columns: Int32Array,
    new_values: FloatArray,
) -> None:
    """Write the columns of a matrix, in an order, into its rows, which are sorted then.

    starts, rows, values: the matrix by columns. order: (f,) columns; number: (n,) their places in it, -1 for others.
    new_starts: (f + 1,) zeros on entry. new_columns, new_values: room for all entries.
    """
    for column in order:
        for at in range(starts[column], starts[column + 1]):
            if number[rows[at]] >= 0:
                new_starts[number[rows[at]] + 1] += 1
    for row in range(len(order)):
        new_starts[row + 1] += new_starts[row]
    place = new_starts[:-1].copy()
    for new in range(len(order)):
        for at in range(starts[order[new]], starts[order[new] + 1]):
            row = number[rows[at]]
            if row >= 0:
                new_columns[place[row]] = new
                new_values[place[row]] = values[at]
                place[row] += 1


def _grounded(matrix: csr_matrix) -> csr_matrix:
    """Return a matrix, by rows with sorted columns, whose first row and column are those of the identity."""
    begin = matrix.indptr[1]
    kept = np.concatenate([np.arange(begin) == 0, matrix.indices[begin:] > 0])
    gone = np.searchsorted(matrix.indptr, np.flatnonzero(~kept), side="right") - 1
    counts = np.diff(matrix.indptr)
    np.subtract.at(counts, gone, 1)
    starts = np.zeros_like(matrix.indptr)
    np.cumsum(counts, out=starts[1:])
    values = matrix.data[kept]
    values[0] = 1.0
    return csr_matrix((values, matrix.indices[kept], starts), shape=matrix.shape)
