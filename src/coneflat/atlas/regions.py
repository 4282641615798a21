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
    source, place = _steps(pairs, triangles)
    return label_components(len(pairs), source // 2, place // 2)


def overlap_layers(pairs: IntArray, triangles: IntArray) -> list[tuple[IntArray, IntArray]]:
    """Return for each region the triangles of its two layers: sets that are connected, without a common member.

    Where an overlap is wound up so that its layers go over into each other, they are one of its pairs.
    """
    if not len(pairs):
        return []
    source, place = _steps(pairs, triangles)
    # Pairs the right way round and the other way round: which triangle is in which layer goes on with the overlap.
    count, label = label_components(
        2 * len(pairs), np.concatenate([source, source ^ 1]), np.concatenate([place, place ^ 1])
    )
    kept, moved = pairs.ravel(), pairs[:, ::-1].ravel()
    order = sort_by_counting(label, count)
    layers = []
    for members in np.split(order, np.cumsum(np.bincount(label, minlength=count))[:-1]):
        if members[0] % 2:  # the same region the other way round
            continue
        one, other = np.unique(kept[members]), np.unique(moved[members])
        if len(np.intersect1d(one, other)):
            one, other = kept[members[:1]], moved[members[:1]]
        layers.append((one, other))
    return layers


def _steps(pairs: IntArray, triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Return between which pairs an overlap goes on when its second triangle gives way to a neighbour.

    Pair i is numbered 2i as it stands and 2i + 1 the other way round.
    """
    if not len(pairs):
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
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
    return source[found], 2 * place[found] + (kept > moved)[found]


def _neighbours(chosen: IntArray, triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Return the chosen triangles that share a side, two and two, each both ways round."""
    tails, heads = triangles[chosen].ravel(), triangles[chosen][:, NEXT].ravel()
    order, first = sort_pairs(tails, heads, int(triangles.max()) + 1)
    again = np.flatnonzero(~first)
    one, two = chosen[order[again - 1] // 3], chosen[order[again] // 3]
    return np.concatenate([one, two]), np.concatenate([two, one])
