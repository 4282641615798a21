"""Cheapest ways on the edges of a mesh when turning costs, too, compiled."""

from __future__ import annotations

import math

from .._arrays import FloatArray, IntArray
from ..geometry.compiled import compiled
from .search_kernel import drop_first, push


@compiled
def angle_between(vertices: FloatArray, apex: int, one: int, two: int) -> float:
    """Return the angle at a vertex between the ways to two others, radians."""
    dot = 0.0
    first = 0.0
    second = 0.0
    for i in range(3):
        a, b = vertices[one, i] - vertices[apex, i], vertices[two, i] - vertices[apex, i]
        dot += a * b
        first += a * a
        second += b * b
    return math.atan2(math.sqrt(max(first * second - dot * dot, 0.0)), dot)


@compiled
def angles_around(
    vertices: FloatArray, twin: IntArray, tail: IntArray, h: int, spokes: IntArray, angles: FloatArray
) -> int:
    """Fill the half-edges that leave the vertex of h, from h on around it, and the angle from h to each.

    Returns how many there are; the angle after the last is that of the whole turn.
    """
    v = tail[h]
    count = 0
    angles[0] = 0.0
    k = h
    while True:
        spokes[count] = k
        t = twin[k]
        k = t - t % 3 + (t + 1) % 3
        angles[count + 1] = angles[count] + angle_between(vertices, v, tail[t], tail[twin[k]])
        count += 1
        if k == h:
            return count


@compiled
def straightest(
    vertices: FloatArray,
    twin: IntArray,
    tail: IntArray,
    cost: FloatArray,
    circle: IntArray,
    seeds: IntArray,
    target: int,
    rest: FloatArray,
    bending: float,
    value: FloatArray,
    before: IntArray,
    reached: IntArray,
    spokes: IntArray,
    angles: FloatArray,
    keys: FloatArray,
    items: IntArray,
) -> tuple[int, int]:
    """Find the cheapest way from half-edges that leave a circle to another circle, when turning costs.

    A turn by an angle t, of a whole turn that is brought to 2 pi, costs bending * (1 - cos t) times the mean of the
    two edges. rest: (n,) the cost of the way from each vertex to the target without turning; infinite where not to go.
    value: (3m,) infinite; gets the cost up to the end of each half-edge reached. before: (3m,) the one it was reached
    from, -1 where the search began; reached: these half-edges. Returns the last half-edge, or -1, and how many were
    reached.
    """
    size = 0
    count = 0
    for h in seeds:
        u = tail[twin[h]]
        ahead = 0.0 if circle[twin[h]] == target else rest[u]
        if 0 <= ahead < math.inf:
            value[h] = cost[h]
            before[h] = -1
            reached[count] = h
            count += 1
            size = push(keys, items, size, cost[h] + ahead, h)
    while size > 0:
        key, h = keys[0], items[0]
        size = drop_first(keys, items, size)
        back = twin[h]
        if circle[back] == target:
            return h, count
        if key > value[h] + rest[tail[back]]:
            continue
        around = angles_around(vertices, twin, tail, back, spokes, angles)
        for i in range(1, around):
            k = spokes[i]
            u = tail[twin[k]]
            ahead = 0.0 if circle[twin[k]] == target else rest[u]
            turn = 1.0 + math.cos(2 * math.pi * angles[i] / angles[around])
            e = value[h] + cost[k] + bending * turn * (cost[h] + cost[k]) / 2
            if 0 <= ahead < math.inf and e < value[k]:
                if value[k] == math.inf:
                    reached[count] = k
                    count += 1
                value[k] = e
                before[k] = h
                if size == len(keys):
                    return -1, count
                size = push(keys, items, size, e + ahead, k)
    return -1, count
