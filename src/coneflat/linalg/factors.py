"""The interface of factorized matrices, and SuperLU of SciPy.

A matrix is factorized once and used for many solves. `solvers.py` chooses the solver.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from ..base.arrays import FloatArray
from ..errors import MetricError

# Size of a diagonal entry, relative to the largest of its column, from which on SuperLU takes it as the pivot. With its
# default, 1, a badly scaled definite matrix of 48,000 unknowns takes minutes instead of 0.4 s, because pivots off the
# diagonal undo the ordering.
DIAGONAL_THRESHOLD = 0.01


class NotPositiveDefinite(ArithmeticError):
    """The matrix has no Cholesky factorization in floating point."""


def aligned(shape: tuple[int, ...]) -> FloatArray:
    """Return an uninitialised contiguous float64 array that starts at a multiple of 64 bytes, as MKL expects."""
    size = math.prod(shape)
    buffer = np.empty(size + 8)
    start = -(buffer.ctypes.data // 8) % 8
    return buffer[start : start + size].reshape(shape)


def is_aligned(array: FloatArray) -> bool:
    """Return whether an array is contiguous, float64 and 64-byte aligned, like those of `aligned`."""
    return array.dtype == np.float64 and array.flags.c_contiguous and array.ctypes.data % 64 == 0


class Triangle:
    """The lower triangle of symmetric matrices of one pattern.

    Args:
        matrix: (n, n), both triangles, with sorted indices.

    Attributes:
        starts: (n + 1,) where each column starts among the entries.
        rows: (z,) row of each entry.
    """

    def __init__(self, matrix: csc_matrix) -> None:
        indices, size = matrix.indices, matrix.shape[0]
        columns = np.repeat(np.arange(size, dtype=indices.dtype), np.diff(matrix.indptr))
        self._indices, self._is_lower = indices, indices >= columns
        self.rows = np.ascontiguousarray(indices[self._is_lower], dtype=np.int32)
        self.starts = np.zeros(size + 1, dtype=np.int32)
        np.cumsum(np.bincount(columns[self._is_lower], minlength=size), out=self.starts[1:])

    def has_pattern_of(self, matrix: csc_matrix) -> bool:
        """Return whether a matrix is known to have this pattern: its indices are those of the first matrix."""
        return matrix.indices is self._indices

    def values(self, matrix: csc_matrix) -> FloatArray:
        """Return (z,) the entries of a matrix of this pattern."""
        return matrix.data[self._is_lower]


class Factor:
    """Interface of factorized matrices, and the factor of the matrix without rows (a mesh without free vertices).

    Attributes:
        break_even: number of iterations of conjugate gradients, one solve each, that take as long as a factorization.
    """

    break_even = 60

    def __init__(self, matrix: csc_matrix) -> None:
        pass

    @classmethod
    def indefinite(cls, matrix: csc_matrix) -> Factor:
        """Return the factor of a matrix that is not positive definite, with pivoting.

        Raises:
            MetricError: the matrix is singular in double precision.
        """
        return SuperLUFactor(matrix)

    def solve(self, right: FloatArray) -> FloatArray:
        """Return the solution x of A x = right, for one right-hand side (n,) or several (n, k)."""
        return np.zeros_like(right)

    def refactorized(self, matrix: csc_matrix) -> Factor:
        """Return the factor of another matrix of the same size; this factor must not be used afterwards.

        The symbolic analysis is reused if the pattern is the same.

        Raises:
            NotPositiveDefinite: rounding has made the matrix indefinite.
        """
        return type(self)(matrix)


class SuperLUFactor(Factor):
    """A sparse LU factorization (SuperLU) with a symmetric ordering."""

    def __init__(self, matrix: csc_matrix) -> None:
        try:
            self._factor = splu(
                matrix,
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=DIAGONAL_THRESHOLD,
                options={"SymmetricMode": True},
            )
        except RuntimeError as error:
            raise MetricError(
                f"a linear system of {matrix.shape[0]} unknowns is singular: the mesh has triangles too "
                "thin for double precision; remesh them, or run with --repair"
            ) from error

    def solve(self, right: FloatArray) -> FloatArray:
        """Return the solution x of A x = right, for one right-hand side (n,) or several (n, k)."""
        return self._factor.solve(np.asarray(right, dtype=np.float64))
