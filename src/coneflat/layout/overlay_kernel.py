"""How the edges of a flipped triangulation cross those it had before the flips, compiled.

Both are arcs between the same vertices, pulled tight: an edge of the one triangulation either is one of the other,
or crosses some of its edges, and none of them twice in a row. Within a triangle, pieces of the given edges,
those before the flips, cut off corners or run from a corner to the side opposite. So the numbers of
crossings on the sides, their normal coordinates, say which pieces there are, and a flip changes one of these
numbers only (Gillespie, Sharp, Crane, "Integer coordinates for intrinsic geometry processing", 2021).
An edge that is one of the given has the number -1; 0 does not occur, since an arc that crosses no edge of a
triangulation is one of its edges.
"""

from __future__ import annotations

from .._arrays import FloatArray, IntArray
from ..geometry.compiled import compiled
from ..geometry.flip_kernel import relink


@compiled
def corner_counts(counts: IntArray, base: int, i: int) -> tuple[int, int]:
    """Return how many pieces of given edges cut off corner i of a triangle, and how many start from it."""
    a = max(counts[base + i], 0)
    b = max(counts[base + (i + 1) % 3], 0)
    c = max(counts[base + (i + 2) % 3], 0)
    from_others = max(0, b - a - c) + max(0, c - a - b)
    return (max(0, b + c - a) - from_others) // 2, max(0, a - b - c)


@compiled
def flipped_crossings(counts: IntArray, h: int, t: int) -> int:
    """Return the number of crossings on the other diagonal of the quad around the edge with half-edges h, t.

    The edge runs from u to v, its other diagonal joins the corners p and q.
    """
    base, i, other, j = h - h % 3, h % 3, t - t % 3, t % 3
    cut_p, _ = corner_counts(counts, base, i)
    cut_u, from_u = corner_counts(counts, base, (i + 1) % 3)
    cut_v, from_v = corner_counts(counts, base, (i + 2) % 3)
    cut_q, _ = corner_counts(counts, other, j)
    cut_v2, from_v2 = corner_counts(counts, other, (j + 1) % 3)
    cut_u2, from_u2 = corner_counts(counts, other, (j + 2) % 3)
    on_edge = max(counts[h], 0)
    count = cut_p + cut_q + from_u + from_v + from_u2 + from_v2
    # Pieces across the edge that join opposite sides of the quad: the first cut_u on the edge come from the side
    # up, the last cut_v2 go to the side vq.
    count += max(0, cut_u + cut_v2 - on_edge) + max(0, cut_v + cut_u2 - on_edge)
    if counts[h] < 0:
        count += 1
    return count if count > 0 else -1


@compiled
def next_around(twin: IntArray, h: int) -> int:
    """Return the half-edge after h, counterclockwise around the vertex that h starts from; -1 past the last."""
    return twin[h - h % 3 + (h + 2) % 3]


@compiled
def replay_flips(
    given_twin: IntArray,
    twin: IntArray,
    tail: IntArray,
    length: FloatArray,
    flips: IntArray,
    counts: IntArray,
    first: IntArray,
) -> bool:
    """Flip the given triangulation, keeping count of the crossings with the given edges.

    Args:
        given_twin: twins before the flips.
        twin, tail, length: the triangulation, changed in place; the lengths are not looked at.
        flips: half-edges, in order.
        counts: number of crossings on the edge of each half-edge, changed in place; -1 for given edges.
        first: for each half-edge the given half-edge from the same vertex that is the same or the next
            one counterclockwise, changed in place; -1 stands for the last edge around a boundary vertex.

    Returns:
        False if a half-edge cannot be flipped.
    """
    for k in range(len(flips)):
        h = flips[k]
        t = twin[h]
        if t < 0 or t // 3 == h // 3:
            return False
        h1 = h - h % 3 + (h + 1) % 3
        h2 = h - h % 3 + (h + 2) % 3
        t1 = t - t % 3 + (t + 1) % 3
        t2 = t - t % 3 + (t + 2) % 3
        count = flipped_crossings(counts, h, t)
        moved = (counts[h2], counts[t1], counts[t2], counts[h1])
        firsts = (first[h2], first[t1], first[t2], first[h1])
        slots = relink(twin, tail, length, h, 1.0)
        for i in range(4):
            counts[slots[i]] = moved[i]
            first[slots[i]] = firsts[i]
        counts[h] = counts[t] = count
        # Now t runs from p to q with p -> u (slot h1) before it, h from q to p with q -> v (slot t1) before it.
        for new, before in ((t, h1), (h, t1)):
            _, steps = corner_counts(counts, before - before % 3, (before + 1) % 3)
            if counts[before] < 0:
                steps += 1
            start = first[before]
            for _ in range(steps):
                start = next_around(given_twin, start)
            first[new] = start
    return True


