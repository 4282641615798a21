"""Where the edges of a mesh and those of a flipped triangulation of it cross."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import FloatArray, IntArray
from ..compiled import compiled
from ..errors import MetricError
from ..geometry.delaunay import relink
from ..geometry.intrinsic import IntrinsicTriangulation


@dataclass(frozen=True, eq=False)
class Overlay:
    """A triangulation and its flipped edges, drawn tight: x crossings. Flat half-edges are those after the flips.

    Attributes:
        counts: (3m,) the number of crossings on each flat half-edge, -1 if its edge was there before the flips.
        first: (3m,) the half-edge before the flips that each flat one is or, around the vertex it starts from,
            precedes immediately.
        offset: (3m,) where the places of the edge of each half-edge begin in `number`, -1 if it has none.
        number: (x,) the crossing at each place along each flat edge, counted from the tail of its half-edge
            of smaller index.
        crossed: (x,) the flat half-edge through which an edge from before the flips leaves a triangle; crossings
            on one such edge follow each other.
        leaving: (x,) the half-edge before the flips that runs in this direction.
        on_crossed: (x, 2) barycentric coordinates on the flat half-edge, its tail first.
        on_leaving: (x, 2) barycentric coordinates on the half-edge before the flips, its tail first.
        log_scale: (x,) log conformal factor.
    """

    counts: IntArray
    first: IntArray
    offset: IntArray
    number: IntArray
    crossed: IntArray
    leaving: IntArray
    on_crossed: FloatArray
    on_leaving: FloatArray
    log_scale: FloatArray


def overlay(
    source: IntrinsicTriangulation, flat: IntrinsicTriangulation, flips: IntArray, log_scale: FloatArray
) -> Overlay:
    """Return the crossings of the edges of two triangulations with the same discrete conformal structure.

    Args:
        source: the triangulation before the flips; its lengths are not used.
        flat: the one after, with flat lengths l_ij exp((phi_i + phi_j) / 2).
        flips: half-edges, Ptolemy flips all, in order.
        log_scale: (n,) phi.

    Raises:
        MetricError: the flips do not lead from one to the other.

    Notes:
        In Minkowski space let v_i be light cone vectors with <v_i, v_j> = -l_ij^2 / 2, so that the l are Penner's
        lambda lengths. The geodesic from s to e meets that from a to b in the direction of

            l_sb l_eb v_a + l_sa l_ea v_b  =  (l_ab / l_se) (l_ea l_eb v_s + l_sa l_sb v_e)

        (pair both sides with v_s and with v_e, and use Ptolemy's relation). In a Euclidean triangle with the
        lengths l, whose circumcircle is the absolute of the Klein model, these coefficients are barycentric
        coordinates (Springborn, Schroeder, Pinkall, "Conformal equivalence of triangle meshes", 2008). Flat
        lengths belong to the vectors exp(phi_i) v_i: taken with them, the left side gives the place on the flat
        edge ab, and the right side, with factors exp(phi_s) and exp(phi_e), that on the edge se before the
        flips. The sum of the latter coefficients over that of the former is the conformal factor.
    """
    counts, first = count_crossings(source, flat, flips)
    offset, number, crossed, leaving, near, far = trace_crossings(source, flat, counts, first)
    (near_a, near_b), (far_a, far_b) = near.T, far.T
    on_crossed = np.stack([near_b * far_b, near_a * far_a], axis=1)
    on_leaving = np.stack([far_a * far_b, near_a * near_b], axis=1)
    on_leaving *= (flat.length[crossed] ** 2 / (near_a * far_b + near_b * far_a))[:, None]
    phi = np.stack([log_scale[source.tail[leaving]], log_scale[source.tail[source.twin[leaving]]]], axis=1)
    largest = phi.max(axis=1, keepdims=True)
    on_leaving *= np.exp(phi - largest)
    flat_sum, sum_before = on_crossed.sum(axis=1), on_leaving.sum(axis=1)
    return Overlay(
        counts,
        first,
        offset,
        number,
        crossed,
        leaving,
        on_crossed / flat_sum[:, None],
        on_leaving / sum_before[:, None],
        np.log(sum_before / flat_sum) + largest[:, 0],
    )


def count_crossings(
    source: IntrinsicTriangulation, flat: IntrinsicTriangulation, flips: IntArray
) -> tuple[IntArray, IntArray]:
    """Return the number of crossings on each flat half-edge, and its place among the input ones."""
    flipped = source.copy()
    counts = np.full(len(source.twin), -1, dtype=np.int64)
    first = np.arange(len(source.twin))
    arrays = flipped.twin, flipped.tail, flipped.length
    fits = len(source.twin) == len(flat.twin) and replay_flips(source.twin, *arrays, flips, counts, first)
    if not (fits and np.array_equal(flipped.twin, flat.twin) and np.array_equal(flipped.tail, flat.tail)):
        raise MetricError(
            f"the {len(flips)} flips do not lead from this mesh of {source.face_count} triangles to the flat "
            f"triangulation, which has {flat.face_count}: they are of different meshes"
        )
    return counts, first


def trace_crossings(
    source: IntrinsicTriangulation, flat: IntrinsicTriangulation, counts: IntArray, first: IntArray
) -> tuple[IntArray, IntArray, IntArray, IntArray, FloatArray, FloatArray]:
    """Return the crossings along both sets of edges and the lambda lengths around them."""
    found = np.flatnonzero(counts > 0)
    lower = found[found < flat.twin[found]]
    total = int(counts[lower].sum())
    offset = np.full(len(counts), -1, dtype=np.int64)
    offset[lower] = np.cumsum(counts[lower]) - counts[lower]
    offset[flat.twin[lower]] = offset[lower]
    number, crossed, leaving = np.empty((3, total), dtype=np.int64)
    near, far = np.empty((2, total, 2))
    touched = np.unique(found // 3)
    arrays = counts, first, touched, offset, number, crossed, leaving, near, far
    trace_edges(source.twin, flat.twin, flat.length, *arrays)
    return offset, number, crossed, leaving, near, far


@compiled
def corner_counts(counts: IntArray, base: int, i: int) -> tuple[int, int]:
    """Return how many pieces of input edges cut off corner i of a triangle, and how many start from it."""
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
def first_beside(given_twin: IntArray, counts: IntArray, first: IntArray, before: int) -> int:
    """Return the first half-edge of the input beside a diagonal that was flipped in, from the half-edge before it."""
    _, steps = corner_counts(counts, before - before % 3, (before + 1) % 3)
    if counts[before] < 0:
        steps += 1
    start = first[before]
    for _ in range(steps):
        start = next_around(given_twin, start)
    return start


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
    """Flip the input triangulation, keeping count of the crossings with the input edges.

    Args:
        given_twin: twins before the flips.
        twin, tail, length: the triangulation, changed in place; the lengths are not looked at.
        flips: half-edges, in order.
        counts: number of crossings on the edge of each half-edge, changed in place; -1 for input edges.
        first: for each half-edge the input half-edge from the same vertex that is the same or the next
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
            first[new] = first_beside(given_twin, counts, first, before)
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
    """Follow each input edge that is crossed from triangle to triangle.

    Crossings are numbered along one input edge after the other. With them go the lambda lengths between an
    end of the input edge and the ends of the edges crossed: by Ptolemy's relation the one to the apex of the
    next triangle is a sum of products of positive numbers, so that none loses digits.

    Args:
        given_twin: twins before the flips.
        twin, length, counts, first: the triangulation with what `replay_flips` found out.
        touched: triangles with crossings on their sides.
        offset: for each half-edge, where the places of its edge begin in `number`.
        number: filled: the crossing at each place along each edge, counted from the tail of its half-edge
            of smaller index.
        crossed: filled: for each crossing the half-edge through which the input edge leaves a triangle.
        leaving: filled: the input half-edge that runs in this direction.
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
    """Follow an input edge from the apex over a half-edge to its end; return the crossings so far and the last
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
    """Go back along an input edge with the lambda lengths from its head."""
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
