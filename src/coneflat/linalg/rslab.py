"""RSLAB, a sparse LDL^T factorization in Rust: the standard solver, with wheels for every common platform.

It pivots, so that it factorizes indefinite matrices as well.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import csc_matrix

from ..base.arrays import FloatArray
from .factors import Factor, NotPositiveDefinite, Triangle

# Approximate minimum fill: of the orderings of RSLAB the one with the shortest time in total.
ORDERING = "amf"


class RslabFactor(Factor):
    """A sparse LDL^T factorization; its analysis is reused for matrices of the same pattern.

    It runs on one thread: two gain nothing measurable. Results are the same bit for bit in every run.
    """

    break_even = 20

    def __init__(self, matrix: csc_matrix) -> None:
        self._set_pattern(matrix)
        self._fill(matrix)

    def _set_pattern(self, matrix: csc_matrix) -> None:
        from rslab import analyze

        self._triangle = triangle = Triangle(matrix)
        lower = csc_matrix((triangle.values(matrix), triangle.rows, triangle.starts), shape=matrix.shape)
        self._symbolic: Any = analyze(lower, path="ldlt", ordering=ORDERING, threads=1)

    def _fill(self, matrix: csc_matrix) -> None:
        try:
            self._factor = self._symbolic.factor(self._triangle.values(matrix))
        except RuntimeError as error:
            raise NotPositiveDefinite(str(error)) from error

    def solve(self, right: FloatArray) -> FloatArray:
        """Return the solution x of A x = right, for one right-hand side (n,) or several (n, k)."""
        right = np.asarray(right, dtype=np.float64)
        if not right.size:
            return np.zeros(right.shape)
        return self._factor.solve(right) if right.ndim == 1 else self._factor.solve_many(right)

    def refactorized(self, matrix: csc_matrix) -> RslabFactor:
        """Return the factor of another matrix of the same size; this factor must not be used afterwards."""
        if not self._triangle.has_pattern_of(matrix):
            self._set_pattern(matrix)
        self._fill(matrix)
        return self


def load() -> type[Factor]:
    """Return the factorization, after RSLAB was loaded.

    Raises:
        ImportError: it cannot be loaded.
    """
    import rslab  # noqa: F401

    return RslabFactor
