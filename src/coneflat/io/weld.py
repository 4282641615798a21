"""Merging vertices that lie at exactly the same position."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray, IntArray


def weld(vertices: FloatArray) -> tuple[IntArray, IntArray]:
    """Return which vertices to keep and what every vertex becomes.

    Two vertices are merged when their coordinates are equal bit for bit, -0.0 being taken as 0.0.

    Args:
        vertices: (n, 3) positions.

    Returns:
        (k,) the first vertex of each position, ascending; (n,) index into those of every vertex.
    """
    from .weld_kernel import number_rows

    rows = (np.ascontiguousarray(vertices) + 0.0).view(np.int64)
    # At most half full, so that searches stay short.
    table = np.full(1 << (2 * len(rows)).bit_length(), -1, dtype=np.int32)
    return number_rows(rows, table)
