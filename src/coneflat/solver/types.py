"""What the back ends have in common."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy.sparse import csc_matrix

from .._arrays import FloatArray


class NotPositiveDefinite(ArithmeticError):
    """The matrix has no Cholesky factorization in floating point."""


class Factor(Protocol):
    """A factorized matrix.

    Attributes:
        break_even: how many solutions, with what conjugate gradients do besides, take as long as another factorization.
    """

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

    break_even = 1

    def solve(self, right: FloatArray) -> FloatArray:
        """Return an empty solution."""
        return np.zeros_like(right)

    def renewed(self, matrix: csc_matrix) -> EmptyFactor:
        """Return itself."""
        return self
