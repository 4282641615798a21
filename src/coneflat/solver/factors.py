"""Factorized matrices, and what solves like them: SuperLU, CHOLMOD without supernodes, multigrid.

A matrix is factorized once and solved with often. Each back end loads its package when it is first used.
"""

from __future__ import annotations

import math
from typing import Any, Protocol

import numpy as np
from scipy.linalg import lapack
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import LinearOperator, cg, splu

from .._arrays import FloatArray
from ..errors import MetricError


class NotPositiveDefinite(ArithmeticError):
    """The matrix has no Cholesky factorization in floating point."""


def aligned(shape: tuple[int, ...]) -> FloatArray:
    """Return room for numbers, in one piece, that starts at a multiple of 64 bytes; MKL counts on it."""
    size = math.prod(shape)
    buffer = np.empty(size + 8)
    start = -(buffer.ctypes.data // 8) % 8
    return buffer[start : start + size].reshape(shape)


def is_aligned(array: FloatArray) -> bool:
    """Return whether an array is like those of `aligned`."""
    return array.dtype == np.float64 and array.flags.c_contiguous and array.ctypes.data % 64 == 0


class Factor(Protocol):
    """A factorized matrix.

    Attributes:
        name: of the back end; "" for none.
        break_even: how many solutions, with what conjugate gradients do besides, take as long as another factorization.
    """

    name: str
    break_even: int

    def solve(self, right: FloatArray) -> FloatArray:
        """Return x with A x = right, for a vector (n,) or several at once (n, k)."""
        ...

    def renewed(self, matrix: csc_matrix) -> Factor:
        """Return the factor of another matrix of the same size, and use this one up: its analysis may serve again.

        Raises:
            NotPositiveDefinite: rounding has made the matrix indefinite.
        """
        ...


class EmptyFactor:
    """The factor of a matrix without rows, which a mesh without free vertices has."""

    name = ""
    break_even = 1

    def solve(self, right: FloatArray) -> FloatArray:
        """Return an empty solution."""
        return np.zeros_like(right)

    def renewed(self, matrix: csc_matrix) -> EmptyFactor:
        """Return itself."""
        return self


class SuperLUFactor:
    """A sparse LU factorization that keeps a symmetric ordering."""

    name = "scipy"
    break_even = 60

    def __init__(self, matrix: csc_matrix) -> None:
        try:
            self._factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        except RuntimeError as error:
            raise MetricError(
                f"a linear system of {matrix.shape[0]} unknowns is singular: the mesh has triangles too "
                "thin for double precision; remesh them, or run with --repair"
            ) from error

    def solve(self, right: FloatArray) -> FloatArray:
        """Return x with A x = right, for a vector (n,) or several at once (n, k)."""
        solution: FloatArray = self._factor.solve(np.asarray(right, dtype=np.float64))
        return solution

    def renewed(self, matrix: csc_matrix) -> SuperLUFactor:
        """Return the factor of another matrix of the same size."""
        return SuperLUFactor(matrix)


class DenseFactor:
    """A dense Cholesky factorization by LAPACK: of tiny matrices, for which others take longer to begin."""

    name = "scipy"
    break_even = 60

    def __init__(self, matrix: csc_matrix) -> None:
        # Symmetric, so that its rows are the columns that LAPACK wants.
        self._lower, failed = lapack.dpotrf(matrix.toarray().T, lower=1, clean=0, overwrite_a=1)
        if failed:
            raise NotPositiveDefinite(f"the minor of order {failed} is not positive")

    def solve(self, right: FloatArray) -> FloatArray:
        """Return x with A x = right, for a vector (n,) or several at once (n, k)."""
        solution: FloatArray = lapack.dpotrs(self._lower, right, lower=1)[0]
        return solution

    def renewed(self, matrix: csc_matrix) -> DenseFactor:
        """Return the factor of another matrix of the same size."""
        return DenseFactor(matrix)


class CholespyFactor:
    """A sparse Cholesky factorization by CHOLMOD: wheels everywhere, quick to load, slow on large meshes."""

    name = "cholespy"
    break_even = 60

    def __init__(self, matrix: csc_matrix) -> None:
        from cholespy import CholeskySolverD, MatrixType

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


# Relative residual at which it stops, and iterations at most.
ACCURACY, ITERATIONS = 1e-11, 400


class MultigridSolver:
    """Conjugate gradients preconditioned by a hierarchy of coarser systems: memory in proportion to the mesh."""

    name = "amg"
    break_even = 4

    def __init__(self, matrix: csc_matrix) -> None:
        import pyamg

        self._matrix = csr_matrix(matrix)
        # Weights by rows: estimates of the spectral radius start from random numbers.
        hierarchy: Any = pyamg.smoothed_aggregation_solver(
            self._matrix, smooth=("jacobi", {"weighting": "local"}), max_coarse=500
        )
        self._preconditioner: LinearOperator = hierarchy.aspreconditioner(cycle="V")

    def solve(self, right: FloatArray) -> FloatArray:
        """Return x with A x = right, for a vector (n,) or several, one after the other, (n, k)."""
        if right.ndim == 2:
            return np.stack([self.solve(column) for column in right.T], axis=1)
        solution, _ = cg(
            self._matrix, right, rtol=ACCURACY, atol=0.0, maxiter=ITERATIONS, M=self._preconditioner
        )
        return np.asarray(solution, dtype=np.float64)

    def renewed(self, matrix: csc_matrix) -> MultigridSolver:
        """Return a solver of another matrix of the same size."""
        return MultigridSolver(matrix)
