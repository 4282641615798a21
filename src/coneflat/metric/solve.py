"""The exact method: no curvature error, seams equal on both sides, no flipped triangle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.text import off_by, plural
from ..errors import ConvergenceError
from ..geometry import double_areas
from ..geometry.intrinsic import IntrinsicTriangulation
from ..geometry.straight import FlatTriangles
from ..mesh.connectivity import TriangleMesh
from ..stages import ConeSolution, FlatMetric, SolveStatistics
from .boundary import BoundaryCurvature
from .exact import ExactMetric, exact_metric

# The curvature of a round boundary is found from the metric it leads to, over and over: rounds at most, and the
# largest relative change at a vertex at which to stop. What is solved for in the end is exact in any case.
MAX_ROUNDS, ROUND_TOLERANCE = 40, 1e-3
# How much of the change is made in each round on holes. The m-th harmonic of the change answers with -1/m there, so
# that the first would go back and forth for ever; on the outer loop the answer is 1/m.
HOLE_STEP = 0.5
# Relative errors of lengths that rounding cannot make.
LENGTH_TOLERANCE = 1e-9
# Curvature, radians, at a vertex of a round boundary that is not part of a circle any more but a corner too sharp to be
# one: the sides beside it are nearly all of the boundary. Then the round before has to do.
TOO_SHARP = 0.99 * np.pi


@dataclass(frozen=True, eq=False)
class ExactChoices:
    """What is prescribed for an exact metric, and how it is laid out.

    Attributes:
        scale_at_cones: phi = 0 at the cones, whose curvatures come out; else their curvatures are prescribed.
        boundary: curvature wanted on the boundary; None leaves it free, phi = 0 there.
        kept: (n,) boundary vertices between which lengths are kept: phi = 0 there whatever is wanted, and
            untangling does not move them. None for none.
        keep_area: scale the metric to the area of the input; else phi stays 0 on a free boundary, whose
            lengths are then kept.
        accepts_failure: return a metric that did not converge.
        names: (n,) what the user calls each vertex; None if he has no other numbers.
    """

    scale_at_cones: bool = True
    boundary: BoundaryCurvature | None = None
    rigid: BoolArray | None = None
    keep_area: bool = True
    accepts_failure: bool = False
    names: IntArray | None = None

    def is_open(self, mesh: TriangleMesh) -> BoolArray:
        """(n,) boundary vertices whose curvature comes out, as phi = 0 there."""
        if self.boundary is None:
            return mesh.is_boundary_vertex.copy()
        return np.zeros(len(mesh.vertices), dtype=bool) if self.rigid is None else self.rigid.copy()

    def is_held(self, mesh: TriangleMesh) -> BoolArray:
        """(n,) boundary vertices that must stay where the metric has them."""
        if self.boundary is not None:
            return mesh.is_boundary_vertex.copy()
        return np.zeros(len(mesh.vertices), dtype=bool) if self.rigid is None else self.rigid.copy()


def exact_flat_metric(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    choices: ExactChoices,
    flipped: tuple[IntrinsicTriangulation, IntArray] | None = None,
) -> FlatMetric:
    """Return the exact discrete conformal metric that the linear solution is the first step to.

    Args:
        mesh: connected.
        lengths: (m, 3) side lengths, model units.
        solution: cones, target curvatures and the linear log scale.
        choices: what is prescribed.
        flipped: the intrinsic Delaunay triangulation and the half-edges flipped for it, if something has them already.

    Raises:
        ConvergenceError: the solve ends short of its tolerance, unless that is accepted.
        CurvatureError: no metric has the curvatures.
    """
    is_open = choices.is_open(mesh)
    fixed = is_open.copy()
    if choices.scale_at_cones:
        fixed[solution.cones] = True
    solved, target = _solve(mesh, lengths, solution, choices, fixed, flipped)
    if not solved.converged and not (choices.accepts_failure and np.isfinite(solved.residual)):
        worst = solved.worst_vertex if choices.names is None else choices.names[solved.worst_vertex]
        raise ConvergenceError(
            f"the exact metric did not converge: after {solved.steps} steps the curvature at vertex {worst} is "
            f"{off_by(solved.residual)}; --method linear needs no convergence, and other cones, --repair or remeshing "
            "may help"
        )
    triangles = solved.straight()
    return FlatMetric(
        mesh=mesh,
        lengths=lengths,
        cones=solution.cones,
        target=np.where(fixed, solved.curvature, target),
        log_scale=solved.log_scale,
        is_open=is_open,
        is_held=choices.is_held(mesh),
        statistics=statistics_of(solved),
        notes=_length_notes(mesh, lengths, solved, triangles, choices),
        triangles=triangles,
    ).scaled(area_factor(lengths, solved) if choices.keep_area else 1.0)


def statistics_of(solved: ExactMetric) -> SolveStatistics:
    """Return how a metric was found."""
    return SolveStatistics(
        newton_steps=solved.steps,
        euclidean_flips=solved.euclidean_flips,
        ptolemy_flips=solved.ptolemy_flips,
        residual=solved.residual,
    )


def _length_notes(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solved: ExactMetric,
    flat: FlatTriangles,
    choices: ExactChoices,
) -> tuple[str, ...]:
    """Return how many lengths on the boundary could not be kept, if so: flipped edges are none of the metric."""
    if choices.rigid is None or not solved.doubled:
        return ()
    sides = mesh.edge_halfedges[mesh.is_boundary_edge & choices.rigid[mesh.edges].all(axis=1), 0]
    off = np.abs(np.abs(flat.sides[sides]) / lengths.ravel()[sides] - 1)
    missed = int(np.count_nonzero(off > LENGTH_TOLERANCE))
    if not missed:
        return ()
    return (
        f"{plural(missed, 'edge')} of {len(sides):,} on the boundary or on marked seams could not keep their lengths, "
        f"which are off by up to {off.max():.2g} of them: triangles are too coarse there for the curvature around. "
        "Remesh there, or allow more cones.",
    )


def area_factor(lengths: FloatArray, solved: ExactMetric) -> float:
    """Return the factor of lengths that brings a metric to the area of a mesh with given (m, 3) side lengths."""
    flat = solved.triangulation.length.reshape(-1, 3)
    copies = len(flat) / len(lengths)  # 2 where the surface was doubled
    return float(np.sqrt(copies * double_areas(lengths).sum() / double_areas(flat).sum()))


def _solve(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    choices: ExactChoices,
    fixed: BoolArray,
    flipped: tuple[IntrinsicTriangulation, IntArray] | None,
) -> tuple[ExactMetric, FloatArray]:
    """Return the metric and the curvature it was solved for; a round boundary follows from the metric."""
    boundary = choices.boundary

    inverse = solution.inverse
    if inverse is not None and not np.array_equal(inverse.is_zero, fixed):
        inverse = None

    def solve(wanted: FloatArray, start: FloatArray) -> ExactMetric:
        return exact_metric(
            mesh, lengths, wanted, fixed=fixed, start=start, preconditioner=inverse, flipped=flipped
        )

    inside = np.where(mesh.is_boundary_vertex, 0.0, solution.target)
    if boundary is None:
        return solve(inside, solution.log_scale), inside
    wanted = boundary.target(lengths, solution.log_scale)
    if _is_too_sharp(boundary, wanted):
        # By the linear scale one side of the boundary is nearly all of it, as on a field of spikes.
        wanted = boundary.target(lengths, np.zeros_like(solution.log_scale))
    solved = solve(inside + wanted, solution.log_scale)
    step = np.where(wanted < 0, HOLE_STEP, 1.0)
    for _ in range(MAX_ROUNDS if boundary.has_round_loops else 0):
        change = boundary.target(lengths, solved.log_scale) - wanted
        if not solved.converged or not (np.abs(change) > ROUND_TOLERANCE * np.abs(wanted)).any():
            break
        rounder = wanted + step * change
        if _is_too_sharp(boundary, rounder):
            break
        again = solve(inside + rounder, solved.log_scale)
        if not again.converged:
            break
        wanted, solved = rounder, again
    return solved, inside + wanted


def _is_too_sharp(boundary: BoundaryCurvature, wanted: FloatArray) -> bool:
    """Whether a round boundary would have a corner; those that the user gives do not count."""
    return boundary.has_round_loops and bool((wanted[boundary.corners == 0] >= TOO_SHARP).any())
