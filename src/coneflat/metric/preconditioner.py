"""Conjugate gradients with the factorized Laplacian of a metric that is similar.

A factorization serves on as the preconditioner of later steps while their iterations cost less than a new one: 11 to
33% of the time of a whole flattening on seven models.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import LinearOperator, cg

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..errors import MetricError
from ..linalg import Factor, factorize

# Rows of the matrix are corrected for that have changed by more than this share of their diagonal, but so many of them
# at most: those around cones and in coarse triangles. Conjugate gradients then take a quarter to a sixth of the
# iterations, and the factorization of these rows takes a twentieth of that of all: 17% of the time of a flattening of
# 97,000 triangles, 2 to 9% on other models.
CHANGED, MOST = 0.03, 0.1


class Inverse(Protocol):
    """What applies the inverse of a Laplacian, or something close to it; see `coneflat.linalg.Factor`."""

    @property
    def break_even(self) -> int:
        """How many solutions take as long as another factorization."""
        ...

    @property
    def laplacian(self) -> csc_matrix:
        """The matrix (n, n), with sorted indices, whichever rows are held at 0."""
        ...

    def solve(self, right: FloatArray) -> FloatArray:
        """Return (n,) the solution for a right-hand side (n,)."""
        ...


@dataclass(frozen=True, eq=False)
class HeldInverse:
    """A factorized Laplacian with rows and columns of the identity where the solution is held at 0."""

    factor: Factor
    laplacian: csc_matrix
    held: BoolArray

    @property
    def break_even(self) -> int:
        """How many solutions take as long as another factorization."""
        return self.factor.break_even

    def solve(self, right: FloatArray) -> FloatArray:
        """Return (n,) the solution, 0 where it is held."""
        return np.where(self.held, 0.0, self.factor.solve(np.where(self.held, 0.0, right)))


@dataclass(frozen=True, eq=False)
class CorrectedInverse:
    """The inverse of a similar matrix between two exact solutions of the rows that differ most.

    A multiplicative Schwarz method, symmetric (B. Smith, P. Bjorstad, W. Gropp, "Domain decomposition", 1996): what the
    rows chosen can do about the residual, what the other inverse can do about the rest, and what they can do then.

    Attributes:
        inverse: of the similar matrix.
        chosen: (c,) rows.
        columns: (n, c) those of the matrix.
        factor: of its rows and columns.
    """

    inverse: Inverse
    chosen: IntArray
    columns: csc_matrix
    factor: Factor

    @property
    def break_even(self) -> int:
        """How many solutions take as long as another factorization."""
        return self.inverse.break_even

    @property
    def laplacian(self) -> csc_matrix:
        """The similar matrix."""
        return self.inverse.laplacian

    def solve(self, right: FloatArray) -> FloatArray:
        """Return (n,) the solution for a right-hand side (n,)."""
        own = self.factor.solve(right[self.chosen])
        solution = self.inverse.solve(right - self.columns @ own)
        solution[self.chosen] += own
        solution[self.chosen] += self.factor.solve(right[self.chosen] - self.columns.T @ solution)
        return solution


def corrected(inverse: Inverse, matrix: csc_matrix, held: BoolArray) -> Inverse:
    """Return an inverse that is closer to that of a matrix (n, n), with sorted indices.

    held: (n,) rows that are of no interest.
    """
    from .hessian import changed_share

    one, other = matrix, inverse.laplacian
    share = changed_share(one.indptr, one.indices, one.data, other.indptr, other.indices, other.data, held)
    chosen = np.flatnonzero(share > max(CHANGED, float(np.quantile(share, 1 - MOST))))
    if not len(chosen):
        return inverse
    columns = matrix[:, chosen]
    block = csc_matrix(columns.T.tocsc()[:, chosen].T)
    try:
        return CorrectedInverse(inverse, chosen, columns, factorize(block, is_scattered=True))
    except MetricError:  # what is broken there leaves no unique solution
        return inverse


def conjugate_gradients(
    matrix: csc_matrix, right: FloatArray, inverse: Inverse, accuracy: float
) -> FloatArray | None:
    """Return the solution of a semidefinite system whose right side is in its range; None if that takes too long.

    accuracy: what the residual comes down to, relatively.
    """
    towards = LinearOperator(matrix.shape, matvec=inverse.solve, dtype=np.float64)
    solution, failed = cg(matrix, right, rtol=accuracy, atol=0.0, maxiter=inverse.break_even, M=towards)
    return None if failed or not np.isfinite(solution).all() else np.asarray(solution)
