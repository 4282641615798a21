"""Intrinsic Delaunay triangulations by edge flips, with a record of the flips so that they can be undone.

In a triangle with sides a, b, c let X = (c + a - b)(a + b - c) and Y = (a + b + c)(b + c - a). Then
X + Y = 4 b c, the angle opposite a has the cosine (Y - X) / (Y + X), and the cosines opposite an edge sum to
a negative number if and only if X X' > Y Y' (primes: the other triangle). For triangles this is the in-circle test.
For lengths that break the triangle inequality it is the ideal Delaunay condition of Springborn, "Ideal hyperbolic
polyhedra and discrete uniformization", 2019. As it is computed from slacks, it is accurate also for slivers, for which
the cosines are not.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray, Numbers
from ..base.jit import compiled
from ..linalg.heap import drop_first, push
from ..mesh.connectivity import TriangleMesh
from .intrinsic import IntrinsicTriangulation, intrinsic_triangulation
from .triangles import cotangents

# Largest number of flips per edge. The number is finite in theory; in floating point, this limit ends the cycles that
# the tolerance of the test does not prevent.
FLIPS_PER_EDGE = 50


def make_delaunay(
    triangulation: IntrinsicTriangulation,
    log_scale: FloatArray | None = None,
    suspects: IntArray | None = None,
) -> IntArray:
    """Flip a triangulation in place until it is Delaunay; return (k,) the flipped half-edges, in order.

    Args:
        triangulation: changed in place.
        log_scale: None for the triangulation's metric and Euclidean flips. With (n,) log conformal factors
            phi, the metric l_ij exp((phi_i + phi_j) / 2) is made Delaunay by Ptolemy flips of the lengths l,
            which preserve the discrete conformal class (Springborn 2019; Gillespie, Springborn, Crane 2021).
        suspects: half-edges of the edges that may violate the condition at first; None: all.

    Notes:
        If no edge violates the condition, the cost is one pass over the edges. The condition is also defined if
        scaled lengths break the triangle inequality.
    """
    if log_scale is None:
        scale = np.ones(triangulation.vertex_count)
    else:
        # Only ratios within a triangle matter; scaling the middle of the range to 1 avoids overflow.
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


def euclidean_suspects(triangulation: IntrinsicTriangulation) -> IntArray:
    """Return both half-edges of the edges that may violate the Delaunay condition, ascending.

    All edges with a cotangent sum that is surely positive are left out. This takes a third of the time of the
    condition.
    """
    cots = cotangents(triangulation.length.reshape(-1, 3))
    return np.flatnonzero(may_violate(triangulation.twin, cots.ravel()))


def intrinsic_delaunay(mesh: TriangleMesh, lengths: FloatArray) -> tuple[IntrinsicTriangulation, IntArray]:
    """Return the intrinsic Delaunay triangulation of a mesh, and (k,) the flipped half-edges, in order.

    Args:
        mesh: the mesh.
        lengths: (m, 3) side lengths, model units, that satisfy the triangle inequality.
    """
    triangulation = intrinsic_triangulation(mesh, lengths)
    return triangulation, make_delaunay(triangulation, suspects=euclidean_suspects(triangulation))


# Bound of the rounding error of a slack relative to the perimeter: a few ulps of lengths that are products of three
# factors, with a wide margin, since an edge that is flipped because of rounding could flip back and forth forever.
SLACK_ROUNDING = 1e-14
# Bound of the rounding error of a cotangent, relative to 1 plus its magnitude, in the same sense.
COTANGENT_ROUNDING = 1e-12


@compiled
def may_violate(twin: IntArray, cots: FloatArray) -> BoolArray:
    """Return (3m,) whether the sum of the cotangents (3m,) opposite an edge may be negative."""
    is_suspect = np.zeros(len(twin), np.bool_)
    for h in range(len(twin)):
        t = twin[h]
        # Cotangents of triangles without area are not numbers.
        is_suspect[h] = t >= 0 and not (
            cots[h] + cots[t] > COTANGENT_ROUNDING * (2.0 + abs(cots[h]) + abs(cots[t]))
        )
    return is_suspect


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
    """Return by how much an edge violates the Delaunay condition: minus the sum of opposite cosines; 0 if satisfied.

    This measure is comparable between all edges.
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
    """Return the length of the other diagonal of the quad of two triangles on the edge of length e from u to v.

    b, b2 are the distances of the apices from u, and c, c2 from v. Heights are added, so there is no cancellation in
    slivers.
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
def flip(
    twin: IntArray, tail: IntArray, length: FloatArray, h: int, is_euclidean: bool
) -> tuple[int, int, int, int]:
    """Flip the edge h by a counterclockwise rotation in its quad; return the four half-edges of the sides of the quad.

    A Euclidean flip preserves the metric, others the conformal class of the lengths, by Ptolemy's relation. Sides move
    between half-edge indices (h2 to h1, t1 to h2, t2 to t1, h1 to t2). If the quad is glued to itself, their twins move
    with them. Four flips restore every index.
    """
    t = twin[h]
    h1 = h - h % 3 + (h + 1) % 3
    h2 = h - h % 3 + (h + 2) % 3
    t1 = t - t % 3 + (t + 1) % 3
    t2 = t - t % 3 + (t + 2) % 3
    if is_euclidean:
        diagonal = euclidean_diagonal(length[h], length[h2], length[h1], length[t1], length[t2])
    else:
        diagonal = (length[h1] * length[t1] + length[h2] * length[t2]) / length[h]
    twins = (twin[h2], twin[t1], twin[t2], twin[h1])
    sides = (length[h2], length[t1], length[t2], length[h1])
    u, v, p, q = tail[h], tail[t], tail[h2], tail[t2]
    origins = (h2, t1, t2, h1)
    destinations = (h1, h2, t1, t2)
    for i in range(4):
        neighbour = twins[i]
        for j in range(4):
            if twins[i] == origins[j]:
                neighbour = destinations[j]
        twin[destinations[i]] = neighbour
        if neighbour >= 0:
            twin[neighbour] = destinations[i]
        length[destinations[i]] = sides[i]
    length[h] = diagonal
    length[t] = diagonal
    tail[h], tail[h1], tail[h2] = q, p, u
    tail[t], tail[t1], tail[t2] = p, q, v
    return destinations


@compiled
def doubled(values: Numbers) -> Numbers:
    """Return an array of twice the capacity."""
    larger = np.empty(2 * len(values), values.dtype)
    for i in range(len(values)):
        larger[i] = values[i]
    return larger


@compiled
def flip_until_delaunay(
    twin: IntArray,
    tail: IntArray,
    length: FloatArray,
    scale: FloatArray,
    is_euclidean: bool,
    suspects: IntArray,
    max_flips: int,
) -> IntArray:
    """Flip edges that violate the Delaunay condition, always the worst, until there is none; return them in order.

    In another order, the edges around a vertex of high valence may all be flipped to the same far vertex, which then
    has a high valence instead: this takes ten times as many flips for thousands of edges.

    Args:
        twin, tail, length, scale: the triangulation, see `make_delaunay`.
        is_euclidean: whether flips preserve the metric of the lengths; else the conformal class.
        suspects: half-edges of the edges that may violate the condition, one or both per edge.
        max_flips: largest number of flips.

    Returns:
        (k,) the flipped half-edges, in order.
    """
    # A heap of edges; an edge is inserted again whenever its quad has changed.
    keys, items, size = np.empty(64), np.empty(64, np.int64), 0
    for h in suspects:
        amount = violation(twin, tail, length, scale, h)
        if amount > 0.0:
            if size == len(items):
                keys, items = doubled(keys), doubled(items)
            size = push(keys, items, size, -amount, h)
    record, count = np.empty(64, np.int64), 0
    while size > 0 and count < max_flips:
        key, h = keys[0], items[0]
        size = drop_first(keys, items, size)
        if key == 0.0 or -violation(twin, tail, length, scale, h) != key:  # outdated: the quad has changed
            continue
        if count == len(record):
            record = doubled(record)
        record[count] = h
        count += 1
        if size + 4 > len(items):
            keys, items = doubled(keys), doubled(items)
        for side in flip(twin, tail, length, h, is_euclidean):
            amount = violation(twin, tail, length, scale, side)
            if amount > 0.0:
                size = push(keys, items, size, -amount, side)
    return record[:count]
