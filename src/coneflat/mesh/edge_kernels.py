"""Compiled loops over half-edges: sorting them into edges, and joining their corners to fans."""

from __future__ import annotations

import numpy as np

from ..base.arrays import BoolArray, IntArray
from ..base.jit import compiled
from ..base.sets import number_trees, unite


@compiled
def ends_of_side(h: int) -> tuple[int, int]:
    """Return the start and end corner of a half-edge, like `end_corners`; remainders would take longer."""
    corner = h - 3 * (h // 3)
    return (h + 1 if corner < 2 else h - 2), (h + 2 if corner == 0 else h - 1)


# Up to this number, keys are sorted by insertion; more are sorted by merging, as quicksort is quadratic around vertices
# of high valence.
MAX_INSERTION_SORT = 64


@compiled
def sort_keys(keys: IntArray) -> None:
    """Sort distinct integers (k,) in place; fast if there are few (insertion sort, with gaps if there are more)."""
    gap = 1
    while MAX_INSERTION_SORT * gap < len(keys):
        gap = 3 * gap + 1
    while gap > 0:
        for at in range(gap, len(keys)):
            key, before = keys[at], at - gap
            while before >= 0 and keys[before] > key:
                keys[before + gap] = keys[before]
                before -= gap
            keys[before + gap] = key
        gap //= 3


@compiled
def label_fans(corners: IntArray, halfedges: IntArray, partners: IntArray) -> tuple[int, IntArray]:
    """Return the result of `corner_fans` for (3m,) the vertex at each corner."""
    parent = np.arange(len(corners))
    for k in range(len(halfedges)):
        start, end = ends_of_side(halfedges[k])
        partner_start, partner_end = ends_of_side(partners[k])
        if corners[start] != corners[partner_end]:  # the faces have different orientations
            partner_start, partner_end = partner_end, partner_start
        unite(parent, start, partner_end)
        unite(parent, end, partner_start)
    return number_trees(parent), parent


@compiled
def order_pairs(tails: IntArray, heads: IntArray, bound: int) -> tuple[IntArray, BoolArray]:
    """Return the result of `sort_pairs`: pairs are counted by their smaller index, then sorted by the larger one."""
    starts = np.zeros(bound + 1, np.int64)
    for k in range(len(tails)):
        starts[min(tails[k], heads[k]) + 1] += 1
    for v in range(bound):
        starts[v + 1] += starts[v]
    # The high 32 bits of a key are the larger index, the low ones the number of the pair.
    keys, place = np.empty(len(tails), np.int64), starts.copy()
    for k in range(len(tails)):
        low, high = min(tails[k], heads[k]), max(tails[k], heads[k])
        keys[place[low]] = (high << 32) | k
        place[low] += 1
    is_first = np.empty(len(tails), np.bool_)
    for v in range(bound):
        sort_keys(keys[starts[v] : starts[v + 1]])
        before = -1
        for at in range(starts[v], starts[v + 1]):
            high = keys[at] >> 32
            is_first[at] = high != before
            before = high
            keys[at] &= 0xFFFFFFFF
    return keys, is_first


@compiled
def number_edges(
    tails: IntArray, heads: IntArray, order: IntArray, is_first: BoolArray
) -> tuple[IntArray, IntArray, IntArray]:
    """Return edges as vertex pairs (e, 2), the edge of each half-edge (h,), and the half-edges of each edge (e, 2).

    Args:
        tails, heads: (h,) ends of the half-edges.
        order, is_first: (h,) half-edges by edge, and whether each is the first of its edge, see `sort_pairs`.
    """
    count = 0
    for at in range(len(order)):
        count += is_first[at]
    pairs, edge_of, sides = (
        np.empty((count, 2), np.int64),
        np.empty(len(order), np.int64),
        np.empty((count, 2), np.int64),
    )
    edge = -1
    for at in range(len(order)):
        h = order[at]
        if is_first[at]:
            edge += 1
            pairs[edge, 0], pairs[edge, 1] = min(tails[h], heads[h]), max(tails[h], heads[h])
            sides[edge, 0], sides[edge, 1] = h, -1
        else:
            sides[edge, 1] = h
        edge_of[h] = edge
    return pairs, edge_of, sides
