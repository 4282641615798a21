"""The exact method: no curvature error, seams equal on both sides, no flipped triangle."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..._arrays import BoolArray, FloatArray, IntArray, rows_of
from ...cones import ConeSolution
from ...geometry import double_areas
from ...geometry.intrinsic import IntrinsicTriangulation
from ...geometry.straight import FlatTriangles
from ...layout.unfold import unfold
from ...layout.untangle import Untangled, untangle
from ...mesh import TriangleMesh
from ...quality.statistics import SolveStatistics
from ...seams import cut_open
from ...text import plural
from ..base import Cuts, LaidOut, all_faces, failure_notes, laid_out_curvature, off_by
from .boundary import BoundaryCurvature
from .metric import ExactMetric, exact_metric

if TYPE_CHECKING:
    from ...layout.refine import Refinement

# The curvature of a round boundary is found from the metric it leads to, over and over: rounds at most, and the
# largest relative change at a vertex at which to stop. What is solved for in the end is exact in any case.
ROUNDS, ROUND_CHANGE = 40, 1e-3
# How much of the change is made in each round on holes. The m-th harmonic of the change answers with -1/m there, so
# that the first would go back and forth for ever; on the outer loop the answer is 1/m.
HOLE_STEP = 0.5
# Relative errors of lengths that rounding cannot make.
LENGTH_TOLERANCE = 1e-9
# Curvature, radians, at a vertex of a round boundary that is no part of a circle any more but a corner too sharp to be
# one: the sides beside it are nearly all of the boundary. Then the round before has to do.
TOO_SHARP = 0.99 * np.pi
# Share of triangles inverted on straight sides above which moving vertices alone seldom helps them all, and takes long
# if they are more than a few.
MANY, FEW = 0.01, 100


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
        best_effort: return a metric that did not converge.
        refine: lay out the common subdivision instead of the mesh's own triangles on straight sides.
        split: cut triangles that are inverted on straight sides and cannot be turned over.
        names: (n,) what the user calls each vertex; None if he has no other numbers.
    """

    scale_at_cones: bool = True
    boundary: BoundaryCurvature | None = None
    kept: BoolArray | None = None
    keep_area: bool = True
    best_effort: bool = False
    refine: bool = False
    split: bool = False
    names: IntArray | None = None

    def is_open(self, mesh: TriangleMesh) -> BoolArray:
        """(n,) boundary vertices whose curvature comes out, as phi = 0 there."""
        if self.boundary is None:
            return mesh.is_boundary_vertex.copy()
        return np.zeros(len(mesh.vertices), dtype=bool) if self.kept is None else self.kept.copy()

    def is_held(self, mesh: TriangleMesh) -> BoolArray:
        """(n,) boundary vertices that must stay where the metric has them."""
        if self.boundary is not None:
            return mesh.is_boundary_vertex.copy()
        return np.zeros(len(mesh.vertices), dtype=bool) if self.kept is None else self.kept.copy()


