"""Which solver factorizes a sparse symmetric positive definite matrix.

`rslab` is the standard. PARDISO, where it is installed, is faster for large systems, and SuperLU of SciPy for small
ones. Where neither of the others can be loaded, SuperLU factorizes everything.
"""

from __future__ import annotations

import os
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from logging import getLogger
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bmat, csc_matrix, csr_matrix

from ..errors import OptionError
from .factors import Factor, NotPositiveDefinite, SuperLUFactor

# Number of unknowns below which loading MKL, 0.03 s in each process, takes longer than it saves.
MIN_PARDISO_UNKNOWNS = 12_000
# Number of unknowns below which one factorization by SuperLU and its solves take no longer than by RSLAB.
MIN_RSLAB_UNKNOWNS = 1_000
# Environment variable: the only solver that is used, for trials and tests.
SOLVER_VARIABLE = "CONEFLAT_SOLVER"
# The solvers, and what pip installs for them. A module of the same name here has `load`.
PACKAGES = {"pardiso": "pypardiso", "rslab": "rslab", "superlu": "scipy"}


def factorize(matrix: csc_matrix, previous: Factor | None = None, total_size: int = 0) -> Factor:
    """Return the factorization of a sparse symmetric positive definite matrix.

    Args:
        matrix: (n, n), both triangles, with sorted indices.
        previous: the factor of another matrix of the same size that is not needed any more; its symbolic analysis is
            reused if possible.
        total_size: number of unknowns of the larger system that the matrix belongs to, if any. The solver is chosen by
            the larger of both sizes: it is loaded anyway, and reuses its analysis, which takes most of the time.

    Raises:
        MetricError: the matrix is singular in double precision.
        OptionError: the environment variable names a solver that is unknown or not installed.
    """
    size = matrix.shape[0]
    if size == 0:
        return Factor(matrix)
    kind = solver_for(max(size, total_size))
    try:
        return kind(matrix) if previous is None else previous.refactorized(matrix)
    except NotPositiveDefinite:
        # Rounding has made the matrix indefinite.
        return kind.indefinite(matrix)


def solver_for(size: int) -> type[Factor]:
    """Return the factorization that serves systems of a number of unknowns.

    Raises:
        OptionError: the environment variable names a solver that is unknown or not installed.
    """
    if only := os.environ.get(SOLVER_VARIABLE):
        return _forced(only)
    for name, min_size in (("pardiso", MIN_PARDISO_UNKNOWNS), ("rslab", MIN_RSLAB_UNKNOWNS)):
        if size >= min_size and (kind := solver(name)):
            return kind
    return SuperLUFactor


def _forced(name: str) -> type[Factor]:
    if name not in PACKAGES:
        raise OptionError(f"{SOLVER_VARIABLE}={name}: the solvers are {', '.join(PACKAGES)}")
    if kind := solver(name):
        return kind
    raise OptionError(
        f"{SOLVER_VARIABLE}={name}: {PACKAGES[name]} is not installed, or cannot be loaded: "
        f"pip install {PACKAGES[name]}"
    )


@cache
def solver(name: str) -> type[Factor] | None:
    """Return a factorization by its name; None if it is not installed, or cannot be loaded, which is logged."""
    if name == "superlu":
        return SuperLUFactor
    if find_spec(PACKAGES[name]) is None:
        return None
    try:
        return import_module(f".{name}", __package__).load()
    except (ImportError, OSError, AttributeError) as error:
        reason = " ".join(str(error).split())
        getLogger("coneflat").warning(
            "coneflat: %s cannot be loaded, others solve instead: %s", PACKAGES[name], reason
        )
        return None


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
