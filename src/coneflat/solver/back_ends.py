"""Which back end factorizes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import lru_cache
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bmat, csc_matrix, csr_matrix

from ..errors import OptionError
from .factors import (
    CholespyFactor,
    DenseFactor,
    EmptyFactor,
    Factor,
    MultigridSolver,
    NotPositiveDefinite,
    SuperLUFactor,
)

# The modules that the back ends need; those that are no dependencies, with what installs them.
MODULES = {
    "pardiso": "pypardiso",
    "cholespy": "cholespy",
    "scipy": "scipy",
    "amg": "pyamg",
}
INSTALLED_BY = {"pardiso": "coneflat[fast]", "amg": "coneflat[amg]"}
# Unknowns up to which a dense matrix takes less than the least of the others.
TINY = 100
# Unknowns below which loading MKL, 0.03 s in each process, takes longer than what it saves.
LARGE = 12_000
# Unknowns of scattered parts below which SuperLU is faster.
SCATTERED = 20_000
# Unknowns from which a factorization without supernodes and nested dissection takes minutes and too much memory.
HUGE = 2_000_000


class Choice:
    """The back end asked for, and those that were used."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.used: dict[str, None] = {}


_choice: ContextVar[Choice | None] = ContextVar("coneflat_solver", default=None)


@lru_cache
def available(name: str) -> bool:
    """Whether a back end is installed."""
    try:
        return find_spec(MODULES[name]) is not None
    except ModuleNotFoundError:  # pragma: no cover - a package without its parent
        return False


@contextmanager
def solving(name: str) -> Iterator[Choice]:
    """Have everything inside use a back end, "auto" for the best there is.

    Raises:
        OptionError: it is not installed.
    """
    if name != "auto" and not available(name):
        raise OptionError(f"the solver {name} is not installed: pip install '{INSTALLED_BY[name]}'")
    choice = Choice(name)
    token = _choice.set(choice)
    try:
        yield choice
    finally:
        _choice.reset(token)


def factorize(
    matrix: csc_matrix,
    used_up: Factor | None = None,
    is_noted: bool = True,
    whole: int = 0,
    is_scattered: bool = False,
) -> Factor:
    """Factorize a sparse symmetric positive definite matrix.

    Args:
        matrix: (n, n), both triangles, with sorted indices.
        used_up: the factor of another matrix of the same size, needed no more, whose analysis may serve.
        is_noted: whether the back end counts as used, as it does not for a small part of something larger.
        whole: unknowns of something larger that it is a part of: what is loaded for that factorizes it, too, and has an
            analysis that serves again, which takes most of the time.
        is_scattered: whether it is of small parts that hardly hang together. SuperLU finds an order of elimination
            for these in a fraction of the time that others take.

    Raises:
        MetricError: it is singular in double precision.
    """
    size = matrix.shape[0]
    if size == 0:
        return EmptyFactor()
    choice = _choice.get() or Choice("auto")
    name = choice.name
    is_dense = name == "auto" and size <= TINY
    if name == "auto":
        is_for_lu = is_dense or (is_scattered and size < SCATTERED)
        name = "scipy" if is_for_lu else best_for(max(size, min(whole, LARGE)))
    try:
        if used_up is not None:
            factor = used_up.renewed(matrix)
        else:
            factor = DenseFactor(matrix) if is_dense else _open(name, matrix)
    except NotPositiveDefinite:
        # Rounding has made it indefinite: with pivots it has a factorization all the same.
        name, factor = _pivoting(name, matrix)
    except MemoryError:
        if choice.name != "auto" or not available("amg"):
            raise
        name, factor = "amg", _open("amg", matrix)
    if is_noted:
        choice.used[name] = None
    return factor


def used_again(factor: Factor) -> Factor:
    """Return a factor that was kept; its back end counts as used."""
    choice = _choice.get()
    if choice is not None and factor.name:
        choice.used[factor.name] = None
    return factor


def best_for(size: int) -> str:
    """Return the name of the back end for so many unknowns."""
    names: tuple[str, ...] = ("cholespy",)
    if size >= HUGE:
        names = ("pardiso", "amg", "cholespy")
    elif size >= LARGE:
        names = ("pardiso", "cholespy")
    return next((name for name in names if available(name)), "scipy")


def _open(name: str, matrix: csc_matrix) -> Factor:
    if name == "pardiso":
        from .pardiso import PardisoFactor

        return PardisoFactor(matrix)
    if name == "cholespy":
        return CholespyFactor(matrix)
    if name == "amg":
        return MultigridSolver(matrix)
    return SuperLUFactor(matrix)


def _pivoting(name: str, matrix: csc_matrix) -> tuple[str, Factor]:
    if name == "pardiso":
        from .pardiso import INDEFINITE, PardisoFactor

        return name, PardisoFactor(matrix, INDEFINITE)
    return "scipy", SuperLUFactor(matrix)


class HermitianFactor:
    """A factorized Hermitian positive definite matrix: as a real one of twice the size.

    Args:
        matrix: (n, n) complex.

    Raises:
        MetricError: it is singular in double precision.
    """

    def __init__(self, matrix: csr_matrix) -> None:
        real, imaginary = matrix.real, matrix.imag
        self._factor = factorize(csc_matrix(bmat([[real, -imaginary], [imaginary, real]])))

    def solve(self, right: NDArray[Any]) -> NDArray[np.complex128]:
        """Return the complex x with A x = right, both (n,)."""
        parts = self._factor.solve(np.concatenate([right.real, right.imag]))
        solution: NDArray[np.complex128] = parts[: len(right)] + 1j * parts[len(right) :]
        return solution
