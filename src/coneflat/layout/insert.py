"""Flips that bring the edges of a mesh back into a flat triangulation, as far as they are straight there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import ComplexArray, FloatArray, IntArray
from ..compiled import compiled
from ..geometry.delaunay import relink
from ..geometry.intrinsic import IntrinsicTriangulation
from ..geometry.straight import find_turns, place_triangles
from .overlay import corner_counts, count_crossings, first_beside, flipped_crossings, next_around

# Height over longest side that triangles must have after a flip: far above rounding, and above what counts as
# degenerate.
LEAST_HEIGHT = 1e-7
# Flips tried to put in an edge that crosses k others, for each of them and beside: it takes about one for each.
FLIPS_PER_CROSSING, MORE_FLIPS = 4, 20
# Rounds of putting in all straight edges and saving crossings; what one round leaves, the next seldom gets.
ROUNDS = 3


@dataclass(frozen=True, eq=False)
class FlatTriangulation:
    """A triangulation of a flat surface, each triangle in a frame of its own.

    Attributes:
        triangulation: it, with its lengths.
        sides: (3m,) half-edges as vectors in the frames of their triangles.
        turns: (3m,) unit numbers: a vector in the frame of a half-edge's twin, times this, is that in its own.
        flips: half-edges flipped on the way from the input's triangles, in order.
    """

    triangulation: IntrinsicTriangulation
    sides: ComplexArray
    turns: ComplexArray
    flips: IntArray


def insert_edges(
    source: IntrinsicTriangulation, flat: IntrinsicTriangulation, flips: IntArray
) -> FlatTriangulation:
    """Return a triangulation of the flat surface that has the input's edges, where they are straight, for edges.

    Of all ways to draw an edge of the input on the flat surface that lead past the same vertices on the same sides,
    one is shortest. If it touches no vertex on its way, it is a straight segment, and such segments do not cross
    each other, so one triangulation has them all. Flips of convex quads that save crossings lead towards it; where
    they come to a standstill, segments are put in one by one. Edges of the input that bend around vertices stay
    crossed.

    Args:
        source: the input's triangles; its lengths are not used.
        flat: flat triangles on the same vertices; left as it is.
        flips: half-edges flipped between the two, in order.

    Raises:
        MetricError: the flips do not lead from one to the other.

    Notes:
        M. Gillespie, N. Sharp, K. Crane, "Integer coordinates for intrinsic geometry processing", 2021 (what crosses
        what); S. Sloan, "A fast algorithm for generating constrained Delaunay triangulations", 1993 (putting in).
    """
    changed = flat.copy()
    sides, turns = np.empty((2, len(flat.twin)), dtype=np.complex128)
    place_triangles(flat.length, sides)
    find_turns(flat.twin, sides, turns)
    counts, first = count_crossings(source, flat, flips)
    arrays = changed.twin, changed.tail, changed.length, sides, turns, counts, first
    done = [flips]
    for _ in range(ROUNDS):
        record = np.empty(int(np.maximum(counts, 0).sum()) // 2, dtype=np.int64)
        done.append(record[: save_crossings(source.twin, *arrays, record)])
        # The edges that are crossed still, by their input half-edges.
        lost = np.ones(len(counts), dtype=bool)
        lost[first[counts < 0]] = False
        edges = np.flatnonzero(lost & (source.twin > np.arange(len(counts))))
        record = np.empty(
            (FLIPS_PER_CROSSING * int(np.maximum(counts, 0).sum()) + MORE_FLIPS), dtype=np.int64
        )
        done.append(record[: put_in_straight(source.twin, source.tail, edges, *arrays, record)])
        if not len(done[-1]):
            break
    return FlatTriangulation(changed, sides, turns, np.concatenate(done))


@compiled
def height(one: complex, two: complex) -> float:
    """Return the height over the longest side of the triangle with two sides that follow each other."""
    three = one + two
    longest = max(one.real**2 + one.imag**2, two.real**2 + two.imag**2, three.real**2 + three.imag**2)
    return (one.real * two.imag - one.imag * two.real) / longest if longest > 0 else 0.0


@compiled
def is_convex(twin: IntArray, sides: ComplexArray, turns: ComplexArray, h: int) -> bool:
    """Return whether the quad around an edge is convex, so that its other diagonal makes triangles with area."""
    t = twin[h]
    if t < 0 or t // 3 == h // 3:
        return False
    h1, h2 = h - h % 3 + (h + 1) % 3, h - h % 3 + (h + 2) % 3
    t1, t2 = t - t % 3 + (t + 1) % 3, t - t % 3 + (t + 2) % 3
    before = height(sides[h2], sides[t1] * turns[h])
    after = height(sides[t2] * turns[h], sides[h1])
    return min(before, after) > LEAST_HEIGHT


@compiled
def flip(
    given_twin: IntArray,
    twin: IntArray,
    tail: IntArray,
    length: FloatArray,
    sides: ComplexArray,
    turns: ComplexArray,
    counts: IntArray,
    first: IntArray,
    h: int,
) -> None:
    """Turn an edge counterclockwise in its quad, with the frames and the crossings; see `overlay.replay_flips`."""
    t = twin[h]
    h1, h2 = h - h % 3 + (h + 1) % 3, h - h % 3 + (h + 2) % 3
    t1, t2 = t - t % 3 + (t + 1) % 3, t - t % 3 + (t + 2) % 3
    turn = turns[h]
    # The sides h2, t1, t2, h1 move to the slots h1, h2, t1, t2; the second and the last change their frames.
    old, new = (h2, t1, t2, h1), (h1, h2, t1, t2)
    into = (1.0 + 0.0j, turn, 1.0 + 0.0j, turn.conjugate())
    moved = (sides[h2], sides[t1] * into[1], sides[t2], sides[h1] * into[3])
    twins = (twin[h2], twin[t1], twin[t2], twin[h1])
    outer = (turns[h2], turns[t1], turns[t2], turns[h1])
    crossed = (counts[h2], counts[t1], counts[t2], counts[h1])
    firsts = (first[h2], first[t1], first[t2], first[h1])
    count = flipped_crossings(counts, h, t)
    diagonal = moved[0] + moved[1]
    relink(twin, tail, length, h, abs(diagonal))
    for i in range(4):
        total = into[i] * outer[i]
        if twins[i] >= 0:
            for j in range(4):
                if twins[i] == old[j]:
                    total *= into[j].conjugate()
            total /= abs(total)
            turns[twin[new[i]]] = total.conjugate()
        else:
            total = 1.0 + 0.0j
        turns[new[i]] = total
        sides[new[i]] = moved[i]
        counts[new[i]] = crossed[i]
        first[new[i]] = firsts[i]
    sides[h] = -diagonal
    sides[t] = diagonal * turn.conjugate()
    turns[h], turns[t] = turn, turn.conjugate()
    counts[h] = counts[t] = count
    for one, before in ((t, h1), (h, t1)):
        first[one] = first_beside(given_twin, counts, first, before)


@compiled
def save_crossings(
    given_twin: IntArray,
    twin: IntArray,
    tail: IntArray,
    length: FloatArray,
    sides: ComplexArray,
    turns: ComplexArray,
    counts: IntArray,
    first: IntArray,
    record: IntArray,
) -> int:
    """Flip edges while that saves crossings; return the number of flips, which are written to `record`."""
    stack = np.empty(len(twin), dtype=np.int64)
    queued = np.zeros(len(twin), dtype=np.bool_)
    top = 0
    for h in range(len(twin)):
        if twin[h] > h and counts[h] > 0:
            stack[top] = h
            queued[h] = True
            top += 1
    done = 0
    while top > 0:
        top -= 1
        h = stack[top]
        queued[h] = False
        if counts[h] <= 0 or not is_convex(twin, sides, turns, h):
            continue
        if flipped_crossings(counts, h, twin[h]) >= counts[h]:
            continue
        flip(given_twin, twin, tail, length, sides, turns, counts, first, h)
        record[done] = h
        done += 1
        for side in (h, twin[h]):
            for k in range(1, 3):
                near = side - side % 3 + (side + k) % 3
                near = max(near, twin[near])
                if counts[near] > 0 and twin[near] >= 0 and not queued[near] and not queued[twin[near]]:
                    queued[near] = True
                    stack[top] = near
                    top += 1
        if counts[h] > 0 and not queued[h]:
            queued[h] = True
            stack[top] = h
            top += 1
    return done


@compiled
def find_start(
    given_twin: IntArray, twin: IntArray, counts: IntArray, first: IntArray, out: int, edge: int
) -> tuple[int, int]:
    """Return the half-edge that an input edge crosses first, and its place there; -1 if it is no longer crossed.

    out: a half-edge of the triangulation that starts from the vertex that the input half-edge `edge` starts from.
    """
    h = out
    while twin[h] >= 0:  # to the first around a vertex of the boundary
        t = twin[h]
        h = t - t % 3 + (t + 1) % 3
        if h == out:
            break
    start = h
    while True:
        base, i = h - h % 3, (h + 1) % 3
        cut, _ = corner_counts(counts, base, (i + 1) % 3)
        _, starting = corner_counts(counts, base, i)
        at = first[h]
        if counts[h] < 0:
            if at == edge:
                return -1, -1
            at = next_around(given_twin, at)
        for k in range(starting):
            if at == edge:
                return base + i, cut + k
            at = next_around(given_twin, at)
        h = next_around(twin, h)
        if h < 0 or h == start:
            return -1, -1


@compiled
def turn_between(one: complex, two: complex) -> float:
    """Return the sine from one vector to another."""
    return (one.real * two.imag - one.imag * two.real) / (abs(one) * abs(two))


@compiled
def trace(
    twin: IntArray,
    sides: ComplexArray,
    turns: ComplexArray,
    counts: IntArray,
    slot: int,
    place: int,
    crossed: IntArray,
    saves: IntArray,
) -> tuple[int, bool]:
    """Follow an input edge; return how many edges it crosses, and whether it is straight.

    Args:
        twin, sides, turns, counts: the triangulation.
        slot, place: the half-edge that it crosses first, opposite the corner that it starts from, and where.
        crossed: filled: the half-edges through which it leaves triangles.
        saves: filled: 1 where the other diagonal of the quad around does not cross it.
    """
    base = slot - slot % 3
    at_tail, at_head = sides[base + (slot + 2) % 3], -sides[base + (slot + 1) % 3]
    right, left = at_tail, at_head
    found, straight, side = 0, True, 0
    while found < len(crossed):
        crossed[found] = slot
        saves[found] = side
        b = twin[slot]
        along = counts[slot] - 1 - place
        base, j = b - b % 3, b % 3
        s, r = base + (j + 1) % 3, base + (j + 2) % 3
        turn = turns[b]
        at_tail, at_head, right, left = at_tail * turn, at_head * turn, right * turn, left * turn
        apex = at_head - sides[r]
        cut, _ = corner_counts(counts, base, (j + 1) % 3)
        _, ending = corner_counts(counts, base, j)
        if along < cut:  # it passes the apex on its left
            slot, place, ahead = r, counts[r] - 1 - along, -1
            at_tail = apex
            if turn_between(right, apex) > 0:
                right = apex
        elif along < cut + ending:
            saves[found] = 1
            is_inside = min(turn_between(right, apex), turn_between(apex, left)) > LEAST_HEIGHT
            return found + 1, straight and is_inside
        else:
            slot, place, ahead = s, counts[b] - 1 - along, 1
            at_head = apex
            if turn_between(apex, left) > 0:
                left = apex
        straight = straight and turn_between(right, left) > 0
        # The other diagonal joins the corners before and after: they are on the same side of the edge, or not.
        saves[found] = 1 if saves[found] == 0 or saves[found] == ahead else 0
        found += 1
        side = ahead
    return found, False


@compiled
def put_in_straight(
    given_twin: IntArray,
    given_tail: IntArray,
    edges: IntArray,
    twin: IntArray,
    tail: IntArray,
    length: FloatArray,
    sides: ComplexArray,
    turns: ComplexArray,
    counts: IntArray,
    first: IntArray,
    record: IntArray,
) -> int:
    """Put in the straight ones of some input edges; return the number of flips, which are written to `record`."""
    out = np.empty(tail.max() + 1, dtype=np.int64)
    for h in range(len(tail)):
        out[tail[h]] = h
    crossed, saves = np.empty(len(twin), dtype=np.int64), np.empty(len(twin), dtype=np.int64)
    done = 0
    for edge in edges:
        left = -1
        while left != 0 and done < len(record):
            slot, place = find_start(given_twin, twin, counts, first, out[given_tail[edge]], edge)
            if slot < 0:
                break
            found, straight = trace(twin, sides, turns, counts, slot, place, crossed, saves)
            if not straight:
                break
            if left < 0:
                left = FLIPS_PER_CROSSING * found + MORE_FLIPS
            chosen = -1
            for k in range(found):
                # From another end each time, so that the same edge is not turned back and forth.
                i = (k + left) % found
                if is_convex(twin, sides, turns, crossed[i]):
                    chosen = crossed[i]
                    if saves[i] == 1:
                        break
            if chosen < 0:
                break
            flip(given_twin, twin, tail, length, sides, turns, counts, first, chosen)
            record[done] = chosen
            done += 1
            left -= 1
            for h in (chosen, twin[chosen]):
                for k in range(3):
                    s = h - h % 3 + k
                    out[tail[s]] = s
    return done
