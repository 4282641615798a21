"""Edge flips towards vertices of small degree, compiled."""

from __future__ import annotations

import math

from .._arrays import FloatArray, IntArray
from .compiled import compiled
from .flip_kernel import euclidean_diagonal, relink

# Radians that a quad's corners must be short of straight for its edge to be flipped.
LEAST_ROOM = 1e-3


@compiled
def angle_opposite(a: float, b: float, c: float) -> float:
    """Return the angle opposite the side a of a triangle."""
    above = (a - b + c) * (a + b - c)
    below = (a + b + c) * (b + c - a)
    return 2 * math.atan2(math.sqrt(max(above, 0.0)), math.sqrt(max(below, 0.0)))


@compiled
def room_to_flip(length: FloatArray, h: int, t: int) -> float:
    """Return by how much the corners at the ends of an edge, t its twin, are short of straight; the lesser."""
    h1 = h - h % 3 + (h + 1) % 3
    h2 = h - h % 3 + (h + 2) % 3
    t1 = t - t % 3 + (t + 1) % 3
    t2 = t - t % 3 + (t + 2) % 3
    at_tail = angle_opposite(length[h1], length[h], length[h2]) + angle_opposite(
        length[t2], length[t], length[t1]
    )
    at_head = angle_opposite(length[h2], length[h], length[h1]) + angle_opposite(
        length[t1], length[t], length[t2]
    )
    return math.pi - max(at_tail, at_head)


@compiled
def edge_to_flip(
    twin: IntArray, tail: IntArray, length: FloatArray, degree: IntArray, wanted: IntArray, vertex: int
) -> int:
    """Return the half-edge opposite a vertex that has most room to be flipped towards it, -1 if none has enough.

    The ends of the edge are not to fall below the degree that they want.
    """
    best, most = -1, LEAST_ROOM
    for spoke in range(len(tail)):
        if tail[spoke] != vertex:
            continue
        h = spoke - spoke % 3 + (spoke + 1) % 3
        t = twin[h]
        if t < 0 or t // 3 == h // 3:
            continue
        u, v = tail[h], tail[t]
        if u == v or degree[u] <= wanted[u] or degree[v] <= wanted[v]:
            continue
        room = room_to_flip(length, h, t)
        if room > most:
            best, most = h, room
    return best


@compiled
def raise_degrees(
    twin: IntArray,
    tail: IntArray,
    length: FloatArray,
    degree: IntArray,
    wanted: IntArray,
    record: IntArray,
) -> int:
    """Flip edges towards vertices until they have the degree that they want, if they can; return the number of flips.

    record: room for the half-edges flipped, in order; as many flips as fit are made at most.
    """
    count = 0
    for vertex in range(len(degree)):
        while degree[vertex] < wanted[vertex] and count < len(record):
            h = edge_to_flip(twin, tail, length, degree, wanted, vertex)
            if h < 0:
                break
            t = twin[h]
            h1 = h - h % 3 + (h + 1) % 3
            h2 = h - h % 3 + (h + 2) % 3
            t1 = t - t % 3 + (t + 1) % 3
            t2 = t - t % 3 + (t + 2) % 3
            degree[tail[h]] -= 1
            degree[tail[t]] -= 1
            degree[tail[h2]] += 1
            degree[tail[t2]] += 1
            diagonal = euclidean_diagonal(length[h], length[h2], length[h1], length[t1], length[t2])
            relink(twin, tail, length, h, diagonal)
            record[count] = h
            count += 1
    return count
