"""The cotangent Laplacian."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix, diags

from .._arrays import FloatArray, IntArray
from ..mesh import NEXT, PREVIOUS


def cotangent_laplacian(faces: IntArray, cots: FloatArray, vertex_count: int) -> csc_matrix:
    """Return the (n, n) positive semidefinite Laplacian, w_ij = (cot a + cot b) / 2.

    (L x)_i = sum_j w_ij (x_i - x_j); its kernel are the constants on each component.
    """
    i = faces[:, NEXT].ravel().astype(np.int32)
    j = faces[:, PREVIOUS].ravel().astype(np.int32)
    w = cots.ravel() / 2
    shape = vertex_count, vertex_count
    # Half of the entries, and their mirror image: sorting all of them at once takes three times as long.
    half = csc_matrix((w, (i, j)), shape=shape)
    weights = half + half.T.tocsc()
    diagonal = np.bincount(i, w, vertex_count) + np.bincount(j, w, vertex_count)
    return csc_matrix(diags(diagonal, format="csc") - weights)
