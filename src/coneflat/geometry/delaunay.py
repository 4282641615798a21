"""Intrinsic Delaunay triangulations by edge flips, with a record from which the flips can be undone.

In a triangle with sides a, b, c let X = (c + a - b)(a + b - c) and Y = (a + b + c)(b + c - a). Then
X + Y = 4 b c, the angle opposite a has the cosine (Y - X) / (Y + X), and the cosines opposite an edge sum to
a negative number just if X X' > Y Y' (primes: the other triangle). For triangles this is the in-circle test;
for lengths that break the triangle inequality it is still what decides (the ideal Delaunay condition of
Springborn, "Ideal hyperbolic polyhedra and discrete uniformization", 2019), and through the slacks it keeps
its digits in slivers, where the cosines have lost theirs.
"""

from __future__ import annotations

import math

import numpy as np

from .._arrays import FloatArray, IntArray
from ..compiled import compiled
from ..mesh import TriangleMesh
from .graph import drop_first, push
from .intrinsic import IntrinsicTriangulation, intrinsic_triangulation

# Flips per edge after which flipping stops. Finite by theory; in floating point this catches what the
# tolerance of the test does not.
FLIPS_PER_EDGE = 50


def make_delaunay(
    triangulation: IntrinsicTriangulation,
    log_scale: FloatArray | None = None,
    radii: FloatArray | None = None,
    has_lengths: bool = True,
    suspects: IntArray | None = None,
) -> IntArray:
    """Flip a triangulation, in place, until it is Delaunay; return the half-edges flipped, in order.

    Args:
        triangulation: changed in place.
        log_scale: None for the triangulation's own metric and Euclidean flips. With (n,) log scale factors
            phi, the metric l_ij exp((phi_i + phi_j) / 2) is made Delaunay by Ptolemy flips of the lengths l,
            which keep the discrete conformal class (Springborn 2019; Gillespie, Springborn, Crane 2021).
        radii: (n,) of circles at the vertices, to make the triangulation weighted Delaunay for.
        has_lengths: False if the triangulation has the circles' inversive distances for lengths: flips then keep these
            (Bobenko, Lutz 2023).
        suspects: half-edges of the edges that may fail the condition at first; None: all.

    Notes:
        Where nothing fails the condition the cost is one pass over the edges. The condition is meaningful
        also where scaled lengths break the triangle inequality.
    """
    if radii is not None:
        kind, scale = WEIGHTED if has_lengths else PACKED, radii
    elif log_scale is None:
        kind, scale = EUCLIDEAN, np.ones(triangulation.vertex_count)
    else:
        kind = SCALED
        # Only ratios within a triangle matter, so the middle may go to 1, which keeps off overflow.
        scale = np.exp((log_scale - (log_scale.max() + log_scale.min()) / 2) / 2)
    arrays = triangulation.twin, triangulation.tail, triangulation.length
    sides = len(triangulation.twin)
    suspects = np.arange(sides) if suspects is None else suspects
    left = FLIPS_PER_EDGE * sides // 2 + 1000
    records = [np.empty(0, dtype=np.int64)]
    while left > 0:
        bad = np.empty(len(suspects), dtype=np.int64)
        bad = bad[: find_violations(*arrays, scale, kind, suspects, bad)]
        if not len(bad):
            break
        room = SPARE * len(bad) + 1000
        heap, record = (
            (np.empty(room), np.empty(room, dtype=np.int64)),
            np.empty(min(left, room), dtype=np.int64),
        )
        size, count = flip_until_delaunay(*arrays, scale, kind, bad, *heap, record)
        records.append(record[:count])
        left -= count
        suspects = np.unique(heap[1][:size])
    return np.concatenate(records)


def intrinsic_delaunay(mesh: TriangleMesh, lengths: FloatArray) -> tuple[IntrinsicTriangulation, IntArray]:
    """Return the intrinsic Delaunay triangulation of a mesh and the half-edges flipped, in order.

    Args:
        mesh: the mesh.
        lengths: (m, 3) side lengths, model units, with the triangle inequality.
    """
    triangulation = intrinsic_triangulation(mesh, lengths)
    return triangulation, make_delaunay(triangulation)


# What the lengths are: those of the metric that is to be Delaunay; those before scaling; those of the metric that is
# to be weighted Delaunay; inversive distances of circles.
EUCLIDEAN, SCALED, WEIGHTED, PACKED = 0, 1, 2, 3
# Room for edges that wait to be flipped, and for flips, relative to the number at first. What was put there and has
# changed since takes room, too; once there is none, the edges that still fail the condition are looked for anew.
SPARE = 8
# Rounding of a slack relative to the perimeter: a few ulps of lengths that are products of three factors,
# with a wide margin, since an edge flipped for the sake of rounding could be flipped back and forth forever.
NOISE = 1e-14


