"""The connected pieces of an overlap."""

from __future__ import annotations

import numpy as np

from .._arrays import IntArray
from ..mesh import NEXT, label_components, sort_by_counting, sort_pairs


def overlap_regions(pairs: IntArray, triangles: IntArray) -> tuple[int, IntArray]:
    """Return the number of regions where a layout overlaps itself, and the region of each pair.

    Two pairs are neighbours where they have a triangle in common, and their other triangles share a side: the
    overlap goes on across it. Where two layers have sides in common, it ends for this purpose.

    Args:
        pairs: (k, 2) as in `Overlaps`: sorted, the smaller index first.
        triangles: (m, 3) the points at their corners, by which they share sides.
    """
    if not len(pairs):
        return 0, np.empty(0, dtype=np.int64)
    count = len(triangles)
    one, two = _neighbours(np.unique(pairs), triangles)
    two = two[sort_by_counting(one, count)]
    ways = np.bincount(one, minlength=count)
    starts = np.cumsum(ways) - ways
    # Every pair both ways round; the second triangle goes to each of its neighbours.
    kept, moved = pairs.ravel(), pairs[:, ::-1].ravel()
    first, ways = starts[moved], ways[moved]
    source = np.repeat(np.arange(len(moved)), ways)
    step = np.arange(len(source)) - np.repeat(np.cumsum(ways) - ways - first, ways)
    kept, moved = kept[source], two[step]
    keys = pairs[:, 0] * count + pairs[:, 1]
    wanted = np.minimum(kept, moved) * count + np.maximum(kept, moved)
    place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    found = keys[place] == wanted
    return label_components(len(pairs), source[found] // 2, place[found])


def _neighbours(chosen: IntArray, triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Return the chosen triangles that share a side, two and two, each both ways round."""
    tails, heads = triangles[chosen].ravel(), triangles[chosen][:, NEXT].ravel()
    order, first = sort_pairs(tails, heads, int(triangles.max()) + 1)
    again = np.flatnonzero(~first)
    one, two = chosen[order[again - 1] // 3], chosen[order[again] // 3]
    return np.concatenate([one, two]), np.concatenate([two, one])
