"""Circle patterns (Kharevych, Springborn, Schroeder 2006), with cones.

First the nearest angles that a pattern can have, a quadratic program, after edge flips where there are none; then the
radii of its circles.
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
    """Return the flat metric whose triangles' circumcircles meet at nearly the same angles as on the mesh.

    Args:
        mesh: connected.
        lengths: (m, 3) side lengths, model units.
        solution: cones with their curvatures; the boundary is free.
        best_effort: return a metric that did not converge.
        delaunay: make the mesh intrinsic Delaunay first, as the paper does; without, angles opposite edges that are
            not Delaunay are made smaller until these are.

    Raises:
        ConvergenceError: there is no such pattern, or it was not found, unless `best_effort`.
        CurvatureError: no metric has the curvatures.
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
    """Return the angles of a pattern, and the half-edges flipped, in place, before there was one."""
    if not delaunay:
        return _nearest_angles(triangulation, target, border), np.empty(0, dtype=np.int64)
    flips = make_delaunay(triangulation)
    coherent = _nearest_angles(triangulation, target, border)
    if not coherent.converged:
        # Two edges between the same vertices, flat all around, cannot both be straight; nor can there be a cone wider
        # than the corners at it can be: their mean is to stay below 0.98 pi.
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
    """Flip edges, in place, that have the same ends as others, or one end only, and towards vertices of small degree.

    Intrinsic Delaunay triangulations have some such edges near vertices of large curvature. Of those that
    can be flipped the one with most room goes first; there are few, so each is looked for anew.

    Args:
        triangulation: changed in place, as far as quads are convex.
        wanted: (n,) number of triangles at each vertex, at least.

    Returns:
        The half-edges flipped, in order.
    """
    flipped: list[int] = []
    while True:
        slots, room = _candidates(triangulation, wanted)
        if not len(slots):
            return np.array(flipped, dtype=np.int64)
        h = int(slots[np.argmax(room)])
        twin, tail, length = triangulation.twin, triangulation.tail, triangulation.length
        one, two = _around(h), _around(int(twin[h]))
        sides = (h, one[1], one[0], two[0], two[1])
        diagonal = euclidean_diagonal(*(float(length[side]) for side in sides))
        relink(twin, tail, length, h, diagonal)
        flipped.append(h)


def _around(slots: int | IntArray) -> tuple[IntArray, IntArray]:
    """Return the next and the previous half-edge in the triangle of each."""
    base = slots - slots % 3
    return base + NEXT[slots % 3], base + PREVIOUS[slots % 3]


def _candidates(triangulation: IntrinsicTriangulation, wanted: IntArray) -> tuple[IntArray, FloatArray]:
    """Return the half-edges that should be flipped, and can without harm, and their room."""
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
    room = _room(triangulation, slots)
    wide = room > 1e-3  # radians that corners of the quad are short of straight
    return slots[wide], room[wide]


def _pair(one: IntArray, two: IntArray, count: int) -> IntArray:
    return np.minimum(one, two) * count + np.maximum(one, two)


def _room(triangulation: IntrinsicTriangulation, slots: IntArray) -> FloatArray:
    """Return by how much the wider corner at the ends of each edge is short of straight."""
    lengths, other = triangulation.length.reshape(-1, 3), triangulation.twin[slots]
    one, two = corner_angles(lengths[slots // 3]), corner_angles(lengths[other // 3])
    rows = np.arange(len(slots))
    # Of a half-edge in slot i, the corner at its tail is i + 1 and the one at its head i + 2.
    at_tail = one[rows, NEXT[slots % 3]] + two[rows, PREVIOUS[other % 3]]
    at_head = one[rows, PREVIOUS[slots % 3]] + two[rows, NEXT[other % 3]]
    return np.pi - np.maximum(at_tail, at_head)
