"""Shortest paths on the edges of a mesh that is cut open, compiled.

Nothing is glued to the triangle of a border half-edge: `cut` is True there. At a vertex on the border the half-edges
that leave it lie in sectors between those of the border; all sectors along one border curve are one terminal.
A path ends where it meets the border, so the terminals of the half-edges there are all one has to know, and no cut mesh
is made.
"""

from __future__ import annotations

import math

import numpy as np

from .._arrays import BoolArray, FloatArray, Int32Array, IntArray
from ..compiled import compiled
from ..geometry.graph import drop_first, push


@compiled
def label_terminals(
    twin: IntArray,
    leaving: IntArray,
    cut: BoolArray,
    points: IntArray,
    slot_of: IntArray,
    terminal: IntArray,
    around: IntArray,
    labelled: int,
    enters: Int32Array,
) -> IntArray:
    """Number the border curves, then the points on none of them; return where each of them begins in `around`.

    Args:
        twin, leaving, cut, slot_of: (3m,) of the half-edges, but (n,) a half-edge that leaves each vertex.
        points: vertices.
        terminal: (3m,) gets the number at each half-edge that leaves a curve or point, and -1 elsewhere.
        around: (3m,) gets these half-edges in order.
        labelled: how many there are of those that had a number before.
        enters: gets the number of the terminal that each slot enters, from those that leave it.
    """
    for h in around[:labelled]:
        terminal[h] = -1
    sides = np.flatnonzero(cut)
    starts = np.empty(len(sides) + len(points) + 1, np.int64)
    count = 0
    n = 0
    starts[0] = 0
    for k in range(len(sides) + len(points)):
        h = sides[k] if k < len(sides) else leaving[points[k - len(sides)]]
        if terminal[h] >= 0:
            continue
        while terminal[h] < 0:
            terminal[h] = count
            around[n] = h
            n += 1
            if twin[h] >= 0:
                enters[slot_of[twin[h]]] = count
            if not cut[h]:
                h = twin[h]
            h = h - h % 3 + (h + 1) % 3
        count += 1
        starts[count] = n
    return starts[: count + 1].copy()


@compiled
def search(
    starts: IntArray,
    heads: Int32Array,
    costs: FloatArray,
    enters: Int32Array,
    seeds: IntArray,
    seed_costs: FloatArray,
    seed_origins: IntArray,
    inner: IntArray,
    inner_costs: FloatArray,
    height: FloatArray,
    target: int,
    limit: float,
    farthest: float,
    distance: FloatArray,
    before: Int32Array,
    origin: Int32Array,
    reached: Int32Array,
    arrival: FloatArray,
    last: IntArray,
    keys: FloatArray,
    items: Int32Array,
) -> int:
    """Search the paths off the border in the order of distance plus height; return how many vertices were reached.

    Slots are half-edges sorted by tail: those of vertex v are starts[v] to starts[v + 1]; heads, costs: where they lead
    and what for; enters: the terminal that each enters, if any. The search begins along the slots `seeds`, and at the
    vertices `inner` off the border, at the costs given; origins are names for where. It ends at the terminal `target`,
    and leaves out where distance plus height is the limit and more, or distance the `farthest`. Heights are lower
    bounds of what is still to come; along an edge they fall by no more than its cost.

    distance: (n,) infinite off the border, and -1 on it; gets those of the vertices reached, which are listed in
    `reached`. before: (n,) the slot by which each was reached, -1 where the search began; origin: (n,) from where, -1
    for `inner`. arrival: infinite; gets the cost of the path to each terminal. last: its last slot.
    """
    size = 0
    count = 0
    for k in range(len(seeds)):
        if seed_costs[k] < limit:
            size = push(keys, items, size, seed_costs[k], -1 - k)
    for k in range(len(inner)):
        v, d = inner[k], inner_costs[k]
        if d + height[v] < limit and d < distance[v]:
            if distance[v] == math.inf:
                reached[count] = v
                count += 1
            distance[v] = d
            before[v] = -1
            origin[v] = -1
            size = push(keys, items, size, d + height[v], v)
    while size > 0:
        key, item = keys[0], items[0]
        if key >= limit:
            break
        size = drop_first(keys, items, size)
        if item < 0:
            slot = seeds[-1 - item]
            stop = slot + 1
            d = key
            source = seed_origins[-1 - item]
        elif key > distance[item] + height[item]:
            continue
        else:
            slot = starts[item]
            stop = starts[item + 1]
            d = distance[item]
            source = origin[item]
        for i in range(slot, stop):
            v = heads[i]
            e = d + costs[i]
            if e >= distance[v]:
                if distance[v] < 0 and e < arrival[enters[i]]:
                    arrival[enters[i]] = e
                    last[enters[i]] = i
                    if enters[i] == target and e < limit:
                        limit = e
            elif e + height[v] < limit and e < farthest:
                if distance[v] == math.inf:
                    reached[count] = v
                    count += 1
                distance[v] = e
                before[v] = i
                origin[v] = source
                size = push(keys, items, size, e + height[v], v)
    return count


@compiled
def find_between(
    edge_halfedges: IntArray,
    cut: BoolArray,
    twin: IntArray,
    tail: IntArray,
    number: IntArray,
    origin: Int32Array,
) -> tuple[IntArray, IntArray, IntArray]:
    """Return a half-edge of each edge off the border between the regions of two terminals, and these, (k,) each.

    number: (3m,) the terminal that each half-edge leaves, -1 if there is none: then it is in the region of `origin`, of
    the vertex (n,) that it leaves.
    """
    found = np.empty((3, len(edge_halfedges)), np.int64)
    count = 0
    for e in range(len(edge_halfedges)):
        h = edge_halfedges[e, 0]
        if cut[h]:
            continue
        t = twin[h]
        one = number[h] if number[h] >= 0 else origin[tail[h]]
        two = number[t] if number[t] >= 0 else origin[tail[t]]
        if one != two:
            found[0, count], found[1, count], found[2, count] = h, one, two
            count += 1
    return found[0, :count].copy(), found[1, :count].copy(), found[2, :count].copy()


@compiled
def sort_slots(twin: IntArray, tail: IntArray, starts: IntArray, slots: IntArray, slot_of: IntArray) -> None:
    """Sort the half-edges that have a twin by the vertex that they leave, (n + 1,) zeros at its start on entry.

    slots: filled: the half-edge of each slot. slot_of: (3m,) filled: the slot of each half-edge that has one.
    """
    for h in range(len(twin)):
        if twin[h] >= 0:
            starts[tail[h] + 1] += 1
    for v in range(len(starts) - 1):
        starts[v + 1] += starts[v]
    place = starts[:-1].copy()
    for h in range(len(twin)):
        if twin[h] >= 0:
            slot_of[h] = place[tail[h]]
            slots[slot_of[h]] = h
            place[tail[h]] += 1
