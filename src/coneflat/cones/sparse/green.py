"""The biharmonic kernel of a mesh, which gives the area distortion of cones.

Let G be the inverse of the Laplacian and A = diag(a) - a a^T the covariance with the vertex areas a. The distortion of
target curvatures k is E^2 = (K - k)^T G A G (K - k). An entry of G A G is a product of two Green's functions, each of
which takes a back-substitution.
"""

from __future__ import annotations

from copy import copy
from functools import cached_property

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, diags

from ...base.arrays import BoolArray, FloatArray, IntArray
from ...linalg import Factor, aligned, factorize

# Largest number of entries of right-hand sides that are solved at once; more save no time and need more memory.
MAX_BATCH_NUMBERS = 10_000_000


class GreenOperator:
    """The Laplacian of the inner vertices in a given order, factorized when it is first needed.

    Attributes:
        vertices: (f,) the vertex of each unknown.
        laplacian: (f, f) the Laplacian of the unknowns.
        areas: (f,) area weights; together with those of the boundary, their sum is 1.
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
        """Return the operator with other area weights (n,); the factorization is shared."""
        if np.array_equal(areas, self._share):
            return self
        _ = self._factor  # computed here, so that the copy shares it
        reweighted = copy(self)
        reweighted.areas, reweighted._share = areas[self.vertices], areas
        return reweighted

    @cached_property
    def _factor(self) -> Factor:
        inner = _grounded(self.laplacian) if self.is_closed else self.laplacian
        return factorize(csc_matrix(inner.T))  # symmetric: its rows are its columns

    def factorize(self) -> None:
        """Factorize the Laplacian, if it is not yet."""
        _ = self._factor

    @property
    def break_even(self) -> int:
        """Number of solves that take as long as a factorization."""
        return self._factor.break_even

    def solve(self, source: FloatArray) -> FloatArray:
        """Return G source for a source (f,) or (f, k); without a boundary, the solution has mean zero.

        On a closed surface, the sum of the source is subtracted from it in proportion to area.
        """
        if not self.is_closed:
            return self._factor.solve(source)
        # One source per row, so that each is contiguous.
        rows = np.atleast_2d(source.T)
        rows = rows - np.outer(rows.sum(axis=1), self.areas)
        rows[:, 0] = 0.0
        solution = self._factor.solve(rows.T).T
        solution -= (solution @ self.areas)[:, None]
        return solution[0] if source.ndim == 1 else solution.T

    def weighted(self, values: FloatArray) -> FloatArray:
        """Return (f,) the product of A and values (f,)."""
        return self.areas * (values - self.areas @ values)

    def unknowns_of(self, vertices: IntArray) -> IntArray:
        """Return the unknowns of vertices (s,); -1 for boundary vertices."""
        unknown = np.full(len(self._share), -1, dtype=np.int64)
        unknown[self.vertices] = np.arange(len(self.vertices))
        return unknown[vertices]

    def solve_at_vertices(self, source: FloatArray) -> FloatArray:
        """Return (n,) G source for a source (n,), both in the numbering of vertices.

        Without a boundary, the source must sum to 0, and the solution is unique up to a constant only.
        """
        inside = source[self.vertices]
        if self.is_closed:
            inside[0] = 0.0
        solution = np.zeros(len(source))
        solution[self.vertices] = self._factor.solve(inside)
        return solution

    def batches(self, unknowns: IntArray) -> list[IntArray]:
        """Return the unknowns in batches of the largest size that is solved at once."""
        size = max(1, MAX_BATCH_NUMBERS // max(1, len(self.vertices)))
        return [unknowns[start : start + size] for start in range(0, len(unknowns), size)]

    def responses(self, unknowns: IntArray) -> FloatArray:
        """Return (k, f) the Green's functions of k unknowns; on a closed surface, each up to a constant."""
        sources = aligned((len(unknowns), len(self.vertices)))
        sources[:] = -self.areas if self.is_closed else 0.0
        sources[np.arange(len(unknowns)), unknowns] += 1.0
        if self.is_closed:
            sources[:, 0] = 0.0
        return self._factor.solve(sources.T).T


def renumbered(matrix: csc_matrix, order: IntArray) -> csr_matrix:
    """Return (f, f) the rows and columns of a matrix (n, n) in an order (f,), in CSR form with sorted indices."""
    picked = csr_matrix(csr_matrix(matrix)[order][:, order])
    picked.sort_indices()
    return picked


def _grounded(matrix: csr_matrix) -> csr_matrix:
    """Return a CSR matrix with the first row and column replaced by those of the identity."""
    first = np.arange(matrix.shape[0]) == 0
    return csr_matrix(diags(~first * 1.0) @ matrix @ diags(~first * 1.0) + diags(first * 1.0))