@compiled
def incircle_terms(
    tail: IntArray, length: FloatArray, scale: FloatArray, h: int
) -> tuple[float, float, float, float]:
    """Return X and Y for the angle opposite h, and bounds of their rounding errors."""
    base = h - h % 3
    h1 = base + (h + 1) % 3
    h2 = base + (h + 2) % 3
    u, v, p = scale[tail[h]], scale[tail[h1]], scale[tail[h2]]
    a, b, c = length[h] * u * v, length[h1] * v * p, length[h2] * p * u
    largest = max(a, b, c)
    a /= largest
    b /= largest
    c /= largest
    slack_a = min(b, c) - (a - max(b, c))
    slack_b = min(c, a) - (b - max(c, a))
    slack_c = min(a, b) - (c - max(a, b))
    perimeter = a + b + c
    error = NOISE * perimeter
    return (
        slack_b * slack_c,
        perimeter * slack_a,
        error * (abs(slack_b) + abs(slack_c)),
        error * perimeter,
    )


@compiled
def violation(
    twin: IntArray, tail: IntArray, length: FloatArray, scale: FloatArray, kind: int, h: int
) -> float:
    """Return by how much an edge between two triangles fails the Delaunay condition; 0 if it does not.

    That is minus the sum of the cosines opposite, which measures alike on all edges, or of the slopes.
    """
    t = twin[h]
    if t < 0 or t // 3 == h // 3:
        return 0.0
    if kind >= WEIGHTED:
        tilt, size = tilts(tail, length, scale, kind == WEIGHTED, h)
        tilt2, size2 = tilts(tail, length, scale, kind == WEIGHTED, t)
        fails = tilt + tilt2 < -NOISE * (size + size2)
        return -(tilt + tilt2) / (size + size2) if fails else 0.0
    x, y, dx, dy = incircle_terms(tail, length, scale, h)
    x2, y2, dx2, dy2 = incircle_terms(tail, length, scale, t)
    noise = dx * abs(x2) + dx2 * abs(x) + dx * dx2 + dy * abs(y2) + dy2 * abs(y) + dy * dy2
    return (x - y) / (x + y) + (x2 - y2) / (x2 + y2) if x * x2 - y * y2 > noise else 0.0


@compiled
def euclidean_diagonal(e: float, b: float, c: float, b2: float, c2: float) -> float:
    """Return the other diagonal of the quad of two triangles on the edge e from u to v.

    b, b2 are the distances of the apices from u; c, c2 from v. Heights add, so nothing cancels in slivers.
    """
    height = 0.0
    for s, t in ((b, c), (b2, c2)):
        slack = min(s, t) - (e - max(s, t))
        slack_s = min(t, e) - (s - max(t, e))
        slack_t = min(e, s) - (t - max(e, s))
        height += math.sqrt(max((e + s + t) * slack * slack_s * slack_t, 0.0)) / (2 * e)
    along = ((b - c) * (b + c) - (b2 - c2) * (b2 + c2)) / (2 * e)
    return math.hypot(along, height)


@compiled
def relink(
    twin: IntArray, tail: IntArray, length: FloatArray, h: int, diagonal: float
) -> tuple[int, int, int, int]:
    """Turn the edge h counterclockwise in its quad; return the four slots of the quad's sides.

    Sides move between slots (h2 to h1, t1 to h2, t2 to t1, h1 to t2), and where the quad is glued to
    itself their twins move with them. Four turns restore every slot.
    """
    t = twin[h]
    h1 = h - h % 3 + (h + 1) % 3
    h2 = h - h % 3 + (h + 2) % 3
    t1 = t - t % 3 + (t + 1) % 3
    t2 = t - t % 3 + (t + 2) % 3
    twins = (twin[h2], twin[t1], twin[t2], twin[h1])
    sides = (length[h2], length[t1], length[t2], length[h1])
    u, v, p, q = tail[h], tail[t], tail[h2], tail[t2]
    old = (h2, t1, t2, h1)
    new = (h1, h2, t1, t2)
    for i in range(4):
        other = twins[i]
        for j in range(4):
            if twins[i] == old[j]:
                other = new[j]
        twin[new[i]] = other
        if other >= 0:
            twin[other] = new[i]
        length[new[i]] = sides[i]
    length[h] = diagonal
    length[t] = diagonal
    tail[h], tail[h1], tail[h2] = q, p, u
    tail[t], tail[t1], tail[t2] = p, q, v
    return new


@compiled
def find_violations(
    twin: IntArray,
    tail: IntArray,
    length: FloatArray,
    scale: FloatArray,
    kind: int,
    suspects: IntArray,
    found: IntArray,
) -> int:
    """Write those of some half-edges whose edges fail the Delaunay condition to `found`; return their number."""
    count = 0
    for h in suspects:
        if violation(twin, tail, length, scale, kind, h) > 0.0:
            found[count] = h
            count += 1
    return count


