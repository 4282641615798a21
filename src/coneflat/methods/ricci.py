"""Discrete Ricci flow by circle packings with inversive distances."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray
from ..cones import ConeSolution
from ..conformal.exact import exact_metric
from ..conformal.packing import FixedPackingProblem, PackingProblem
from ..geometry import is_broken
from ..mesh import TriangleMesh
from ..text import plural
from .base import failure_notes, off_by
from .exact import ExactFlatMetric, at_own_area


def ricci_flow(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    best_effort: bool = False,
    flips: bool = True,
) -> ExactFlatMetric:
    """Return the flat metric of a circle packing with the inversive distances of the input's.

    Args:
        mesh: connected.
        lengths: (m, 3) side lengths, model units.
        solution: cones with their curvatures; on the boundary, which is free, radii stay as they are.
        best_effort: return a metric that did not converge.
        flips: solve on the intrinsic Delaunay triangulation, and keep it weighted Delaunay. Without, as first
            published, on the input's own, where a solution need not exist.

    Raises:
        ConvergenceError: no metric was found, unless `best_effort`.
        CurvatureError: no metric has the curvatures.

    Notes:
        M. Jin, J. Kim, X. Gu, "Discrete surface Ricci flow: theory and applications", 2007, minimised by Newton's
        method; inversive distances after R. Guo, "Local rigidity of inversive distance circle packing", 2011,
        and F. Luo, "Rigidity of polyhedral surfaces III", 2011; flips after A. Bobenko and C. Lutz, "Decorated
        discrete conformal maps and convex polyhedral cusps", 2023.
    """
    solved = exact_metric(
        mesh,
        lengths,
        np.where(mesh.is_boundary_vertex, 0.0, solution.target),
        fixed=mesh.is_boundary_vertex,
        start=solution.log_scale,
        kind=PackingProblem if flips else FixedPackingProblem,
        delaunay=flips,
    )
    failure = None
    if not solved.converged:
        broken = int(is_broken(solved.triangulation.length.reshape(-1, 3)).sum())
        failure = (
            f"the Ricci flow did not converge: after {plural(solved.steps, 'step')} the curvature is "
            f"{off_by(solved.residual)}, and {plural(broken, 'triangle')} broke the triangle inequality"
        )
    return at_own_area(
        mesh,
        lengths,
        solution,
        solved,
        failure_notes(failure, best_effort and bool(np.isfinite(solved.residual))),
    )
