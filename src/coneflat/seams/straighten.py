"""Straighter seams: of paths that are almost equally short, those that turn less."""

from __future__ import annotations

import math

import numpy as np

from .._arrays import FloatArray, Int32Array, IntArray
from ..compiled import compiled
from ..geometry.graph import drop_first, push
from .key_paths import Fixed, KeyPaths, Parts, find_key_paths
from .open_mesh import OpenMesh

# What a zigzag that turns back by a right angle at every vertex adds to the length of a seam, so many times: a path
# without turns is preferred if it is longer by no more.
BENDING = 0.05


class Straightener:
    """The search for paths that turn little, with its arrays.

    Args:
        work: open, every piece of it a disk.
        bending: see BENDING.
    """

    def __init__(self, work: OpenMesh, bending: float) -> None:
        self.work, self.bending = work, bending
        sides, widest = len(work.tail), int(np.bincount(work.tail).max())
        self.value = np.full(sides, np.inf)
        self.before, self.reached = np.empty((2, sides), dtype=np.int64)
        self.spokes, self.angles = np.empty(widest + 1, dtype=np.int64), np.empty(widest + 2)

    def straighten(self, fixed: Fixed, enough: int) -> None:
        """Replace seams by straighter ones, each once, in place, up to an effort; the longest first."""
        seams = find_key_paths(self.work, fixed)
        changed: set[int] = set()
        for p in sorted(range(len(seams.paths)), key=lambda p: -seams.paths[p].cost):
            if self.work.effort < enough and p not in changed and len(seams.paths[p].halfedges) > 1:
                found = self._replace(seams, p)
                changed |= seams.touched_by([p], found)

    def _replace(self, seams: KeyPaths, p: int) -> IntArray:
        """Return the half-edges that are now cut in the place of a path."""
        path, gone = seams.paths[p], seams.with_loose_ends([p])
        parts = seams.take_away(gone) if len(gone) == 1 else None
        found = (
            self._straightest(parts, path.cost * (1 + 2 * self.bending))
            if parts is not None
            else path.halfedges
        )
        found = found if len(found) else path.halfedges
        self.work.cut_along(found)
        return found

    def _straightest(self, parts: Parts, limit: float) -> IntArray:
        """Return the half-edges of the best path between two terminals; none if that is not found within the limit."""
        work, terminals = self.work, parts.terminals
        near, far = parts.ends
        seeds = terminals.leaving(near)
        rest = work.search(terminals, seeds, np.zeros(len(seeds)), limit=limit)
        seeds = terminals.leaving(far)
        last, count = straightest(
            *(
                work.mesh.vertices,
                work.twin,
                work.tail,
                work.cost,
                terminals.number,
                seeds[~work.cut[seeds]],
                near,
            ),
            *(rest.distance, self.bending, self.value, self.before, self.reached, self.spokes, self.angles),
            *work.heap,
        )
        work.forget(terminals, rest)
        self.value[self.reached[:count]] = np.inf
        path = []
        while last >= 0:
            path.append(last)
            last = int(self.before[last])
        return np.array(path, dtype=np.int64)


@compiled
def angle_between(vertices: FloatArray, apex: int, one: int, two: int) -> float:
    """Return the angle at a vertex between the edges to two others, radians."""
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
    terminal: IntArray,
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
    items: Int32Array,
) -> tuple[int, int]:
    """Find the cheapest path from half-edges that leave a terminal to another terminal, when turning costs.

    A turn by an angle t, of a whole turn that is brought to 2 pi, costs bending * (1 - cos t) times the mean of the
    two edges. rest: (n,) the cost of the path from each vertex to the target without turning; infinite where not to go.
    value: (3m,) infinite; gets the cost up to the end of each half-edge reached. before: (3m,) the one it was reached
    from, -1 where the search began; reached: these half-edges. Returns the last half-edge, or -1, and how many were
    reached.
    """
    size = 0
    count = 0
    for h in seeds:
        u = tail[twin[h]]
        ahead = 0.0 if terminal[twin[h]] == target else rest[u]
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
        if terminal[back] == target:
            return h, count
        if key > value[h] + rest[tail[back]]:
            continue
        around = angles_around(vertices, twin, tail, back, spokes, angles)
        for i in range(1, around):
            k = spokes[i]
            u = tail[twin[k]]
            ahead = 0.0 if terminal[twin[k]] == target else rest[u]
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
