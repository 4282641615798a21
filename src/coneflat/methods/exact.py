"""The exact method: no curvature error, seams equal on both sides, no flipped triangle."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from ..cones import ConeSolution
from ..conformal.boundary import BoundaryCurvature
from ..conformal.exact import ExactMetric, exact_metric
from ..figures import SolveFigures
from ..geometry import angle_defect, double_areas
from ..geometry.planar import signed_angles
from ..layout.straighten import FlatTriangles, straight_triangles
from ..layout.unfold import unfold
from ..layout.untangle import untangle
from ..mesh import TriangleMesh
from ..seams import cut_open
from .base import LaidOut, all_faces, failure_notes, off_by

# The curvature of a round boundary is found from the metric it leads to, over and over: rounds at most, and the
# largest relative change at a vertex at which to stop. What is solved for in the end is exact in any case.
ROUNDS, ROUND_CHANGE = 40, 1e-3
# How much of the change is made in each round on holes. The m-th harmonic of the change answers with -1/m there, so
# that the first would go back and forth for ever; on the outer loop the answer is 1/m.
HOLE_STEP = 0.5
# Curvature, radians, at a vertex of a round boundary that is no part of a circle any more but a corner too sharp to be
# one: the sides beside it are nearly all of the boundary. Then the round before has to do.
TOO_SHARP = 0.99 * np.pi
# Radians by which the curvature of a round boundary may be off a circle's before it is said.
NOT_ROUND = 0.01


@dataclass(frozen=True, eq=False)
class ExactChoices:
    """What is prescribed for an exact metric, and how it is laid out.

    Attributes:
        scale_at_cones: phi = 0 at the cones, whose curvatures come out; else their curvatures are prescribed.
        boundary: curvature wanted on the boundary; None leaves it free, phi = 0 there.
        keep_area: scale the metric to the area of the input; else phi stays 0 on a free boundary, whose
            lengths are then kept.
        best_effort: return a metric that did not converge.
        refine: lay out the common subdivision instead of the mesh's own triangles on straight sides.
        names: (n,) what the user calls each vertex; None if he has no other numbers.
    """

    scale_at_cones: bool = True
    boundary: BoundaryCurvature | None = None
    keep_area: bool = True
    best_effort: bool = False
    refine: bool = False
    names: IntArray | None = None


@dataclass(frozen=True, eq=False)
class ExactFlatMetric:
    """An exact metric on the mesh.

    Attributes:
        mesh: the mesh.
        cones: (s,) cone vertices.
        target: (n,) curvature that was prescribed, or came out where the scale was.
        solved: the metric.
        shrink: factor that brings it to the wanted size.
        refine: lay out the common subdivision.
        notes: what falls short of what was wanted.
    """

    mesh: TriangleMesh
    cones: IntArray
    target: FloatArray
    solved: ExactMetric
    shrink: float
    refine: bool
    notes: tuple[str, ...] = ()

    @property
    def figures(self) -> SolveFigures:
        """How the metric was found."""
        return SolveFigures(
            newton_steps=self.solved.steps,
            euclidean_flips=self.solved.euclidean_flips,
            ptolemy_flips=self.solved.ptolemy_flips,
            residual=self.solved.residual,
        )

    def lay_out(self, disk: TriangleMesh, seams: IntArray) -> LaidOut:
        """Unfold the metric; on the mesh's own triangles, after turning over what is inverted there."""
        return self._lay_out_refined(seams) if self.refine else self._lay_out_straight(disk, seams)

    def _lay_out_straight(self, disk: TriangleMesh, seams: IntArray) -> LaidOut:
        mesh, solved = self.mesh, self.solved
        flat = self.straight()
        cut = mesh.is_boundary_edge.copy()
        cut[seams] = True
        pinned, on_seam = np.zeros((2, len(mesh.vertices)), dtype=bool)
        pinned[self.cones] = True
        on_seam[mesh.edges[seams]] = True
        untangled = untangle(flat, mesh.faces, pinned, on_seam, mesh.is_boundary_vertex)
        return LaidOut(
            mesh=mesh,
            face_origin=all_faces(mesh),
            points=unfold(untangled.flat, disk.faces, cut[mesh.halfedge_edges]) * self.shrink,
            corners=disk.faces,
            cones=self.cones,
            seams=mesh.edges[seams],
            log_scale=solved.log_scale + np.log(self.shrink),
            target=self.target,
            curvature=curvature_on(mesh, untangled.flat),
            figures=replace(
                self.figures,
                untangled_triangles=int(flat.is_inverted.sum()),
                untangled_vertices=len(untangled.moved),
                untangled_move=untangled.largest_move,
            ),
            notes=self.notes,
        )

    def straight(self) -> FlatTriangles:
        """Return the input's triangles with straight sides in the metric."""
        return straight_triangles(self.solved.triangulation, self.solved.flips, len(self.mesh.faces))

    def _lay_out_refined(self, seams: IntArray) -> LaidOut:
        from ..layout.refine import refine

        refined = refine(self.mesh, self.solved)
        mesh, edges = refined.mesh, refined.edges_on(seams)
        disk = cut_open(mesh, edges).mesh
        cut = mesh.is_boundary_edge.copy()
        cut[edges] = True
        return LaidOut(
            mesh=mesh,
            face_origin=refined.face_origin,
            points=unfold(refined.flat, disk.faces, cut[mesh.halfedge_edges]) * self.shrink,
            corners=disk.faces,
            cones=self.cones,
            seams=mesh.edges[edges],
            log_scale=refined.log_scale + np.log(self.shrink),
            target=np.concatenate([self.target, np.zeros(len(mesh.vertices) - len(self.target))]),
            curvature=curvature_on(mesh, refined.flat),
            figures=replace(self.figures, refined_triangles=len(mesh.faces) - len(self.mesh.faces)),
            notes=self.notes,
        )


