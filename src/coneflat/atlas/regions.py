"""The connected pieces of an overlap."""

from __future__ import annotations

import numpy as np

from .._arrays import IntArray
from ..mesh import NEXT, label_components


def overlap_regions(pairs: IntArray, triangles: IntArray) -> tuple[int, IntArray]:
    """Return the number of regions where a layout overlaps itself, and the region of each pair.

    Two pairs are neighbours where they have a triangle in common, and their other triangles share a side: the
    overlap goes on across it. So a region has two layers, each a connected part of the mesh.

    Args:
        pairs: (k, 2) as in `Overlaps`: sorted, the smaller index first.
        triangles: (m, 3) the points at their corners, by which they share sides.
    """
    if not len(pairs):
        return 0, np.empty(0, dtype=np.int64)
    count = len(triangles)
    one, two = _neighbours(np.unique(pairs), triangles)
    order = np.argsort(one, kind="stable")
    one, two = one[order], two[order]
    # Every pair both ways round; the second triangle goes to each of its neighbours.
    kept, moved = pairs.ravel(), pairs[:, ::-1].ravel()
    first = np.searchsorted(one, moved)
    ways = np.searchsorted(one, moved, side="right") - first
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
    tails = triangles[chosen].ravel()
    heads = triangles[chosen][:, NEXT].ravel()
    keys = np.minimum(tails, heads) * (int(triangles.max()) + 1) + np.maximum(tails, heads)
    order = np.argsort(keys, kind="stable")
    same = keys[order[1:]] == keys[order[:-1]]
    one, two = chosen[order[:-1][same] // 3], chosen[order[1:][same] // 3]
    return np.concatenate([one, two]), np.concatenate([two, one])
