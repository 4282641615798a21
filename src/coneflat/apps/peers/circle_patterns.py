"""Circle patterns (Kharevych, Springborn, Schroeder 2006), with cones.

A quadratic program gives the nearest angles of a circle pattern, if necessary after edge flips. Then the radii of its
circles are computed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ... import TriangleMesh
from ...base import BoolArray, FloatArray, IntArray
from ...geometry import (
    IntrinsicTriangulation,
    corner_angles,
    euclidean_diagonal,
    intrinsic_triangulation,
    make_delaunay,
    relink,
    vertex_areas,
)
from ...mesh import NEXT, PREVIOUS
from ...metric import checked_target
from ...stages import ConeSolution, FlatMetric
from .pattern_angles import CoherentAngles, coherent_angles
from .pattern_radii import circle_pattern
from .shared import failure_notes, flat_metric

# Largest curvature error of a metric that has converged, radians.
TOLERANCE = 1e-9


def circle_patterns(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    best_effort: bool = False,
    delaunay: bool = True,
) -> FlatMetric:
    """Return the flat metric whose circumcircles intersect at nearly the same angles as on the mesh.

    Args:
        mesh: a connected mesh.
        lengths: (m, 3) side lengths, model units.
        solution: cones with their curvatures; the boundary is free.
        best_effort: return a metric even if it did not converge.
        delaunay: make the mesh intrinsic Delaunay first, as in the paper; otherwise angles opposite edges that are not
            Delaunay are reduced until they are.

    Raises:
        ConvergenceError: there is no such pattern, or it was not found, unless `best_effort`.
        CurvatureError: no metric has the curvatures.

    References:
        L. Kharevych, B. Springborn, P. Schroeder, "Discrete conformal mappings via circle patterns", ACM Transactions
        on Graphics 25(2), 2006.
    """
    border = mesh.is_boundary_vertex
    target, _ = checked_target(mesh, np.where(border, 0.0, solution.target), border)
    triangulation = intrinsic_triangulation(mesh, lengths)
    coherent, flips = _find_angles(triangulation, target, border, delaunay)
    notes: tuple[str, ...] = ()
    if not coherent.converged:
        what = "no circle pattern on these triangles has the curvatures: their angles are"
        notes = failure_notes(what, coherent.steps, coherent.residual, " rad", best_effort)
    pattern = circle_pattern(triangulation.twin, coherent)
    steps = coherent.steps + pattern.steps
    before, after = (
        vertex_areas(triangulation.faces, sides.reshape(-1, 3), len(border))
        for sides in (triangulation.length, pattern.lengths)
    )
    log_scale = np.log(np.maximum(after / before, np.finfo(float).tiny)) / 2
    metric = flat_metric(mesh, lengths, solution, triangulation, pattern.lengths, log_scale, flips, steps)
    residual = metric.statistics.residual
    if not notes and not residual <= TOLERANCE:
        what = "the circle pattern did not converge: the curvature is"
        notes = failure_notes(what, steps, residual, " rad", best_effort)
    return replace(metric, notes=notes)


def _find_angles(
    triangulation: IntrinsicTriangulation, target: FloatArray, border: BoolArray, delaunay: bool
) -> tuple[CoherentAngles, IntArray]:
    """Return the angles of a pattern, and the half-edges that were flipped in place to make it feasible."""
    if not delaunay:
        return _nearest_angles(triangulation, target, border), np.empty(0, dtype=np.int64)
    flips = make_delaunay(triangulation)
    coherent = _nearest_angles(triangulation, target, border)
    if not coherent.converged:
        # In a flat region, two edges between the same vertices cannot both be straight. And a cone angle is bounded by
        # the angles of its corners, whose mean must be below 0.98 pi.
        wanted = np.where(border, 0, np.floor((2 * np.pi - target) / (0.98 * np.pi)).astype(np.int64) + 1)
        flips = np.concatenate([flips, make_proper(triangulation, wanted)])
        coherent = _nearest_angles(triangulation, target, border)
    return coherent, flips


def _nearest_angles(
    triangulation: IntrinsicTriangulation, target: FloatArray, border: BoolArray
) -> CoherentAngles:
    angles = corner_angles(triangulation.length.reshape(-1, 3)).ravel()
    return coherent_angles(triangulation, angles, 2 * np.pi - target, ~border)


def make_proper(triangulation: IntrinsicTriangulation, wanted: IntArray) -> IntArray:
    """Flip multiple edges and loops, and edges opposite vertices of small degree, in place.

    Intrinsic Delaunay triangulations have some such edges near vertices of large curvature. The edge with the largest
    margin of convexity is flipped first; there are few, so the search is repeated after each flip.

    Args:
        triangulation: updated in place, where quads are convex.
        wanted: (n,) least number of triangles at each vertex.

    Returns:
        The flipped half-edges, in order.
    """
    flipped: list[int] = []
    while True:
        slots, margin = _candidates(triangulation, wanted)
        if not len(slots):
            return np.array(flipped, dtype=np.int64)
        h = int(slots[np.argmax(margin)])
        twin, tail, length = triangulation.twin, triangulation.tail, triangulation.length
        one, two = _around(h), _around(int(twin[h]))
        sides = (h, one[1], one[0], two[0], two[1])
        diagonal = euclidean_diagonal(*(float(length[side]) for side in sides))
        relink(twin, tail, length, h, diagonal)
        flipped.append(h)


def _around(slots: int | IntArray) -> tuple[IntArray, IntArray]:
    """Return the next and the previous half-edge in the triangle of each half-edge."""
    base = slots - slots % 3
    return base + NEXT[slots % 3], base + PREVIOUS[slots % 3]


def _candidates(triangulation: IntrinsicTriangulation, wanted: IntArray) -> tuple[IntArray, FloatArray]:
    """Return the half-edges that should and can be flipped, and their margins of convexity, radians."""
    twin, tail, count = triangulation.twin, triangulation.tail, triangulation.vertex_count
    every = np.arange(len(twin))
    after, before = _around(every)
    keys = _pair(tail, tail[after], count)
    known, number, times = np.unique(keys[twin < every], return_inverse=True, return_counts=True)
    is_double = np.zeros(len(twin), dtype=bool)
    is_double[twin < every] = times[number.ravel()] > 1
    is_double |= tail == tail[after]
    degree = np.bincount(tail, minlength=count)
    should: BoolArray = is_double | (degree < wanted)[tail[before]]
    slots = every[should & (twin >= 0)]
    slots = slots[twin[slots] // 3 != slots // 3]

    other = twin[slots]
    new = tail[before[slots]], tail[before[other]]
    spare = degree > wanted
    fine = spare[tail[slots]] & spare[tail[other]] & (new[0] != new[1])
    fine &= ~np.isin(_pair(*new, count), known)
    slots = slots[fine]
    margin = _margin(triangulation, slots)
    wide = margin > 1e-3  # radians between the corners of the quad and a straight angle
    return slots[wide], margin[wide]


def _pair(one: IntArray, two: IntArray, count: int) -> IntArray:
    return np.minimum(one, two) * count + np.maximum(one, two)


def _margin(triangulation: IntrinsicTriangulation, slots: IntArray) -> FloatArray:
    """Return pi minus the larger angle of the quad at the two ends of each edge, radians."""
    lengths, other = triangulation.length.reshape(-1, 3), triangulation.twin[slots]
    one, two = corner_angles(lengths[slots // 3]), corner_angles(lengths[other // 3])
    rows = np.arange(len(slots))
    # The half-edge in slot i has corner i + 1 at its tail and corner i + 2 at its head.
    at_tail = one[rows, NEXT[slots % 3]] + two[rows, PREVIOUS[other % 3]]
    at_head = one[rows, PREVIOUS[slots % 3]] + two[rows, NEXT[other % 3]]
    return np.pi - np.maximum(at_tail, at_head)