def curvature_on(mesh: TriangleMesh, flat: FlatTriangles) -> FloatArray:
    """Return (n,) the curvature of flat triangles as they are laid out; the angles of inverted ones are negative."""
    return angle_defect(mesh.faces, signed_angles(flat.sides.reshape(-1, 3)), mesh.is_boundary_vertex)


def exact_flattening(
    mesh: TriangleMesh, lengths: FloatArray, solution: ConeSolution, choices: ExactChoices
) -> ExactFlatMetric:
    """Return the exact discrete conformal metric that the linear solution is the first step to.

    Args:
        mesh: connected.
        lengths: (m, 3) side lengths, model units.
        solution: cones, target curvatures and the linear log scale.
        choices: what is prescribed.

    Raises:
        ConvergenceError: the solve ends short of its tolerance, unless `best_effort`.
        CurvatureError: no metric has the curvatures.
    """
    fixed = np.zeros(len(mesh.vertices), dtype=bool)
    if choices.scale_at_cones:
        fixed[solution.cones] = True
    if choices.boundary is None:
        fixed |= mesh.is_boundary_vertex
    solved, target = _solve(mesh, lengths, solution, choices, fixed)
    failure = None
    if not solved.converged:
        worst = solved.worst_vertex if choices.names is None else choices.names[solved.worst_vertex]
        failure = (
            f"the exact metric did not converge: after {solved.steps} steps the curvature at vertex {worst} is "
            f"{off_by(solved.residual)}"
        )
    notes = failure_notes(
        failure,
        choices.best_effort and bool(np.isfinite(solved.residual)),
        "--method linear needs no convergence",
    )
    notes += _missed_roundness(lengths, solved, choices, target)
    shrink = area_factor(lengths, solved) if choices.keep_area else 1.0
    target = np.where(fixed, solved.curvature, target)
    return ExactFlatMetric(mesh, solution.cones, target, solved, shrink, choices.refine, notes)


def area_factor(lengths: FloatArray, solved: ExactMetric) -> float:
    """Return the factor of lengths that brings a metric to the area of a mesh with given (m, 3) side lengths."""
    flat = solved.triangulation.length.reshape(-1, 3)
    copies = len(flat) / len(lengths)  # 2 where the surface was doubled
    return float(np.sqrt(copies * double_areas(lengths).sum() / double_areas(flat).sum()))


def at_own_area(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    solved: ExactMetric,
    notes: tuple[str, ...] = (),
) -> ExactFlatMetric:
    """Return a metric, to be scaled to the area of the mesh, with what came out at the free boundary for its target.

    Args:
        mesh: connected.
        lengths: (m, 3) its side lengths.
        solution: its cones and their curvatures.
        solved: the metric.
        notes: how it fell short.
    """
    target = np.where(mesh.is_boundary_vertex, solved.curvature, solution.target)
    return ExactFlatMetric(mesh, solution.cones, target, solved, area_factor(lengths, solved), False, notes)


def _solve(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    choices: ExactChoices,
    fixed: BoolArray,
) -> tuple[ExactMetric, FloatArray]:
    """Return the metric and the curvature it was solved for; a round boundary follows from the metric."""
    boundary = choices.boundary

    inverse = solution.inverse
    if inverse is not None and not np.array_equal(inverse.is_zero, fixed):
        inverse = None

    def solve(wanted: FloatArray, start: FloatArray) -> ExactMetric:
        # The common subdivision is that of the mesh's own conformal class, without flips before the solve.
        flips = not choices.refine
        return exact_metric(
            mesh, lengths, wanted, fixed=fixed, start=start, delaunay=flips, preconditioner=inverse
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
    for _ in range(ROUNDS if boundary.has_round_loops else 0):
        change = boundary.target(lengths, solved.log_scale) - wanted
        if not solved.converged or not (np.abs(change) > ROUND_CHANGE * np.abs(wanted)).any():
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


def _missed_roundness(
    lengths: FloatArray, solved: ExactMetric, choices: ExactChoices, target: FloatArray
) -> tuple[str, ...]:
    """Return that a round boundary is none, if so."""
    if choices.boundary is None or not choices.boundary.has_round_loops:
        return ()
    even = choices.boundary.target(lengths, solved.log_scale)
    on_round = choices.boundary.mesh.is_boundary_vertex & (choices.boundary.corners == 0)
    off = np.where(on_round, np.abs(even - target), 0.0)
    worst = int(np.argmax(off))
    if not off[worst] > NOT_ROUND:
        return ()
    name = worst if choices.names is None else choices.names[worst]
    return (
        f"The boundary is not quite round: at vertex {name} it turns by {target[worst]:.3g} rad, a circle "
        f"by {even[worst]:.3g}.",
    )
