"""Merging vertices that lie at exactly the same position."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .._arrays import FloatArray, IntArray
from ..compiled import compiled


def weld(vertices: FloatArray) -> tuple[IntArray, IntArray]:
    """Return which vertices to keep and what every vertex becomes.

    Two vertices are merged when their coordinates are equal bit for bit, -0.0 being taken as 0.0.

    Args:
        vertices: (n, 3) positions.

    Returns:
        (k,) the first vertex of each position, ascending; (n,) index into those of every vertex.
    """

    rows = (np.ascontiguousarray(vertices) + 0.0).view(np.int64)
    # At most half full, so that searches stay short.
    table = np.full(1 << (2 * len(rows)).bit_length(), -1, dtype=np.int32)
    return number_rows(rows, table)


# The golden ratio's fraction: its multiples modulo one are spread most evenly (Knuth, The Art of Computer
# Programming 3, Section 6.4).
GOLDEN = np.uint64(0x9E3779B97F4A7C15)
HALF = np.uint64(32)


@compiled
def number_rows(rows: IntArray, table: NDArray[np.int32]) -> tuple[IntArray, IntArray]:
    """Number the different rows in the order in which they come first.

    Args:
        rows: (n, 3) any bits.
        table: room to work in: more than n numbers, a power of two of them, all -1.

    Returns:
        (k,) where each row comes first; (n,) the number of every row.
    """
    last = len(table) - 1
    first = np.empty(len(rows), np.int64)
    number = np.empty(len(rows), np.int64)
    count = 0
    for i in range(len(rows)):
        a, b, c = rows[i, 0], rows[i, 1], rows[i, 2]
        key = np.uint64(0)
        for value in (a, b, c):
            key = (key ^ np.uint64(value)) * GOLDEN
            key ^= key >> HALF
        slot = np.int64(key) & last
        while table[slot] >= 0:
            other = first[table[slot]]
            if rows[other, 0] == a and rows[other, 1] == b and rows[other, 2] == c:
                break
            slot = (slot + 1) & last
        if table[slot] < 0:
            table[slot] = count
            first[count] = i
            count += 1
        number[i] = table[slot]
    return first[:count].copy(), number
