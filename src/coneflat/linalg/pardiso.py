"""PARDISO of Intel's MKL, installed with pypardiso: the fastest solver on large meshes, on x86-64 only.

The interface of pypardiso copies, hashes and checks matrices, which takes longer than the factorization. This module
calls the routine directly. It takes the upper triangle by rows, which for a symmetric matrix is the lower triangle by
columns.
"""

from __future__ import annotations

import ctypes
import os
import weakref
from contextlib import suppress
from enum import IntEnum
from functools import lru_cache
from importlib import metadata
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

from ..base.arrays import FloatArray
from ..base.threads import threads
from .factors import Factor, NotPositiveDefinite, Triangle, aligned, is_aligned

AnyArray: TypeAlias = NDArray[Any]


class Kind(IntEnum):
    """Matrix types of PARDISO."""

    POSITIVE_DEFINITE = 2
    INDEFINITE = -2


class Phase(IntEnum):
    """Phases of a call of PARDISO."""

    ANALYSE = 11
    FACTORIZE = 22
    SOLVE = 33
    RELEASE = -1


class Parameter(IntEnum):
    """Indices into the parameter table `iparm` of PARDISO."""

    NO_DEFAULTS = 0
    ORDERING = 1
    SCHEDULE = 23
    FROM_ZERO = 34


class Code(IntEnum):
    """Error codes of PARDISO."""

    OUT_OF_MEMORY = -2
    ZERO_PIVOT = -4


# Parallel nested dissection, and a two-level factorization. A permutation, given or requested, would silently disable
# the latter.
SETTINGS = {Parameter.NO_DEFAULTS: 1, Parameter.ORDERING: 3, Parameter.SCHEDULE: 1, Parameter.FROM_ZERO: 1}
# Minimum degree, and a factorization level by level: on one thread, a third less time for the analysis of systems of up
# to so many unknowns.
SMALL_SETTINGS, MAX_SMALL_SYSTEM = {**SETTINGS, Parameter.ORDERING: 0, Parameter.SCHEDULE: 0}, 20_000
# File names of MKL on the operating systems, and the environment variable that gives pypardiso another path.
RUNTIMES = ("libmkl_rt.", "mkl_rt.")
LIBRARY_VARIABLE = "PYPARDISO_MKL_RT"
# Environment variable: milliseconds for which an idle thread of MKL spins before it sleeps. The default, 200, takes
# time from other stages and processes.
BLOCK_TIME_VARIABLE = "KMP_BLOCKTIME"


class PardisoFactor(Factor):
    """A sparse Cholesky factorization by PARDISO; its analysis is reused for matrices of the same pattern.

    All calls use the number of threads of the constructor. A solve with fewer threads than the factorization gives
    wrong results without an error, and another factorization with more threads than the solve ends the process.
    Results are the same bit for bit in every run, but the last digits depend on the number of threads.
    """

    break_even = 30

    def __init__(self, matrix: csc_matrix, is_definite: bool = True) -> None:
        kind = Kind.POSITIVE_DEFINITE if is_definite else Kind.INDEFINITE
        n, self._kind, self._threads = matrix.shape[0], kind, threads()
        self._handle = np.zeros(64, dtype=np.int64)
        self._table = np.zeros(64, dtype=np.int32)
        settings = SMALL_SETTINGS if n <= MAX_SMALL_SYSTEM and self._threads == 1 else SETTINGS
        self._table[list(settings)] = list(settings.values())
        self._order = np.zeros(n, dtype=np.int32)
        # PARDISO allocates its memory itself; it must be released with this object.
        self._finalizer = weakref.finalize(self, _release, kind, self._threads, self._handle, self._table, n)
        self._set_pattern(matrix)
        self._fill(matrix)

    def _set_pattern(self, matrix: csc_matrix) -> None:
        self._triangle = Triangle(matrix)
        self._values = _copied(self._triangle.values(matrix))
        self._call(Phase.ANALYSE)

    def _fill(self, matrix: csc_matrix) -> None:
        self._values = _copied(self._triangle.values(matrix))
        self._call(Phase.FACTORIZE)

    def solve(self, right: FloatArray) -> FloatArray:
        """Return the solution x of A x = right, for one right-hand side (n,) or several (n, k)."""
        if not right.size:
            return np.zeros(right.shape)
        # Each right-hand side must be contiguous; for the transpose of a (k, n) array this is a view.
        columns = right.T if is_aligned(right.T) else _copied(right.T)
        solution = aligned(columns.shape)
        self._call(Phase.SOLVE, columns, solution)
        return solution.T

    @classmethod
    def indefinite(cls, matrix: csc_matrix) -> PardisoFactor:
        """Return the factor of a matrix that is not positive definite, with pivoting."""
        return cls(matrix, is_definite=False)

    def refactorized(self, matrix: csc_matrix) -> PardisoFactor:
        """Return the factor of another matrix of the same size; this factor must not be used afterwards."""
        if not self._triangle.has_pattern_of(matrix):
            # A second analysis with the same handle would leak the memory of the first.
            _release(self._kind, self._threads, self._handle, self._table, matrix.shape[0])
            self._handle[:] = 0
            self._set_pattern(matrix)
        self._fill(matrix)
        return self

    def _call(self, phase: int, right: FloatArray | None = None, solution: FloatArray | None = None) -> None:
        count = 1 if right is None or right.ndim == 1 else len(right)
        code = _pardiso(
            self._kind,
            self._threads,
            phase,
            self._handle,
            self._table,
            (self._values, self._triangle.starts, self._triangle.rows, self._order),
            (right, solution),
            count,
        )
        if code == Code.ZERO_PIVOT and self._kind == Kind.POSITIVE_DEFINITE:
            raise NotPositiveDefinite("a pivot is not positive")
        if code == Code.OUT_OF_MEMORY:
            raise MemoryError(f"PARDISO does not have enough memory for {len(self._order):,} unknowns")
        if code:
            raise RuntimeError(f"PARDISO failed with code {code} in phase {phase}")


