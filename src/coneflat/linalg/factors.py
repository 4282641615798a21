"""Sparse factorizations: MKL PARDISO (pypardiso) for large systems if it is installed, else CHOLMOD (cholespy).

A matrix is factorized once and used for many solves. SuperLU factorizes small and indefinite matrices.
"""

from __future__ import annotations

import math
from functools import cache
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bmat, csc_matrix, csr_matrix
from scipy.sparse.linalg import splu

from ..base.arrays import FloatArray
from ..errors import MetricError

# Number of unknowns below which loading MKL, 0.03 s in each process, takes longer than it saves.
MIN_PARDISO_UNKNOWNS = 12_000
# Number of unknowns of a small system. With a twentieth of them, SuperLU is as fast as CHOLMOD, which prints a message
# on standard output if a matrix is indefinite.
MAX_SMALL_SYSTEM = 20_000


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


class Factor:
    """Interface of factorized matrices, and the factor of the matrix without rows (a mesh without free vertices).

    Attributes:
        break_even: number of iterations of conjugate gradients, one solve each, that take as long as a factorization.
    """

    break_even = 60

    def __init__(self, matrix: csc_matrix) -> None:
        pass

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
            self._factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        except RuntimeError as error:
            raise MetricError(
                f"a linear system of {matrix.shape[0]} unknowns is singular: the mesh has triangles too "
                "thin for double precision; remesh them, or run with --repair"
            ) from error

    def solve(self, right: FloatArray) -> FloatArray:
        """Return the solution x of A x = right, for one right-hand side (n,) or several (n, k)."""
        return self._factor.solve(np.asarray(right, dtype=np.float64))


class CholespyFactor(Factor):
    """A sparse Cholesky factorization by CHOLMOD: available everywhere, quick to load, slow on large meshes."""

    def __init__(self, matrix: csc_matrix) -> None:
        from cholespy import CholeskySolverD, MatrixType

        if not (matrix.diagonal() > 1e-13 * np.abs(matrix.data).max(initial=0.0)).all():
            # CHOLMOD prints a message on standard output where it fails, mostly at thin triangles.
            raise NotPositiveDefinite("the diagonal is not positive, or of very different sizes")
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
        """Return the solution x of A x = right, for one right-hand side (n,) or several (n, k)."""
        right = np.ascontiguousarray(right, dtype=np.float64)
        solution = np.zeros_like(right)
        self._solver.solve(right, solution)
        return solution


@cache
def has_pardiso() -> bool:
    """Return whether PARDISO (pypardiso) is installed."""
    return find_spec("pypardiso") is not None


def factorize(matrix: csc_matrix, previous: Factor | None = None, total_size: int = 0) -> Factor:
    """Return the factorization of a sparse symmetric positive definite matrix.

    Args:
        matrix: (n, n), both triangles, with sorted indices.
        previous: the factor of another matrix of the same size that is not needed any more; its symbolic analysis is
            reused if possible.
        total_size: number of unknowns of the larger system that the matrix belongs to, if any. PARDISO is chosen by the
            larger of both sizes: it is loaded anyway, and reuses its analysis, which takes most of the time.

    Raises:
        MetricError: the matrix is singular in double precision.
    """
    size = matrix.shape[0]
    if size == 0:
        return Factor(matrix)
    is_by_pardiso = max(size, total_size) >= MIN_PARDISO_UNKNOWNS and has_pardiso()
    try:
        if previous is not None:
            return previous.refactorized(matrix)
        if 20 * size < MAX_SMALL_SYSTEM and not is_by_pardiso:
            return SuperLUFactor(matrix)
        return _by_pardiso(matrix) if is_by_pardiso else CholespyFactor(matrix)
    except NotPositiveDefinite:
        # Rounding has made the matrix indefinite; with pivoting it can still be factorized.
        return _by_pardiso(matrix, is_definite=False) if is_by_pardiso else SuperLUFactor(matrix)


def _by_pardiso(matrix: csc_matrix, is_definite: bool = True) -> Factor:
    from .pardiso import PardisoFactor

    return PardisoFactor(matrix, is_definite)


class HermitianFactor:
    """A factorized Hermitian positive definite matrix, stored as a real matrix of twice the size.

    Args:
        matrix: (n, n) complex.

    Raises:
        MetricError: the matrix is singular in double precision.
    """

    def __init__(self, matrix: csr_matrix) -> None:
        real, imaginary = matrix.real, matrix.imag
        self._factor = factorize(csc_matrix(bmat([[real, -imaginary], [imaginary, real]])))

    def solve(self, right: NDArray[Any]) -> NDArray[np.complex128]:
        """Return the complex solution x of A x = right, both (n,)."""
        parts = self._factor.solve(np.concatenate([right.real, right.imag]))
        return parts[: len(right)] + 1j * parts[len(right) :]
