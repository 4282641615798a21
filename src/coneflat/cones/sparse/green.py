"""The biharmonic kernel of a mesh: what cones at given vertices contribute to the area distortion.

With G the inverse of the Laplacian and A the covariance under the vertex areas, A = diag(a) - a a^T, the distortion of
target curvatures k is E^2 = (K - k)^T G A G (K - k). An entry of G A G is a product of two Green's
functions, a back-substitution each.
"""

from __future__ import annotations

from copy import copy
from functools import cached_property

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, diags

from ...base.arrays import BoolArray, FloatArray, IntArray
from ...linalg import Factor, aligned, factorize

# Numbers in right-hand sides that are solved at once, at most: more gain nothing and cost memory.
MAX_BATCH_NUMBERS = 10_000_000


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

    def with_weights(self, areas: FloatArray) -> GreenOperator:
        """Return the operator with other weights (n,); the factorization is the same."""
        if np.array_equal(areas, self._share):
            return self
        _ = self._factor  # which the copy has, too
        other = copy(self)
        other.areas, other._share = areas[self.vertices], areas
        return other

    @cached_property
    def _factor(self) -> Factor:
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
        size = max(1, MAX_BATCH_NUMBERS // max(1, len(self.vertices)))
        return [unknowns[start : start + size] for start in range(0, len(unknowns), size)]

    def responses(self, unknowns: IntArray) -> FloatArray:
        """Return (k, f) the Green's functions of sources at k unknowns; on a closed surface, each up to a constant."""
        sources = aligned((len(unknowns), len(self.vertices)))
        sources[:] = -self.areas if self.is_closed else 0.0
        sources[np.arange(len(unknowns)), unknowns] += 1.0
        if self.is_closed:
            sources[:, 0] = 0.0
        return self._factor.solve(sources.T).T


def renumbered(matrix: csc_matrix, order: IntArray) -> csr_matrix:
    """Return the rows and columns of a matrix (n, n) that are named in an order (f,), by rows with sorted columns."""
    picked = csr_matrix(csr_matrix(matrix)[order][:, order])
    picked.sort_indices()
    return picked


def _grounded(matrix: csr_matrix) -> csr_matrix:
    """Return a matrix, by rows with sorted columns, whose first row and column are those of the identity."""
    first = np.arange(matrix.shape[0]) == 0
    return csr_matrix(diags(~first * 1.0) @ matrix @ diags(~first * 1.0) + diags(first * 1.0))
