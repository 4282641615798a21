"""Hermitian systems, by the real back ends."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bmat, csc_matrix, csr_matrix

from .ladder import factorize


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