def load() -> type[Factor]:
    """Return the factorization, after MKL was loaded.

    Raises:
        ImportError, OSError, AttributeError: it cannot be loaded.
    """
    _routines()
    return PardisoFactor


def _copied(array: FloatArray) -> FloatArray:
    copy = aligned(array.shape)
    copy[...] = array
    return copy


def _release(kind: int, thread_count: int, handle: AnyArray, table: AnyArray, n: int) -> None:
    none = np.zeros(1)
    order = np.zeros(1, dtype=np.int32)
    starts = np.zeros(n + 1, dtype=np.int32)
    _pardiso(kind, thread_count, Phase.RELEASE, handle, table, (none, starts, order, order), (None, None), 1)


def _pardiso(
    kind: int,
    thread_count: int,
    phase: int,
    handle: AnyArray,
    table: AnyArray,
    matrix: tuple[AnyArray, AnyArray, AnyArray, AnyArray],
    sides: tuple[AnyArray | None, AnyArray | None],
    count: int,
) -> int:
    values, starts, rows, order = matrix
    code = ctypes.c_int32(0)
    pardiso, set_threads = _routines()
    before = set_threads(thread_count)
    pardiso(
        _address(handle),
        *map(_number, (1, 1, kind, phase, len(starts) - 1)),
        *map(_address, (values, starts, rows, order)),
        _number(count),
        _address(table),
        _number(0),  # no messages
        *map(_address, sides),
        ctypes.byref(code),
    )
    set_threads(before)
    return code.value


def _number(value: int) -> Any:
    return ctypes.byref(ctypes.c_int32(value))


def _address(array: AnyArray | None) -> ctypes.c_void_p:
    return ctypes.c_void_p(None if array is None else array.ctypes.data)


@lru_cache(maxsize=1)
def _routines() -> tuple[Any, Any]:
    """Return PARDISO, and the function that sets the number of threads of MKL and returns the previous number."""
    library = _library()
    pardiso, set_threads = library["pardiso"], library["MKL_Set_Num_Threads_Local"]
    pardiso.restype = None
    set_threads.argtypes, set_threads.restype = [ctypes.c_int], ctypes.c_int
    # Otherwise MKL may use fewer threads than requested.
    library["MKL_Set_Dynamic"](0)
    return pardiso, set_threads


def _library() -> ctypes.CDLL:
    """Return MKL, loaded from the installed package `mkl`, or else found by pypardiso, whose search is slower."""
    os.environ.setdefault(BLOCK_TIME_VARIABLE, "0")
    try:
        installed = metadata.files("mkl") or ()
    except metadata.PackageNotFoundError:
        installed = ()
    for path in installed if LIBRARY_VARIABLE not in os.environ else ():
        if path.name.startswith(RUNTIMES):
            with suppress(OSError):
                return ctypes.CDLL(str(path.locate()))
    from pypardiso import PyPardisoSolver

    return PyPardisoSolver().libmkl
