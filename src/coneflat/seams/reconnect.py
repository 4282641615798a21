"""The shortest tree that connects parts of the border of a mesh that is cut open, compiled.

S. Dreyfus and R. Wagner, "The Steiner problem in graphs", 1971. A set of terminals is a binary number; the last of the
terminals is in none: it is what the tree of all others is led to. What belongs to the set s is in row s - 1.
"""

from __future__ import annotations

import math

import numpy as np

from .._arrays import BoolArray, FloatArray, Int32Array, IntArray
from ..compiled import compiled
from .shortest_paths import search

# What a piece of a tree is led to: a terminal, a terminal at which it falls apart, or a vertex off the border.
TERMINAL, FORK, VERTEX = 0, 1, 2


@compiled
def shortest_tree(
    starts: IntArray,
    heads: Int32Array,
    costs: FloatArray,
    enters: Int32Array,
    slots: IntArray,
    slot_of: IntArray,
    tail: IntArray,
    cut: BoolArray,
    number: IntArray,
    around: IntArray,
    bounds: IntArray,
    ends: IntArray,
    arms: FloatArray,
    limit: float,
    height: FloatArray,
    distance: FloatArray,
    before: Int32Array,
    origin: Int32Array,
    reached: Int32Array,
    keys: FloatArray,
    items: Int32Array,
) -> tuple[IntArray, int]:
    """Return the half-edges of the shortest tree that connects terminals, none if none costs less than a limit.

    And how many vertices were reached. The graph and what a search fills is that of `shortest_paths.search`, a row for
    each set of terminals but the last; distances are left infinite.

    Args:
        starts, heads, costs, enters: of the slots.
        slots, slot_of: the half-edge of each slot, and the slot of each half-edge.
        tail, cut: (3m,) the vertex that each half-edge leaves, and whether it is of the border.
        number: (3m,) the terminal that each half-edge leaves.
        around, bounds: the half-edges that leave terminals, and where those of each begin.
        ends: (k,) the terminals.
        arms: (k,) no other terminal is nearer to each.
        limit: of what the tree costs.
        height: (n,) lower bounds of what the path from each vertex to the border costs.
        distance, before, origin, reached: (2^(k - 1) - 1, n), distances infinite.
        keys, items: of a heap.
    """
    last_end, everything = ends[-1], 2 ** (len(ends) - 1) - 1
    terminals = len(bounds) - 1
    arrival, merged = np.full((everything, terminals), np.inf), np.full((everything, terminals), np.inf)
    value, last = np.empty((everything, terminals)), np.full((everything, terminals), -1)
    counts = np.zeros(everything, np.int64)
    for some in range(1, everything + 1):
        row = some - 1
        for h in around:
            distance[row, tail[h]] = -1.0
        inner, inner_costs = _merge(some, counts, reached, distance, value, merged)
        if some & (some - 1) == 0:
            merged[row, ends[int(math.log2(some) + 0.5)]] = 0.0
        target, farthest = -1, math.inf
        if some == everything:
            target, most = last_end, min(limit, merged[row, last_end])
        else:
            most, farthest = _limits(some, arms, limit)
        seeds, seed_costs, seed_origins = _seeds(
            ends, merged[row], limit, around, bounds, cut, slot_of, number
        )
        counts[row] = search(
            starts, heads, costs, enters, seeds, seed_costs, seed_origins, inner, inner_costs, height, target,
            most, farthest, distance[row], before[row], origin[row], reached[row], arrival[row], last[row],
            keys, items,
        )  # fmt: skip
        value[row] = np.minimum(merged[row], arrival[row])
    tree = np.empty(0, np.int64)
    if value[everything - 1, last_end] < limit:
        tree = _collect(last_end, slots, tail, number, distance, before, arrival, value, merged, last)
    for row in range(everything):
        distance[row][reached[row, : counts[row]]] = math.inf
        distance[row][tail[around]] = math.inf
    return tree, counts.sum()


