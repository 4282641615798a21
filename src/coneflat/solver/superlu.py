"""SuperLU through SciPy."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from .._arrays import FloatArray
from ..errors import MetricError


class SuperLUFactor:
    """A sparse LU factorization that keeps a symmetric ordering."""

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
