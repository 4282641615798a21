"""Circle patterns (Kharevych, Springborn, Schroeder 2006), with cones.

A quadratic program gives the nearest angles of a circle pattern, if necessary after edge flips. Then the radii of its
circles are computed.
"""

from __future__ import annotations

import numpy as np

from coneflat import TriangleMesh
from coneflat.base import BoolArray, FloatArray, IntArray, plural
from coneflat.base.text import error_text
from coneflat.errors import ConvergenceError
from coneflat.geometry import angle_defect, corner_angles, double_areas
from coneflat.geometry.delaunay import make_delaunay
from coneflat.geometry.intrinsic import IntrinsicTriangulation, intrinsic_triangulation
from coneflat.geometry.operators import vertex_areas
from coneflat.geometry.straight import straight_triangles
from coneflat.metric.exact import checked_target
from coneflat.stages import ConeSolution, FlatMetric, SolveStatistics

from .pattern_angles import CoherentAngles, coherent_angles
from .pattern_radii import circle_pattern

# Largest curvature error of a metric that has converged, radians.
TOLERANCE = 1e-9


def circle_patterns(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    delaunay: bool = True,
) -> FlatMetric:
    """Return the flat metric whose circumcircles intersect at nearly the same angles as on the mesh.

    Args:
        mesh: a connected mesh.
        lengths: (m, 3) side lengths, model units.
        solution: cones with their curvatures; the boundary is free.
        delaunay: make the mesh intrinsic Delaunay first, as in the paper; otherwise angles opposite edges that are not
            Delaunay are reduced until they are.

    Raises:
        ConvergenceError: there is no such pattern, or it was not found.
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
    if not coherent.converged:
        problem = "no circle pattern on these triangles has the curvatures: their angles are"
        raise _failure(problem, coherent.residual, coherent.steps)
    pattern = circle_pattern(triangulation.twin, coherent)
    steps = coherent.steps + pattern.steps
    before, after = (
        vertex_areas(triangulation.faces, sides.reshape(-1, 3), len(border))
        for sides in (triangulation.length, pattern.lengths)
    )
    log_scale = np.log(np.maximum(after / before, np.finfo(float).tiny)) / 2
    metric = _flat_metric(mesh, lengths, solution, triangulation, pattern.lengths, log_scale, flips, steps)
    residual = metric.statistics.residual
    if not residual <= TOLERANCE:
        raise _failure("the circle pattern did not converge: the curvature is", residual, steps)
    return metric


def _failure(problem: str, residual: float, steps: int) -> ConvergenceError:
    return ConvergenceError(
        f"{problem} {error_text(residual)} after {plural(steps, 'step')}; method 'exact', other cones, a repair or "
        "remeshing may help"
    )


def _nearest_angles(
    triangulation: IntrinsicTriangulation, target: FloatArray, border: BoolArray
) -> CoherentAngles:
    angles = corner_angles(triangulation.length.reshape(-1, 3)).ravel()
    return coherent_angles(triangulation, angles, 2 * np.pi - target, ~border)


def _flat_metric(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    triangulation: IntrinsicTriangulation,
    flat: FloatArray,
    log_scale: FloatArray,
    flips: IntArray,
    steps: int,
) -> FlatMetric:
    """Return a metric on a flipped triangulation, at the area of the mesh; its boundary is free.

    Args:
        mesh: a connected mesh.
        lengths: (m, 3) its side lengths.
        solution: its cones and their curvatures.
        triangulation: the flipped triangulation; its lengths are set to the flat ones.
        flat: (3m,) flat lengths.
        log_scale: (n,) phi, up to a constant.
        flips: flipped half-edges, in order.
        steps: number of Newton steps.
    """
    border, faces = mesh.is_boundary_vertex, triangulation.faces
    curvature = angle_defect(faces, corner_angles(flat.reshape(-1, 3)), border)
    error = np.where(border, 0.0, np.abs(curvature - solution.target))
    triangulation.length = flat
    statistics = SolveStatistics(newton_steps=steps, euclidean_flips=len(flips), residual=float(error.max()))
    return FlatMetric(
        mesh=mesh,
        lengths=lengths,
        cones=solution.cones,
        target=np.where(border, curvature, solution.target),
        log_scale=log_scale,
        is_open=border,
        is_fixed=np.zeros(len(border), dtype=bool),
        statistics=statistics,
        triangles=straight_triangles(triangulation, flips, len(mesh.faces)),
    ).scaled(float(np.sqrt(double_areas(lengths).sum() / double_areas(flat.reshape(-1, 3)).sum())))
