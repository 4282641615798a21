"""The connected pieces of an overlap."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray, IntArray
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
    count, label = _label_ordered(pairs, triangles)
    order = sort_by_counting(label, count)
    regions = np.split(order, np.cumsum(np.bincount(label, minlength=count))[:-1])
    # An odd one is the same region in the other order.
    return [_layers(pairs, members) for members in regions if members[0] % 2 == 0]


def largest_layers(pairs: IntArray, triangles: IntArray, areas: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the layers of the region of which the smaller layer has the most area.

    areas: (m,) of the triangles.
    """
    count, label = _label_ordered(pairs, triangles)
    kept, moved = pairs.ravel(), pairs[:, ::-1].ravel()
    layers = [np.unique(label * len(areas) + side) for side in (kept, moved)]
    sizes = [np.bincount(one // len(areas), areas[one % len(areas)], count) for one in layers]
    size = np.minimum(*sizes)
    _, first = np.unique(label, return_index=True)
    wound = np.unique(layers[0][np.isin(layers[0], layers[1])] // len(areas))
    size[wound] = np.minimum(areas[kept], areas[moved])[first[wound]]
    size[first % 2 == 1] = -1.0
    return _layers(pairs, np.flatnonzero(label == np.argmax(size)))


def _label_ordered(pairs: IntArray, triangles: IntArray) -> tuple[int, IntArray]:
    """Return how many parts the pairs form, each in both orders, and the part of each; numbered as in `_steps`.

    Which triangle is in which layer goes on with the overlap: a region has two parts, one in the other order, unless
    it is wound up.
    """
    source, place = _steps(pairs, triangles)
    return label_components(
        2 * len(pairs), np.concatenate([source, source ^ 1]), np.concatenate([place, place ^ 1])
    )


def _layers(pairs: IntArray, members: IntArray) -> tuple[IntArray, IntArray]:
    """Return the first and second triangles of pairs, numbered as in `_steps`; of one pair if they share any."""
    kept, moved = pairs.ravel()[members], pairs.ravel()[members ^ 1]
    one, other = np.unique(kept), np.unique(moved)
    return (kept[:1], moved[:1]) if len(np.intersect1d(one, other)) else (one, other)


def _steps(pairs: IntArray, triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Return between which pairs an overlap goes on when its second triangle gives way to a neighbour.

    Pair i is numbered 2i as it stands and 2i + 1 in the other order.
    """
    if not len(pairs):
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    count = len(triangles)
    one, two = _neighbours(np.unique(pairs), triangles)
    two = two[sort_by_counting(one, count)]
    degree = np.bincount(one, minlength=count)
    starts = np.cumsum(degree) - degree
    # Every pair in both orders; the second triangle goes to each of its neighbours.
    kept, moved = pairs.ravel(), pairs[:, ::-1].ravel()
    first, degree = starts[moved], degree[moved]
    source = np.repeat(np.arange(len(moved)), degree)
    step = np.arange(len(source)) - np.repeat(np.cumsum(degree) - degree - first, degree)
    kept, moved = kept[source], two[step]
    keys = pairs[:, 0] * count + pairs[:, 1]
    wanted = np.minimum(kept, moved) * count + np.maximum(kept, moved)
    place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    found = keys[place] == wanted
    return source[found], 2 * place[found] + (kept > moved)[found]


def _neighbours(chosen: IntArray, triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Return the chosen triangles that share a side, two and two, each in both orders."""
    tails, heads = triangles[chosen].ravel(), triangles[chosen][:, NEXT].ravel()
    order, first = sort_pairs(tails, heads, int(triangles.max()) + 1)
    again = np.flatnonzero(~first)
    one, two = chosen[order[again - 1] // 3], chosen[order[again] // 3]
    return np.concatenate([one, two]), np.concatenate([two, one])
