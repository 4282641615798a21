"""The Hessian of the conformal energy: the cotangent Laplacian of the current metric."""

from __future__ import annotations

from copy import copy

import numpy as np
from scipy.sparse import csc_matrix

from ..base.arrays import BoolArray, FloatArray, Int32Array, IntArray
from ..base.compiled import compiled
from ..geometry.intrinsic import IntrinsicTriangulation
from ..mesh.connectivity import sort_few


class HessianPattern:
    """The sparsity pattern of the Laplacian of one triangulation, to be filled for many metrics until it is flipped.

    Every matrix made has the same index arrays (the same objects), whichever vertices are held, so that a
    solver may keep its symbolic analysis.
    """

    def __init__(self, triangulation: IntrinsicTriangulation) -> None:
        n, tail, twin = triangulation.vertex_count, triangulation.tail, triangulation.twin
        starts = np.zeros(n + 1, dtype=np.int32)
        keys = np.empty(n + len(tail) + int(np.count_nonzero(twin < 0)), dtype=np.int64)
        list_columns(tail, twin, starts, keys)
        rows, self._diagonal = np.empty(len(keys), dtype=np.int32), np.empty(n, dtype=np.int32)
        self._entry = np.full(len(tail), -1, dtype=np.int32)
        count = number_entries(starts, keys, rows, self._entry, self._diagonal)
        self._tail, self._twin, self._starts, self._rows = tail, twin, starts, rows[:count].copy()
        # SciPy looks at a new matrix for longer than a small one takes to be filled.
        self._matrix = csc_matrix((np.zeros(count), self._rows, self._starts), shape=(n, n))

    def matrix(self, cots: FloatArray, held: BoolArray) -> csc_matrix:
        """Return the (n, n) Laplacian, with rows and columns of the identity at the held vertices.

        Args:
            cots: (3m,) cotangent of the angle opposite each half-edge.
            held: (n,) True for vertices that are no unknowns.
        """
        values = np.empty(len(self._rows))
        fill_values(
            self._tail, self._twin, cots, held, self._starts, self._rows, self._entry, self._diagonal, values
        )
        matrix = copy(self._matrix)
        matrix.data = values
        return matrix


@compiled
def list_columns(tail: IntArray, twin: IntArray, starts: Int32Array, keys: IntArray) -> None:
    """Write the entries of each column, with repetitions, behind its start: the row, above 32 bits, and a half-edge.

    The bits below are one more than the half-edge from column to row, or 0 for none.

    starts: (n + 1,) zeros on entry, starts of the columns on return. keys: room for n + 6m entries.
    """
    n = len(starts) - 1
    for v in range(n):
        starts[v + 1] = 1
    for base in range(0, len(tail), 3):
        for x in range(3):
            i, j = tail[base + x], tail[base + (x + 1) % 3]
            if i != j:
                starts[i + 1] += 1
                if twin[base + x] < 0:
                    starts[j + 1] += 1
    for v in range(n):
        starts[v + 1] += starts[v]
    place = starts.copy()
    for v in range(n):
        keys[place[v]] = np.int64(v) << 32
        place[v] += 1
    for base in range(0, len(tail), 3):
        for x in range(3):
            i, j = tail[base + x], tail[base + (x + 1) % 3]
            if i != j:
                keys[place[i]] = (j << 32) | (base + x + 1)
                place[i] += 1
                if twin[base + x] < 0:
                    keys[place[j]] = i << 32
                    place[j] += 1


@compiled
def number_entries(
    starts: Int32Array, keys: IntArray, rows: Int32Array, entry: Int32Array, diagonal: Int32Array
) -> int:
    """Sort the rows of each column and keep each once; return the number of entries.

    Args:
        starts, keys: see `list_columns`; where columns start without repetitions on return.
        rows: filled.
        entry: (3m,) -1; filled with where the entry of each half-edge, (head, tail), is, unless these are one vertex.
        diagonal: (n,) filled with where the diagonal is.
    """
    kept, begin = 0, 0
    for v in range(len(starts) - 1):
        end = starts[v + 1]
        starts[v] = kept
        sort_few(keys[begin:end])
        last = -1
        for at in range(begin, end):
            row, h = keys[at] >> 32, (keys[at] & 0xFFFFFFFF) - 1
            if row != last:
                last = row
                rows[kept] = row
                if row == v:
                    diagonal[v] = kept
                kept += 1
            if h >= 0:
                entry[h] = kept - 1
        begin = end
    starts[len(starts) - 1] = kept
    return kept


@compiled
def find_entry(starts: Int32Array, rows: Int32Array, row: int, column: int) -> int:
    """Return where an entry is stored."""
    low: int = starts[column]
    high: int = starts[column + 1] - 1
    while low < high:
        middle = (low + high) // 2
        if rows[middle] < row:
            low = middle + 1
        else:
            high = middle
    return low


@compiled
def fill_values(
    tail: IntArray,
    twin: IntArray,
    cots: FloatArray,
    held: BoolArray,
    starts: Int32Array,
    rows: Int32Array,
    entry: Int32Array,
    diagonal: Int32Array,
    values: FloatArray,
) -> None:
    """Fill in w_ij = (cot a + cot b) / 2, with unit rows and columns at the held vertices."""
    values[:] = 0.0
    for base in range(0, len(tail), 3):
        for x in range(3):
            h = base + x
            if entry[h] < 0:
                continue
            i, j, t = tail[h], tail[base + (x + 1) % 3], twin[h]
            weight = cots[h] / 2 if t < 0 else (cots[h] + cots[t]) / 2
            values[diagonal[i]] += weight
            if t < 0:
                values[diagonal[j]] += weight
            if held[i] or held[j]:
                continue
            values[entry[h]] -= weight
            if t < 0:
                values[find_entry(starts, rows, i, j)] -= weight
    for v in range(len(held)):
        if held[v]:
            values[diagonal[v]] = 1.0


@compiled
def changed_share(
    starts: Int32Array,
    rows: Int32Array,
    values: FloatArray,
    other_starts: Int32Array,
    other_rows: Int32Array,
    other_values: FloatArray,
    held: BoolArray,
) -> FloatArray:
    """Return (n,) by how much two symmetric matrices differ in each column, as a share of the other's diagonal.

    Both have sorted rows. Rows and columns that are held do not count.
    """
    share = np.zeros(len(held))
    for v in range(len(held)):
        if held[v]:
            continue
        change, diagonal = 0.0, 0.0
        at, other = starts[v], other_starts[v]
        while at < starts[v + 1] or other < other_starts[v + 1]:
            row = rows[at] if at < starts[v + 1] else len(held)
            if other < other_starts[v + 1]:
                row = min(row, other_rows[other])
            value = 0.0
            if at < starts[v + 1] and rows[at] == row:
                value += values[at]
                at += 1
            if other < other_starts[v + 1] and other_rows[other] == row:
                value -= other_values[other]
                if row == v:
                    diagonal = other_values[other]
                other += 1
            if not held[row]:
                change += abs(value)
        share[v] = change / diagonal if diagonal > 0 else np.inf
    return share
