"""Sparse symmetric positive definite systems: one interface, a file per back end."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy.sparse import csc_matrix

from .._arrays import FloatArray
from . import cholmod, superlu


class Factor(Protocol):
    """A factorized matrix."""

    def solve(self, right: FloatArray) -> FloatArray:
        """Return x with A x = right, for a vector (n,) or several at once (n, k)."""
        ...


class EmptyFactor:
    """The factor of a matrix without rows, which a mesh without free vertices has."""

    def solve(self, right: FloatArray) -> FloatArray:
        """Return an empty solution."""
        return np.zeros_like(right)


def factorize(matrix: csc_matrix) -> Factor:
    """Factorize a sparse symmetric positive definite matrix.

    Cholesky by CHOLMOD; SuperLU, which pivots, where rounding has made the matrix indefinite.
    """
    if matrix.shape[0] == 0:
        return EmptyFactor()
    try:
        return cholmod.CholmodFactor(matrix)
    except cholmod.NotPositiveDefinite:
        return superlu.SuperLUFactor(matrix)
