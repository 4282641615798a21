"""Conjugate gradients with smoothed aggregation multigrid, through pyamg: memory in proportion to the mesh."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import LinearOperator, cg

from .._arrays import FloatArray

# Relative residual at which it stops, and iterations at most.
ACCURACY, ITERATIONS = 1e-11, 400


class MultigridSolver:
    """A hierarchy of coarser systems that precondition the conjugate gradients."""

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