@compiled
def trace_edges(
    given_twin: IntArray,
    twin: IntArray,
    length: FloatArray,
    counts: IntArray,
    first: IntArray,
    touched: IntArray,
    offset: IntArray,
    number: IntArray,
    crossed: IntArray,
    leaving: IntArray,
    near: FloatArray,
    far: FloatArray,
) -> None:
    """Follow each given edge that is crossed from triangle to triangle.

    Crossings are numbered along one given edge after the other. On the way go the lambda lengths between an
    end of the given edge and the ends of the edges crossed: by Ptolemy's relation the one to the apex of the
    next triangle is a sum of products of positive numbers, so that none loses digits.

    Args:
        given_twin: twins before the flips.
        twin, length, counts, first: the triangulation with what `replay_flips` found out.
        touched: triangles with crossings on their sides.
        offset: for each half-edge, where the places of its edge begin in `number`.
        number: filled: the crossing at each place along each edge, counted from the tail of its half-edge
            of smaller index.
        crossed: filled: for each crossing the half-edge through which the given edge leaves a triangle.
        leaving: filled: the given half-edge that runs in this direction.
        near: filled: (x, 2) lambda lengths from its tail to tail and head of the half-edge crossed.
        far: filled: (x, 2) the same from its head.
    """
    found = 0
    for triangle in touched:
        for i in range(3):
            _, starting = corner_counts(counts, 3 * triangle, i)
            if starting == 0:
                continue
            before = 3 * triangle + (i + 2) % 3
            edge = first[before]
            if counts[before] < 0:
                edge = next_around(given_twin, edge)
            place, _ = corner_counts(counts, 3 * triangle, (i + 1) % 3)
            for _ in range(starting):
                if edge < given_twin[edge]:
                    start = found
                    found, last = _forth(
                        twin, length, counts, offset, 3 * triangle + i, place, found, number, crossed, near
                    )
                    _back(twin, length, crossed, last, start, found, far)
                    leaving[start:found] = edge
                edge = next_around(given_twin, edge)
                place += 1


@compiled
def _forth(
    twin: IntArray,
    length: FloatArray,
    counts: IntArray,
    offset: IntArray,
    slot: int,
    place: int,
    found: int,
    number: IntArray,
    crossed: IntArray,
    near: FloatArray,
) -> tuple[int, int]:
    """Follow a given edge from the apex over a half-edge to its end; return the crossings so far and the last
    half-edge, whose opposite corner is the end."""
    at_tail = length[slot - slot % 3 + (slot + 2) % 3]
    at_head = length[slot - slot % 3 + (slot + 1) % 3]
    while True:
        b = twin[slot]
        along = counts[slot] - 1 - place
        number[offset[slot] + (place if slot < b else along)] = found
        crossed[found] = slot
        near[found, 0] = at_tail
        near[found, 1] = at_head
        found += 1
        base, j = b - b % 3, b % 3
        s, r = base + (j + 1) % 3, base + (j + 2) % 3
        # b runs from corner j + 1, where the half-edge just crossed ends, to corner j + 2.
        apex = (length[s] * at_head + length[r] * at_tail) / length[b]
        cut, _ = corner_counts(counts, base, (j + 1) % 3)
        _, ending = corner_counts(counts, base, j)
        if along < cut:
            slot, place = r, counts[r] - 1 - along
            at_tail = apex
        elif along < cut + ending:
            return found, b
        else:
            slot, place = s, counts[b] - 1 - along
            at_head = apex
            # at_tail stays: corner j + 2 is the tail of both.


@compiled
def _back(
    twin: IntArray,
    length: FloatArray,
    crossed: IntArray,
    last: int,
    start: int,
    stop: int,
    far: FloatArray,
) -> None:
    """Go back along an given edge with the lambda lengths from its head."""
    at_tail = length[last - last % 3 + (last + 1) % 3]
    at_head = length[last - last % 3 + (last + 2) % 3]
    for x in range(stop - 1, start - 1, -1):
        far[x, 0] = at_tail
        far[x, 1] = at_head
        if x == start:
            break
        slot = crossed[x]
        base, i = slot - slot % 3, slot % 3
        apex = (length[base + (i + 1) % 3] * at_tail + length[base + (i + 2) % 3] * at_head) / length[slot]
        # The half-edge crossed before ends at corner j + 1 of this triangle and starts at corner j + 2.
        if twin[crossed[x - 1]] % 3 == (i + 1) % 3:
            at_head, at_tail = at_head, apex
        else:
            at_head, at_tail = apex, at_tail
