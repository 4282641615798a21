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
    bits = (np.ascontiguousarray(vertices) + 0.0).view(np.int64)
    # lexsort is stable, so each run of equal positions begins with its first vertex.
    order = np.lexsort(bits.T)
    ordered = bits[order]
    is_new = np.ones(len(bits), dtype=bool)
    is_new[1:] = np.any(ordered[1:] != ordered[:-1], axis=1)
    first_of_run = order[is_new]
    first = np.empty(len(bits), dtype=np.int64)
    first[order] = first_of_run[np.cumsum(is_new) - 1]
    kept = np.sort(first_of_run)
    rank = np.empty(len(bits), dtype=np.int64)
    rank[kept] = np.arange(len(kept))
    return kept, rank[first]
