"""The Hessian of the conformal energy: the cotangent Laplacian of the current metric."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix

from .._arrays import BoolArray, FloatArray
from ..geometry.intrinsic import IntrinsicTriangulation


class HessianPattern:
    """The sparsity pattern of the Laplacian of one triangulation, to be filled for many metrics.

    Every matrix made has the same index arrays (the same objects), whichever vertices are held, so that a
    solver may keep its symbolic analysis.
    """

    def __init__(self, triangulation: IntrinsicTriangulation) -> None:
        from .hessian_kernel import drop_repetitions, find_entries, list_columns

        n, tail, twin = triangulation.vertex_count, triangulation.tail, triangulation.twin
        starts = np.zeros(n + 1, dtype=np.int32)
        rows = np.empty(n + len(tail) + int((twin < 0).sum()), dtype=np.int32)
        list_columns(tail, twin, starts, rows)
        self._diagonal = np.empty(n, dtype=np.int32)
        count = drop_repetitions(starts, rows, self._diagonal)
        self._tail, self._twin = tail.copy(), twin.copy()
        self._starts, self._rows = starts, rows[:count].copy()
        self._entry = np.empty(len(tail), dtype=np.int32)
        find_entries(tail, self._starts, self._rows, self._entry)

    def matrix(self, cots: FloatArray, held: BoolArray) -> csc_matrix:
        """Return the (n, n) Laplacian, with rows and columns of the identity at the held vertices.

        Args:
            cots: (3m,) cotangent of the angle opposite each half-edge.
            held: (n,) True for vertices that are no unknowns.
        """
        from .hessian_kernel import fill_values

        values = np.empty(len(self._rows))
        fill_values(
            self._tail, self._twin, cots, held, self._starts, self._rows, self._entry, self._diagonal, values
        )
        n = len(held)
        return csc_matrix((values, self._rows, self._starts), shape=(n, n))