@compiled
def _merge(
    some: int,
    counts: IntArray,
    reached: Int32Array,
    distance: FloatArray,
    value: FloatArray,
    merged: FloatArray,
) -> tuple[IntArray, FloatArray]:
    """Return where trees of two sets that make up `some` meet off the border, and what both cost; fill `merged`."""
    size = 0
    for one in range(1, some):
        if one & ~some == 0 and one < some ^ one:
            size += counts[one - 1]
    inner, costs = np.empty(size, np.int64), np.empty(size)
    count = 0
    for one in range(1, some):
        two = some ^ one
        if one & ~some != 0 or one > two:
            continue
        merged[some - 1] = np.minimum(merged[some - 1], value[one - 1] + value[two - 1])
        for v in reached[one - 1, : counts[one - 1]]:
            if distance[two - 1, v] < math.inf:
                inner[count] = v
                costs[count] = distance[one - 1, v] + distance[two - 1, v]
                count += 1
    return inner[:count], costs[:count]


@compiled
def _limits(some: int, arms: FloatArray, limit: float) -> tuple[float, float]:
    """Return limits of the distance and height, and of the distance: what the other terminals leave of the whole.

    A tree costs at least half of a path around it. One around a vertex and the others is made up of paths between
    some of these and two more, neither of which costs less than the height. No seam is shorter if replaced alone, or
    nearly so: terminals are apart at least as far as their arms are long.
    """
    others = np.array([arms[i] for i in range(len(arms)) if not some >> i & 1])
    between = np.sort(
        np.array([max(others[i], others[j]) for i in range(len(others)) for j in range(i + 1, len(others))])
    )
    most = between.max() if len(between) else 0.0
    if len(others) == 3:
        most = max(most, between.sum() / 2)
    return limit - between[: len(others) - 1].sum() / 2, limit - most


@compiled
def _seeds(
    ends: IntArray,
    merged: FloatArray,
    limit: float,
    around: IntArray,
    bounds: IntArray,
    cut: BoolArray,
    slot_of: IntArray,
    number: IntArray,
) -> tuple[IntArray, FloatArray, IntArray]:
    """Return the slots at which a search begins, which leave terminals that trees reach, their costs and names."""
    size = 0
    for end in ends[:-1]:
        size += bounds[end + 1] - bounds[end] if merged[end] < limit else 0
    seeds, costs, origins = np.empty(size, np.int64), np.empty(size), np.empty(size, np.int64)
    count = 0
    for end in ends[:-1]:
        if merged[end] < limit:
            for h in around[bounds[end] : bounds[end + 1]]:
                if not cut[h]:
                    seeds[count], costs[count], origins[count] = slot_of[h], merged[end], number[h]
                    count += 1
    return seeds[:count], costs[:count], origins[:count]


@compiled
def _collect(
    terminal: int,
    slots: IntArray,
    tail: IntArray,
    number: IntArray,
    distance: FloatArray,
    before: Int32Array,
    arrival: FloatArray,
    value: FloatArray,
    merged: FloatArray,
    last: IntArray,
) -> IntArray:
    """Return the half-edges of the tree of all terminals that leads to one of them."""
    waiting = [(len(value), TERMINAL, terminal)]
    found = [np.int64(0) for _ in range(0)]
    while len(waiting) > 0:
        some, kind, place = waiting.pop()
        row, slot = some - 1, -1
        if kind == TERMINAL and arrival[row, place] < merged[row, place]:
            slot = last[row, place]
        elif kind == VERTEX:
            slot = before[row, place]
        if slot >= 0:
            v = place
            while slot >= 0:
                h = slots[slot]
                found.append(h)
                v = tail[h]
                if distance[row, v] < 0:
                    waiting.append((some, FORK, number[h]))
                    break
                slot = before[row, v]
            if slot < 0:
                waiting.append((some, VERTEX, v))
            continue
        best, one = math.inf, 0
        for part in range(1, some):
            other = some ^ part
            if part & ~some != 0 or part > other:
                continue
            if kind == VERTEX:
                both = distance[part - 1, place] + distance[other - 1, place]
            else:
                both = value[part - 1, place] + value[other - 1, place]
            if both < best:
                best, one = both, part
        if one > 0:
            kind = VERTEX if kind == VERTEX else TERMINAL
            waiting.append((one, kind, place))
            waiting.append((some ^ one, kind, place))
    return np.unique(np.array(found))
