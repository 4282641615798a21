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

from ..base.arrays import FloatArray, IntArray
from ..base.compiled import compiled
from ..linalg.shortest_paths import drop_first, push
from ..mesh.connectivity import TriangleMesh
from .intrinsic import IntrinsicTriangulation, intrinsic_triangulation

# Flips per edge after which flipping stops. Finite by theory; in floating point this catches what the
# tolerance of the test does not.
FLIPS_PER_EDGE = 50


def make_delaunay(
    triangulation: IntrinsicTriangulation,
    log_scale: FloatArray | None = None,
    suspects: IntArray | None = None,
) -> IntArray:
    """Flip a triangulation, in place, until it is Delaunay; return the half-edges flipped, in order.

    Args:
        triangulation: changed in place.
        log_scale: None for the triangulation's own metric and Euclidean flips. With (n,) log scale factors
            phi, the metric l_ij exp((phi_i + phi_j) / 2) is made Delaunay by Ptolemy flips of the lengths l,
            which keep the discrete conformal class (Springborn 2019; Gillespie, Springborn, Crane 2021).
        suspects: half-edges of the edges that may fail the condition at first; None: all.

    Notes:
        Where nothing fails the condition the cost is one pass over the edges. The condition is meaningful
        also where scaled lengths break the triangle inequality.
    """
    if log_scale is None:
        scale = np.ones(triangulation.vertex_count)
    else:
        # Only ratios within a triangle matter, so the middle may go to 1, which keeps off overflow.
        scale = np.exp((log_scale - (log_scale.max() + log_scale.min()) / 2) / 2)
    sides = len(triangulation.twin)
    return flip_until_delaunay(
        triangulation.twin,
        triangulation.tail,
        triangulation.length,
        scale,
        log_scale is None,
        np.arange(sides) if suspects is None else suspects,
        FLIPS_PER_EDGE * sides // 2 + 1000,
    )


def intrinsic_delaunay(mesh: TriangleMesh, lengths: FloatArray) -> tuple[IntrinsicTriangulation, IntArray]:
    """Return the intrinsic Delaunay triangulation of a mesh and the half-edges flipped, in order.

    Args:
        mesh: the mesh.
        lengths: (m, 3) side lengths, model units, with the triangle inequality.
    """
    triangulation = intrinsic_triangulation(mesh, lengths)
    return triangulation, make_delaunay(triangulation)


# Rounding of a slack relative to the perimeter: a few ulps of lengths that are products of three factors,
# with a wide margin, since an edge flipped for the sake of rounding could be flipped back and forth forever.
SLACK_ROUNDING = 1e-14


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
    error = SLACK_ROUNDING * perimeter
    return (
        slack_b * slack_c,
        perimeter * slack_a,
        error * (abs(slack_b) + abs(slack_c)),
        error * perimeter,
    )


@compiled
def violation(twin: IntArray, tail: IntArray, length: FloatArray, scale: FloatArray, h: int) -> float:
    """Return by how much an edge between two triangles fails the Delaunay condition; 0 if it does not.

    That is minus the sum of the cosines opposite, which measures alike on all edges.
    """
    t = twin[h]
    if t < 0 or t // 3 == h // 3:
        return 0.0
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
def flip_until_delaunay(
    twin: IntArray,
    tail: IntArray,
    length: FloatArray,
    scale: FloatArray,
    is_euclidean: bool,
    suspects: IntArray,
    most: int,
) -> IntArray:
    """Flip edges that fail the condition, and those whose quads that changes if they do then, the worst first.

    In another order the edges around a hub are flipped one after the other to the same far vertex, which becomes a
    hub in its place: ten times as many flips for thousands of edges.

    Args:
        twin, tail, length, scale: the triangulation, see `make_delaunay`.
        is_euclidean: whether flips keep the metric of the lengths, or the conformal class.
        suspects: half-edges of the edges that may fail the condition, by one or both.
        most: flips at most.

    Returns:
        The half-edges flipped, in order.
    """
    # A heap of edges; one is there again whenever its quad has changed.
    keys, items, size = np.empty(64), np.empty(64, np.int64), 0
    for h in suspects:
        amount = violation(twin, tail, length, scale, h)
        if amount > 0.0:
            if size == len(items):
                keys, items = np.concatenate((keys, keys)), np.concatenate((items, items))
            size = push(keys, items, size, -amount, h)
    record, count = np.empty(64, np.int64), 0
    while size > 0 and count < most:
        key, h = keys[0], items[0]
        size = drop_first(keys, items, size)
        if key == 0.0 or -violation(twin, tail, length, scale, h) != key:  # of a quad that has changed
            continue
        t = twin[h]
        h1 = h - h % 3 + (h + 1) % 3
        h2 = h - h % 3 + (h + 2) % 3
        t1 = t - t % 3 + (t + 1) % 3
        t2 = t - t % 3 + (t + 2) % 3
        if is_euclidean:
            diagonal = euclidean_diagonal(length[h], length[h2], length[h1], length[t1], length[t2])
        else:  # Ptolemy's relation, which keeps the conformal class
            diagonal = (length[h1] * length[t1] + length[h2] * length[t2]) / length[h]
        if count == len(record):
            record = np.concatenate((record, record))
        record[count] = h
        count += 1
        if size + 4 > len(items):
            keys, items = np.concatenate((keys, keys)), np.concatenate((items, items))
        for side in relink(twin, tail, length, h, diagonal):
            amount = violation(twin, tail, length, scale, side)
            if amount > 0.0:
                size = push(keys, items, size, -amount, side)
    return record[:count].copy()
