"""The Hessian of the conformal energy: the cotangent Laplacian of the current metric."""

from __future__ import annotations

from copy import copy

import numpy as np
from scipy.sparse import csc_matrix

from ..._arrays import BoolArray, FloatArray, Int32Array, IntArray
from ...compiled import compiled
from ...geometry.intrinsic import IntrinsicTriangulation


class HessianPattern:
    """The sparsity pattern of the Laplacian of one triangulation, to be filled for many metrics.

    Every matrix made has the same index arrays (the same objects), whichever vertices are held, so that a
    solver may keep its symbolic analysis.
    """

    def __init__(self, triangulation: IntrinsicTriangulation) -> None:

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
def list_columns(tail: IntArray, twin: IntArray, starts: Int32Array, rows: Int32Array) -> None:
    """Write the sorted rows of each column, with repetitions, behind its start.

    starts: (n + 1,) zeros on entry, starts of the columns on return. rows: room for n + 6m entries.
    """
    n = len(starts) - 1
    for v in range(n):
        starts[v + 1] = 1
    for h in range(len(tail)):
        head = tail[h - h % 3 + (h + 1) % 3]
        if head != tail[h]:
            starts[tail[h] + 1] += 1
            if twin[h] < 0:
                starts[head + 1] += 1
    for v in range(n):
        starts[v + 1] += starts[v]
    place = starts.copy()
    for v in range(n):
        rows[place[v]] = v
        place[v] += 1
    for h in range(len(tail)):
        i, j = tail[h], tail[h - h % 3 + (h + 1) % 3]
        if i != j:
            rows[place[i]] = j
            place[i] += 1
            if twin[h] < 0:
                rows[place[j]] = i
                place[j] += 1
    for v in range(n):
        for at in range(starts[v] + 1, starts[v + 1]):
            row = rows[at]
            before = at - 1
            while before >= starts[v] and rows[before] > row:
                rows[before + 1] = rows[before]
                before -= 1
            rows[before + 1] = row


@compiled
def drop_repetitions(starts: Int32Array, rows: Int32Array, diagonal: Int32Array) -> int:
    """Keep each row of each column once, in place; note the diagonal; return the number of entries."""
    kept = 0
    begin = 0
    for v in range(len(starts) - 1):
        end = starts[v + 1]
        starts[v] = kept
        last = -1
        for at in range(begin, end):
            if rows[at] != last:
                last = rows[at]
                rows[kept] = last
                if last == v:
                    diagonal[v] = kept
                kept += 1
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
def find_entries(tail: IntArray, starts: Int32Array, rows: Int32Array, entry: Int32Array) -> None:
    """Write, for each half-edge, where the entry (head, tail) is stored; -1 if they are one vertex."""
    for h in range(len(tail)):
        i, j = tail[h], tail[h - h % 3 + (h + 1) % 3]
        entry[h] = -1 if i == j else find_entry(starts, rows, j, i)


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
    for h in range(len(tail)):
        if entry[h] < 0:
            continue
        i, j = tail[h], tail[h - h % 3 + (h + 1) % 3]
        t = twin[h]
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
