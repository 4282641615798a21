"""Borders of the pieces of a disk, and their splitting in time that depends on the size of the smaller pieces."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..base.arrays import BoolArray, IntArray
from ..base.jit import compiled
from ..base.sets import find_root, unite


@compiled
def walk_border(twins: IntArray, piece: IntArray, start: int) -> IntArray:
    """Return the half-edges on the border of a piece in order, beginning with `start`.

    twins: (3m,) the other half-edge of each edge, -1 on the boundary. piece: (m,) the piece of each triangle.
    """
    index, around = piece[start // 3], np.empty(0, np.int64)
    for is_storing in (False, True):  # the first pass counts them, the second stores them
        count, h = 0, start
        while count == 0 or h != start:
            if is_storing:
                around[count] = h
            count += 1
            h = h - h % 3 + (h + 1) % 3
            t = twins[h]
            while t >= 0 and piece[t // 3] == index:
                h = t - t % 3 + (t + 1) % 3
                t = twins[h]
        if not is_storing:
            around = np.empty(count, np.int64)
    return around


class GrowingSets(NamedTuple):
    """Sets of triangles that grow, each with a queue of those whose neighbours are still to be visited.

    Attributes:
        parent: (s,) the sets as a union-find forest: merged sets have one root.
        head, last: (s,) the first and last triangle in the queue of each root, -1 if the queue is empty.
        after: (m,) the next triangle in the queue.
        owner: (m,) the set to which each triangle was added, -1 for none.
        visited: (m,) the triangles in the order in which they were added.
        visited_count: (1,) their number.
    """

    parent: IntArray
    head: IntArray
    last: IntArray
    after: IntArray
    owner: IntArray
    visited: IntArray
    visited_count: IntArray


@compiled
def split_piece(
    twins: IntArray,
    piece: IntArray,
    index: int,
    cut: IntArray,
    owner: IntArray,
    is_cut: BoolArray,
    following: int,
    first: int,
) -> tuple[IntArray, IntArray, IntArray]:
    """Split a piece along edges; return the pieces, the first triangle of each, and a half-edge on the border of each.

    Sets of triangles grow from both sides of the edges, by one triangle each in turn, and are merged where they meet.
    When a single set still grows, it is the remainder and keeps the index of the piece, so it is not fully visited.

    Args:
        twins: (3m,) the other half-edge of each edge, -1 on the boundary.
        piece: (m,) the piece of each triangle, changed in place.
        index: the piece to split.
        cut: (k, 2) both half-edges of the edges, between triangles of the piece.
        owner, is_cut: (m,) -1 and (3m,) False, work arrays that are reset on return.
        following: index of the next new piece.
        first: a lower bound of the first triangle of the piece.
    """
    sets = seeded_sets(cut, owner)
    for i in range(2 * len(cut)):
        is_cut[cut[i // 2, i % 2]] = True
    remainder = grow_sets(sets, twins, piece, index, is_cut)
    ids, low = label_sets(sets, piece, index, remainder, following)
    while piece[first] != index:
        first += 1
    low[0] = first
    start = np.full(len(ids), -1)
    for i in range(2 * len(cut)):
        h, t = cut[i // 2, i % 2], cut[i // 2, 1 - i % 2]
        is_cut[h] = False
        if piece[h // 3] != piece[t // 3]:
            start[0 if piece[h // 3] == index else piece[h // 3] - following + 1] = h
    return ids, low, start


@compiled
def seeded_sets(cut: IntArray, owner: IntArray) -> GrowingSets:
    """Return a set for each half-edge of a cut (k, 2), with the triangle of this half-edge; sets of one are merged.

    owner: (m,) all -1; it becomes that of the sets.
    """
    count, triangles = 2 * len(cut), len(owner)
    parent, head, last = np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count, np.int64)
    for i in range(count):
        parent[i], head[i], last[i] = i, -1, -1
    after, visited = np.empty(triangles, np.int64), np.empty(triangles, np.int64)
    sets = GrowingSets(parent, head, last, after, owner, visited, np.zeros(1, np.int64))
    for i in range(count):
        add_triangle(sets, i, cut[i // 2, i % 2] // 3)
    return sets


@compiled
def grow_sets(sets: GrowingSets, twins: IntArray, piece: IntArray, index: int, is_cut: BoolArray) -> int:
    """Let sets grow until at most one of them still does; return the root of this one, -1 without sets.

    Arguments as of `split_piece`.
    """
    count = len(sets.parent)
    growing, remaining = np.empty(count, np.int64), count
    for i in range(count):
        growing[i] = i
    while remaining > 1:
        still = 0
        for at in range(remaining):
            i = growing[at]
            if sets.parent[i] != i or sets.head[i] < 0:
                continue
            growing[still] = i
            still += 1
            f = sets.head[i]
            sets.head[i] = sets.after[f]
            for h in range(3 * f, 3 * f + 3):
                if twins[h] >= 0 and not is_cut[h] and piece[twins[h] // 3] == index:
                    add_triangle(sets, i, twins[h] // 3)
        remaining = still
    return find_root(sets.parent, growing[0]) if count > 0 else -1


@compiled
def add_triangle(sets: GrowingSets, i: int, f: int) -> None:
    """Add triangle f to set i and to its queue, or merge the set with the one that has the triangle."""
    if sets.owner[f] >= 0:
        merge_sets(sets, i, sets.owner[f])
        return
    root = find_root(sets.parent, i)
    if sets.head[root] < 0:
        sets.head[root] = f
    else:
        sets.after[sets.last[root]] = f
    sets.last[root] = f
    sets.after[f] = -1
    sets.owner[f] = i
    sets.visited[sets.visited_count[0]] = f
    sets.visited_count[0] += 1


@compiled
def merge_sets(sets: GrowingSets, i: int, j: int) -> None:
    """Merge two sets and their queues of triangles."""
    first_root, second_root = find_root(sets.parent, i), find_root(sets.parent, j)
    if unite(sets.parent, first_root, second_root):
        remaining, absorbed = min(first_root, second_root), max(first_root, second_root)
        if sets.head[absorbed] >= 0:
            if sets.head[remaining] < 0:
                sets.head[remaining] = sets.head[absorbed]
            else:
                sets.after[sets.last[remaining]] = sets.head[absorbed]
            sets.last[remaining] = sets.last[absorbed]
            sets.head[absorbed] = -1


@compiled
def label_sets(
    sets: GrowingSets, piece: IntArray, index: int, remainder: int, following: int
) -> tuple[IntArray, IntArray]:
    """Make all sets but the remainder pieces; return (p,) the pieces, and (p,) the first triangle of each.

    The remainder keeps the index of the piece and is listed first; its first triangle is not known.

    Args:
        sets: the sets; their owners are reset.
        piece, index, following: as of `split_piece`.
        remainder: the root of the remainder.
    """
    count = len(sets.parent)
    number, ids, low = np.full(count, -1), np.full(count + 1, index), np.full(count + 1, len(piece))
    pieces = 1
    for i in range(sets.visited_count[0]):
        f = sets.visited[i]
        root = find_root(sets.parent, sets.owner[f])
        sets.owner[f] = -1
        if root == remainder:
            continue
        if number[root] < 0:
            number[root] = pieces
            ids[pieces] = following + pieces - 1
            pieces += 1
        piece[f] = ids[number[root]]
        low[number[root]] = min(low[number[root]], f)
    return ids[:pieces], low[:pieces]
