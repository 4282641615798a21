"""CHOLMOD without supernodes, through cholespy: wheels everywhere, quick to load, slow on large meshes."""

from __future__ import annotations

import numpy as np
from cholespy import CholeskySolverD, MatrixType
from scipy.sparse import csc_matrix

from .._arrays import FloatArray
from .types import NotPositiveDefinite


class CholespyFactor:
    """A sparse Cholesky factorization."""

    break_even = 60

    def __init__(self, matrix: csc_matrix) -> None:
        if not (matrix.diagonal() > 0).all():
            # CHOLMOD finds out, too, and says so on standard output.
            raise NotPositiveDefinite("the diagonal is not positive")
        try:
            self._solver = CholeskySolverD(
                matrix.shape[0],
                matrix.indptr.astype(np.int32),
                matrix.indices.astype(np.int32),
                matrix.data.astype(np.float64),
                MatrixType.CSC,
            )
        except ValueError as error:
            raise NotPositiveDefinite(str(error)) from error

    def solve(self, right: FloatArray) -> FloatArray:
        """Return x with A x = right, for a vector (n,) or several at once (n, k)."""
        right = np.ascontiguousarray(right, dtype=np.float64)
        solution = np.zeros_like(right)
        self._solver.solve(right, solution)
        return solution

    def renewed(self, matrix: csc_matrix) -> CholespyFactor:
        """Return the factor of another matrix of the same size."""
        return CholespyFactor(matrix)
