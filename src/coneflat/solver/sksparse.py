"""CHOLMOD with supernodes, through scikit-sparse, where the user has built it."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import csc_matrix

from .._arrays import FloatArray
from .types import NotPositiveDefinite


class ScikitSparseFactor:
    """A sparse Cholesky factorization whose analysis serves matrices of the same pattern."""

    worth = 25

    def __init__(self, matrix: csc_matrix) -> None:
        from sksparse.cholmod import analyze

        self._indices = matrix.indices
        self._factor: Any = analyze(_with_long_indices(matrix))
        self._fill(matrix)

    def _fill(self, matrix: csc_matrix) -> None:
        from sksparse.cholmod import CholmodNotPositiveDefiniteError

        try:
            self._factor.cholesky_inplace(_with_long_indices(matrix))
        except CholmodNotPositiveDefiniteError as error:
            raise NotPositiveDefinite(str(error)) from error

    def solve(self, right: FloatArray) -> FloatArray:
        """Return x with A x = right, for a vector (n,) or several at once (n, k)."""
        return np.ascontiguousarray(self._factor.solve_A(np.asarray(right, dtype=np.float64)))

    def renewed(self, matrix: csc_matrix) -> ScikitSparseFactor:
        """Return the factor of another matrix of the same size."""
        if matrix.indices is not self._indices:
            return ScikitSparseFactor(matrix)
        self._fill(matrix)
        return self


def _with_long_indices(matrix: csc_matrix) -> csc_matrix:
    """Return the same matrix, with indices for factors of any size."""
    indices, starts = matrix.indices.astype(np.int64), matrix.indptr.astype(np.int64)
    return csc_matrix((matrix.data, indices, starts), shape=matrix.shape)
