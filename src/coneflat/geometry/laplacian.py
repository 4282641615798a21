"""The cotangent Laplacian."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix

from .._arrays import FloatArray, IntArray
from ..mesh import NEXT, PREVIOUS


def cotangent_laplacian(faces: IntArray, cots: FloatArray, vertex_count: int) -> csc_matrix:
    """Return the (n, n) positive semidefinite Laplacian, w_ij = (cot a + cot b) / 2.

    (L x)_i = sum_j w_ij (x_i - x_j); its kernel are the constants on each component.
    """
    i = faces[:, NEXT].ravel()
    j = faces[:, PREVIOUS].ravel()
    w = cots.ravel() / 2
    rows = np.concatenate([i, j, i, j])
    columns = np.concatenate([j, i, i, j])
    values = np.concatenate([-w, -w, w, w])
    return csc_matrix((values, (rows, columns)), shape=(vertex_count, vertex_count))
