"""The exact method: the curvature is exact, and both sides of a seam have equal lengths.

Its straight triangles may be flipped in the plane, where `layout` untangles them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.notes import Unmet
from ..base.text import error_text, plural
from ..errors import ConvergenceError
from ..geometry import double_areas
from ..geometry.intrinsic import IntrinsicTriangulation
from ..geometry.straight import FlatTriangles
from ..mesh.connectivity import TriangleMesh
from ..stages import ConeSolution, FlatMetric, MetricSpec, SolveStatistics
from .boundary import BoundaryCurvature
from .exact import ExactMetric, exact_metric

# The curvature of a round boundary depends on the metric, so both are computed alternately: largest number of rounds,
# and the relative change at a vertex at which to stop. The final curvature is attained exactly in any case.
MAX_ROUNDS, ROUND_TOLERANCE = 40, 1e-3
# Fraction of the change that is applied in each round on holes. A change of the m-th harmonic leads to a change of
# -1/m of it in the next round, so the first harmonic would oscillate forever; on the outer loop the factor is 1/m.
HOLE_STEP = 0.5
# Relative error of lengths that is larger than rounding errors.
LENGTH_TOLERANCE = 1e-9
# Curvature, radians, above which a vertex of a round boundary is a sharp corner and not part of a circle: its two sides
# make up nearly all of the boundary. The result of the previous round is then used.
TOO_SHARP = 0.99 * np.pi


@dataclass(eq=False)
class ExactSolver:
    """A solver for exact discrete conformal metrics of a mesh, of the same boundary and several side lengths or cones.

    Attributes:
        mesh: the connected mesh.
        spec: the options of the metric.
        boundary: prescribed curvature of the boundary; None for a free boundary with phi = 0.
        is_doubled: an earlier solve glued the surface to its mirror image, so that later ones begin so.
    """

    mesh: TriangleMesh
    spec: MetricSpec
    boundary: BoundaryCurvature | None = None
    is_doubled: bool = False

    def metric(
        self,
        lengths: FloatArray,
        solution: ConeSolution,
        flipped: tuple[IntrinsicTriangulation, IntArray] | None = None,
        steps: int = 200,
    ) -> FlatMetric:
        """Return the exact discrete conformal metric; the solve starts from the linear solution.

        Args:
            lengths: (m, 3) side lengths, model units.
            solution: cones, target curvatures and the linear log conformal factor.
            flipped: the intrinsic Delaunay triangulation and the half-edges flipped for it, if known.
            steps: maximum number of Newton steps of each attempt.

        Raises:
            ConvergenceError: the solve did not reach its tolerance, and `spec` does not accept it.
            CurvatureError: no metric has the curvatures.
        """
        mesh, spec, boundary = self.mesh, self.spec, self.boundary
        # Vertices that keep lengths have phi = 0 even on a boundary of prescribed curvature.
        is_open = mesh.is_boundary_vertex if boundary is None else spec.keeps_length
        fixed = is_open.copy()
        if spec.scale_at_cones:
            fixed[solution.cones] = True
        solved, target = self._solve(lengths, solution, fixed, flipped, steps)
        if not solved.converged and not (spec.accepts_failure and np.isfinite(solved.residual)):
            worst = spec.names[solved.worst_vertex]
            raise ConvergenceError(
                f"the exact metric did not converge: after {solved.steps} steps the curvature at vertex {worst} is "
                f"{error_text(solved.residual)}; --method linear needs no convergence, and other cones, --repair or "
                "remeshing may help"
            )
        triangles, factor = solved.straight(), 1.0
        if spec.keeps_area:
            flat = double_areas(solved.triangulation.length.reshape(-1, 3))
            factor = float(np.sqrt(double_areas(lengths).mean() / flat.mean()))  # the surface may be doubled
        return FlatMetric(
            mesh=mesh,
            lengths=lengths,
            cones=solution.cones,
            target=np.where(fixed, solved.curvature, target),
            log_scale=solved.log_scale,
            is_open=is_open,
            is_fixed=spec.keeps_length if boundary is None else mesh.is_boundary_vertex,
            statistics=SolveStatistics(
                newton_steps=solved.steps,
                euclidean_flips=solved.euclidean_flips,
                ptolemy_flips=solved.ptolemy_flips,
                residual=solved.residual,
            ),
            notes=_length_notes(mesh, lengths, solved, triangles, spec.keeps_length),
            triangles=triangles,
        ).scaled(factor)

    def _solve(
        self,
        lengths: FloatArray,
        solution: ConeSolution,
        fixed: BoolArray,
        flipped: tuple[IntrinsicTriangulation, IntArray] | None,
        steps: int,
    ) -> tuple[ExactMetric, FloatArray]:
        """Return the metric and its target curvature (n,), which for a round boundary depends on the metric."""
        cached = solution.inverse
        inverse = cached if cached is not None and np.array_equal(cached.is_zero, fixed) else None
        mesh, boundary = self.mesh, self.boundary
        solve_once = partial(
            exact_metric, mesh, lengths, fixed=fixed, preconditioner=inverse, flipped=flipped, max_steps=steps
        )

        def solve(target: FloatArray, start: FloatArray) -> ExactMetric:
            solved = solve_once(target, start=start, doubled=self.is_doubled)
            self.is_doubled = solved.doubled
            return solved

        inside = np.where(mesh.is_boundary_vertex, 0.0, solution.target)
        if boundary is None:
            return solve(inside, start=solution.log_scale), inside
        prescribed = boundary.target(lengths, solution.log_scale)
        if _is_too_sharp(boundary, prescribed):
            # With the linear scale, one side makes up nearly all of the boundary, as on a surface of many spikes.
            prescribed = boundary.target(lengths, np.zeros_like(solution.log_scale))
        solved = solve(inside + prescribed, start=solution.log_scale)
        step = np.where(prescribed < 0, HOLE_STEP, 1.0)
        for _ in range(MAX_ROUNDS if boundary.has_round_loops else 0):
            change = boundary.target(lengths, solved.log_scale) - prescribed
            if not solved.converged or not (np.abs(change) > ROUND_TOLERANCE * np.abs(prescribed)).any():
                break
            rounder = prescribed + step * change
            if _is_too_sharp(boundary, rounder):
                break
            resolved = solve(inside + rounder, start=solved.log_scale)
            if not resolved.converged:
                break
            prescribed, solved = rounder, resolved
        return solved, inside + prescribed


def _length_notes(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solved: ExactMetric,
    flat: FlatTriangles,
    keeps_length: BoolArray,
) -> tuple[str, ...]:
    """Return a note with the number of boundary edges that should have kept their lengths; empty if there are none.

    This happens if the surface was doubled, as boundary edges are then flipped and not edges of the metric.
    """
    if not solved.doubled:
        return ()
    sides = mesh.edge_halfedges[mesh.is_boundary_edge & keeps_length[mesh.edges].all(axis=1), 0]
    off = np.abs(np.abs(flat.sides[sides]) / lengths.ravel()[sides] - 1)
    missed = int(np.count_nonzero(off > LENGTH_TOLERANCE))
    if not missed:
        return ()
    note = (
        f"{plural(missed, 'edge')} of {len(sides):,} on the boundary or on marked seams could not keep their lengths, "
        f"with relative errors of up to {off.max():.2g}: the triangles there are too coarse for the curvature nearby. "
        "Remesh there, or allow more cones."
    )
    return (Unmet(note),)


def _is_too_sharp(boundary: BoundaryCurvature, prescribed: FloatArray) -> bool:
    """Return whether a round boundary would have a sharp corner that the user did not prescribe."""
    return boundary.has_round_loops and bool((prescribed[boundary.corners == 0] >= TOO_SHARP).any())