@dataclass(frozen=True, eq=False)
class ExactFlatMetric:
    """An exact metric on the mesh.

    Attributes:
        mesh: the mesh.
        cones: (s,) cone vertices.
        target: (n,) curvature that was prescribed, or came out where the scale was.
        is_open, is_held: (n,) boundary vertices whose curvature may come out as it will, and those that must stay.
        solved: the metric.
        shrink: factor that brings it to the wanted size.
        refine: lay out the common subdivision.
        split: cut triangles that are inverted on straight sides and cannot be turned over.
        notes: what falls short of what was wanted.
    """

    mesh: TriangleMesh
    cones: IntArray
    target: FloatArray
    is_open: BoolArray
    is_held: BoolArray
    solved: ExactMetric
    shrink: float
    refine: bool = False
    split: bool = False
    notes: tuple[str, ...] = ()

    @property
    def statistics(self) -> SolveStatistics:
        """How the metric was found."""
        return SolveStatistics(
            newton_steps=self.solved.steps,
            euclidean_flips=self.solved.euclidean_flips,
            ptolemy_flips=self.solved.ptolemy_flips,
            residual=self.solved.residual,
        )

    def lay_out(self, disk: TriangleMesh, seams: IntArray) -> LaidOut:
        """Unfold the metric; on the mesh's own triangles, after turning over what is inverted there."""
        if self.refine:
            return self._lay_out_refined(seams)
        straight = self.straight()
        few = np.count_nonzero(straight.is_inverted) <= max(MANY * len(self.mesh.faces), FEW)
        if few or not self.split:
            untangled = self._untangled(straight, seams)
            if not (self.split and len(untangled.left)):
                return self._lay_out_straight(disk, seams, straight, untangled)
        return self._lay_out_split(disk, seams, straight)

    def _untangled(
        self, straight: FlatTriangles, seams: IntArray, whole: BoolArray | None = None
    ) -> Untangled:
        """Return the triangles with what can be turned over turned over; see `untangle`."""
        mesh = self.mesh
        pinned, on_seam = self.is_held.copy(), np.zeros(len(mesh.vertices), dtype=bool)
        pinned[self.cones] = True
        on_seam[mesh.edges[seams]] = True
        angles = np.where(mesh.is_boundary_vertex, np.pi, 2 * np.pi) - self.target
        return untangle(straight, mesh.faces, angles, pinned, on_seam, mesh.is_boundary_vertex, whole)

    def _lay_out_straight(
        self, disk: TriangleMesh, seams: IntArray, straight: FlatTriangles, untangled: Untangled
    ) -> LaidOut:
        mesh, solved = self.mesh, self.solved
        points = unfold(untangled.flat, disk.faces) * self.shrink
        curvature = laid_out_curvature(mesh, rows_of(points, disk.faces))
        return LaidOut(
            mesh=mesh,
            face_origin=all_faces(mesh),
            points=points,
            corners=disk.faces,
            cones=self.cones,
            seams=mesh.edges[seams],
            log_scale=solved.log_scale + np.log(self.shrink),
            # Where the boundary is free, what comes out is what was wanted.
            target=np.where(self.is_open, curvature, self.target),
            curvature=curvature,
            statistics=self._untangling(straight, untangled),
            notes=self.notes,
        )

    def _untangling(self, straight: FlatTriangles, untangled: Untangled) -> SolveStatistics:
        return replace(
            self.statistics,
            untangled_triangles=int(straight.is_inverted.sum()),
            untangled_vertices=len(untangled.moved),
            untangled_move=untangled.largest_move,
        )

    def straight(self) -> FlatTriangles:
        """Return the input's triangles with straight sides in the metric."""
        return self.solved.straight()

    def _lay_out_refined(self, seams: IntArray) -> LaidOut:
        from ...layout.refine import refine

        refined = refine(self.mesh, self.solved)
        added = len(refined.mesh.faces) - len(self.mesh.faces)
        return self._lay_out_pieces(refined, seams, replace(self.statistics, refined_triangles=added))

    def _lay_out_split(self, disk: TriangleMesh, seams: IntArray, straight: FlatTriangles) -> LaidOut:
        """Lay out with edges cut where they must bend, as far as no vertices can be moved instead."""
        from ...layout.mend import mend, overlay_straight

        overlaid = overlay_straight(self.mesh, self.solved)
        cuts = overlaid.is_whole_outside
        untangled = self._untangled(straight, seams, overlaid.whole if cuts else None)
        if not (cuts and len(untangled.left)):
            return self._lay_out_straight(disk, seams, straight, untangled)
        mended = mend(overlaid, straight, untangled.flat)
        added = len(mended.mesh.faces) - len(self.mesh.faces)
        statistics = replace(
            self._untangling(straight, untangled),
            untangled_triangles=int(straight.is_inverted.sum() - untangled.flat.is_inverted.sum()),
            split_triangles=added,
        )
        return self._lay_out_pieces(mended, seams, statistics)

    def _lay_out_pieces(self, refined: Refinement, seams: IntArray, statistics: SolveStatistics) -> LaidOut:
        mesh, edges = refined.mesh, refined.edges_on(seams)
        disk = cut_open(mesh, edges).mesh
        points = unfold(refined.flat, disk.faces) * self.shrink
        curvature, added = (
            laid_out_curvature(mesh, rows_of(points, disk.faces)),
            len(mesh.vertices) - len(self.target),
        )
        target = np.concatenate([self.target, np.zeros(added)])
        is_open = np.concatenate([self.is_open, np.zeros(added, dtype=bool)])
        return LaidOut(
            mesh=mesh,
            face_origin=refined.face_origin,
            points=points,
            corners=disk.faces,
            cones=self.cones,
            seams=mesh.edges[edges],
            log_scale=refined.log_scale + np.log(self.shrink),
            target=np.where(is_open, curvature, target),
            curvature=curvature,
            statistics=statistics,
            cuts=Cuts(self.mesh.edges[refined.crossing_edges], refined.crossing_weights, refined.edge_origin),
            notes=self.notes,
        )


def exact_flattening(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    choices: ExactChoices,
    flipped: tuple[IntrinsicTriangulation, IntArray] | None = None,
) -> ExactFlatMetric:
    """Return the exact discrete conformal metric that the linear solution is the first step to.

    Args:
        mesh: connected.
        lengths: (m, 3) side lengths, model units.
        solution: cones, target curvatures and the linear log scale.
        choices: what is prescribed.
        flipped: the intrinsic Delaunay triangulation and the half-edges flipped for it, if something has them already.

    Raises:
        ConvergenceError: the solve ends short of its tolerance, unless `best_effort`.
        CurvatureError: no metric has the curvatures.
    """
    fixed = np.zeros(len(mesh.vertices), dtype=bool)
    if choices.scale_at_cones:
        fixed[solution.cones] = True
    is_open = choices.is_open(mesh)
    fixed |= is_open
    solved, target = _solve(mesh, lengths, solution, choices, fixed, flipped)
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
    notes += _lengths_missed(mesh, lengths, solved, choices)
    shrink = area_factor(lengths, solved) if choices.keep_area else 1.0
    target = np.where(fixed, solved.curvature, target)
    return ExactFlatMetric(
        mesh,
        solution.cones,
        target,
        is_open,
        choices.is_held(mesh),
        solved,
        shrink,
        choices.refine,
        choices.split,
        notes,
    )


def _lengths_missed(
    mesh: TriangleMesh, lengths: FloatArray, solved: ExactMetric, choices: ExactChoices
) -> tuple[str, ...]:
    """Return how many lengths on the boundary could not be kept, if so: flipped edges are none of the metric."""
    if choices.kept is None or not solved.doubled:
        return ()
    sides = mesh.edge_halfedges[mesh.is_boundary_edge & choices.kept[mesh.edges].all(axis=1), 0]
    flat = solved.straight()
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
    is_open, is_held = mesh.is_boundary_vertex, np.zeros(len(mesh.vertices), dtype=bool)
    shrink = area_factor(lengths, solved)
    return ExactFlatMetric(mesh, solution.cones, target, is_open, is_held, solved, shrink, notes=notes)


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
        # The common subdivision is that of the mesh's own conformal class, without flips before the solve.
        flips = not choices.refine
        return exact_metric(
            mesh,
            lengths,
            wanted,
            fixed=fixed,
            start=start,
            delaunay=flips,
            preconditioner=inverse,
            flipped=flipped if flips else None,
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
