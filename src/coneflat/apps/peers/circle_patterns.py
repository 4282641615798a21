"""Circle patterns (Kharevych, Springborn, Schroeder 2006), with cones.

A quadratic program gives the nearest angles of a circle pattern, if necessary after edge flips. Then the radii of its
circles are computed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ... import TriangleMesh
from ...base import BoolArray, FloatArray
from ...geometry import (
    IntrinsicTriangulation,
    corner_angles,
    intrinsic_triangulation,
    make_delaunay,
    vertex_areas,
)
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
    flips = make_delaunay(triangulation) if delaunay else np.empty(0, dtype=np.int64)
    coherent = _nearest_angles(triangulation, target, border)
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


def _nearest_angles(
    triangulation: IntrinsicTriangulation, target: FloatArray, border: BoolArray
) -> CoherentAngles:
    angles = corner_angles(triangulation.length.reshape(-1, 3)).ravel()
    return coherent_angles(triangulation, angles, 2 * np.pi - target, ~border)