@compiled
def flip_until_delaunay(
    twin: IntArray,
    tail: IntArray,
    length: FloatArray,
    scale: FloatArray,
    kind: int,
    bad: IntArray,
    keys: FloatArray,
    items: IntArray,
    record: IntArray,
) -> tuple[int, int]:
    """Flip edges that fail the condition, and those whose quads that changes if they do then, the worst first.

    In another order the edges around a hub are flipped one after the other to the same far vertex, which becomes a
    hub in its place: ten times as many flips for thousands of edges.

    Args:
        twin, tail, length, scale, kind: the triangulation, see `make_delaunay`.
        bad: half-edges of the edges that fail the condition, by one or both.
        keys, items: room for a heap. An edge is there again whenever its quad has changed.
        record: filled with the half-edges flipped.

    Returns:
        How many half-edges wait in `items` still, as there is no room, and the number of flips recorded.
    """
    size, count = 0, 0
    for h in bad:
        size = push(keys, items, size, -violation(twin, tail, length, scale, kind, h), h)
    while size > 0 and count < len(record) and size + 4 <= len(items):
        key, h = keys[0], items[0]
        size = drop_first(keys, items, size)
        if key == 0.0 or -violation(twin, tail, length, scale, kind, h) != key:  # of a quad that has changed
            continue
        t = twin[h]
        h1 = h - h % 3 + (h + 1) % 3
        h2 = h - h % 3 + (h + 2) % 3
        t1 = t - t % 3 + (t + 1) % 3
        t2 = t - t % 3 + (t + 2) % 3
        if kind in (EUCLIDEAN, WEIGHTED):
            diagonal = euclidean_diagonal(length[h], length[h2], length[h1], length[t1], length[t2])
        elif kind == PACKED:
            diagonal = other_inversive_distance(length[h], length[h2], length[h1], length[t1], length[t2])
        else:  # Ptolemy's relation, which keeps the conformal class
            diagonal = (length[h1] * length[t1] + length[h2] * length[t2]) / length[h]
        record[count] = h
        count += 1
        for side in relink(twin, tail, length, h, diagonal):
            amount = violation(twin, tail, length, scale, kind, side)
            if amount > 0.0:
                size = push(keys, items, size, -amount, side)
    return size, count


@compiled
def spread(edge: float, one: float, two: float) -> float:
    """Return minus the Gram determinant of three circles with these inversive distances; symmetric in them."""
    return edge * edge + one * one + two * two + 2 * edge * one * two - 1


@compiled
def inversive_distance(length: float, one: float, two: float) -> float:
    """Return the inversive distance of two circles with radii one and two, their centres so far from each other."""
    # 1 and a term with the gap between the circles, which keeps its digits.
    return 1 + (length - (one + two)) * (length + (one + two)) / (2 * (one * two))


@compiled
def tilts(
    tail: IntArray, sides: FloatArray, radius: FloatArray, are_lengths: bool, h: int
) -> tuple[float, float]:
    """Return the slope of the triangle of h along its side h, and a bound of the terms that it is made of.

    An edge is weighted Delaunay if the slopes from both sides do not sum to a negative number. Where the triangle
    exists, its radical centre is at a height over the side with the sign of the slope.

    sides: (3m,) inversive distances, or lengths.
    """
    base = h - h % 3
    h1 = base + (h + 1) % 3
    h2 = base + (h + 2) % 3
    gi, gj, gk = radius[tail[h]], radius[tail[h1]], radius[tail[h2]]
    c, jk, ik = sides[h], sides[h1], sides[h2]
    if are_lengths:
        c, jk, ik = (
            inversive_distance(c, gi, gj),
            inversive_distance(jk, gj, gk),
            inversive_distance(ik, gi, gk),
        )
    up = gk * ((gj + c * gi) * ik + (gi + c * gj) * jk)
    down = gi * gj * (c * c - 1)
    length = math.sqrt(gi * gi + gj * gj + 2 * c * gi * gj)
    size = length * gk * math.sqrt(spread(c, ik, jk))
    return (up - down) / size, (up + abs(down)) / size


@compiled
def other_inversive_distance(e: float, b: float, c: float, b2: float, c2: float) -> float:
    """Return the inversive distance along the other diagonal of the quad of two triangles on the edge e from u to v.

    b, b2 are those of the apices from u; c, c2 from v. e is more than 1: tangent circles need no flip.
    """
    across = b * b2 + c * c2 + e * (b * c2 + b2 * c)
    return (across + math.sqrt(spread(e, b, c) * spread(e, b2, c2))) / (e * e - 1)
