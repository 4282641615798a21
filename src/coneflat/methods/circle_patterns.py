"""Circle patterns (Kharevych, Springborn, Schroeder 2006), with cones."""

from __future__ import annotations

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from ..cones import ConeSolution
from ..conformal.circle_pattern import circle_pattern
from ..conformal.coherent_angles import CoherentAngles, coherent_angles
from ..conformal.exact import ExactMetric, checked_target
from ..geometry import angle_defect, corner_angles
from ..geometry.areas import vertex_areas
from ..geometry.delaunay import make_delaunay
from ..geometry.intrinsic import IntrinsicTriangulation, intrinsic_triangulation
from ..geometry.proper import make_proper
from ..mesh import TriangleMesh
from ..text import plural
from .base import failure_notes, off_by
from .exact import ExactFlatMetric, at_own_area

# Largest curvature error of a metric that has converged, radians.
TOLERANCE = 1e-9
# Mean angle, radians, that corners at a vertex are to stay below.
WIDEST = 0.98 * np.pi


def circle_patterns(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    best_effort: bool = False,
    delaunay: bool = True,
) -> ExactFlatMetric:
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
    failure = None
    if not coherent.converged:
        failure = (
            f"no circle pattern on these triangles has the curvatures: after {plural(coherent.steps, 'step')} their "
            f"angles are {off_by(coherent.residual)}"
        )
    notes = failure_notes(failure, best_effort)
    solved = _solved(triangulation, coherent, flips, target, border)
    if failure is None and not solved.converged:
        failure = (
            f"the circle pattern did not converge: after {plural(solved.steps, 'step')} the curvature is "
            f"{off_by(solved.residual)}"
        )
        notes = failure_notes(failure, best_effort)
    return at_own_area(mesh, lengths, solution, solved, notes)


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
        # than the corners at it can be.
        wanted = np.where(border, 0, np.floor((2 * np.pi - target) / WIDEST).astype(np.int64) + 1)
        flips = np.concatenate([flips, make_proper(triangulation, wanted)])
        coherent = _nearest_angles(triangulation, target, border)
    return coherent, flips


def _solved(
    triangulation: IntrinsicTriangulation,
    coherent: CoherentAngles,
    flips: IntArray,
    target: FloatArray,
    border: BoolArray,
) -> ExactMetric:
    """Return the metric of the circle pattern with given angles, which the triangulation gets for its own."""
    pattern = circle_pattern(triangulation.twin, coherent)
    before, after = triangulation.length.reshape(-1, 3), pattern.lengths.reshape(-1, 3)
    faces = triangulation.faces
    curvature = angle_defect(faces, corner_angles(after), border)
    error = np.where(border, 0.0, np.abs(curvature - target))
    areas = [vertex_areas(faces, sides, len(border)) for sides in (before, after)]
    triangulation.length = pattern.lengths
    return ExactMetric(
        log_scale=np.log(np.maximum(areas[1] / areas[0], np.finfo(float).tiny)) / 2,
        curvature=curvature,
        triangulation=triangulation,
        flips=flips,
        euclidean_flips=len(flips),
        steps=coherent.steps + pattern.steps,
        residual=float(error.max()),
        worst_vertex=int(error.argmax()),
        converged=coherent.converged and bool(error.max() <= TOLERANCE),
        doubled=False,
    )


def _nearest_angles(
    triangulation: IntrinsicTriangulation, target: FloatArray, border: BoolArray
) -> CoherentAngles:
    angles = corner_angles(triangulation.length.reshape(-1, 3)).ravel()
    return coherent_angles(triangulation, angles, 2 * np.pi - target, ~border)
