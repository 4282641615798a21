"""The ways from cones to a layout: each a flat metric that knows how to lay itself out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from ._arrays import BoolArray, FloatArray, IntArray
from .cones import ConeSolution
from .conformal.boundary import BoundaryCurvature
from .conformal.exact import ExactMetric, exact_metric
from .conformal.linear import scaled_lengths
from .errors import ConvergenceError
from .figures import SolveFigures
from .geometry import angle_defect, corner_angles, double_areas, is_broken
from .layout import least_squares_layout
from .layout.straighten import FlatTriangles, straight_triangles
from .layout.unfold import unfold
from .layout.untangle import untangle
from .mesh import TriangleMesh

# The curvature of a round boundary is found from the metric it leads to, over and over: rounds at most, and the
# change relative to the largest one at which to stop. Waiting for less is in vain: disks have a family of maps
# to themselves, along which the iteration drifts. What is solved for in the end is exact in any case.
ROUNDS, ROUND_CHANGE = 15, 1e-3


class FlatMetric(Protocol):
    """A flat metric on a connected mesh.

    Attributes:
        log_scale: (n,) phi; flat lengths are about l * exp(phi).
        target, curvature: (n,) curvature wanted and reached, radians.
        figures: how it was found.
    """

    @property
    def log_scale(self) -> FloatArray: ...
    @property
    def target(self) -> FloatArray: ...
    @property
    def curvature(self) -> FloatArray: ...
    @property
    def figures(self) -> SolveFigures: ...

    def lay_out(self, disk: TriangleMesh, seams: IntArray) -> tuple[FloatArray, SolveFigures]:
        """Return points (c, 2) for the vertices of the cut mesh, and the figures with the layout's own."""
        ...


@dataclass(frozen=True)
class LinearFlatMetric:
    """The paper's: one linear system, lengths by an edge integral, layout by least squares."""

    mesh: TriangleMesh
    lengths: FloatArray
    log_scale: FloatArray
    target: FloatArray
    curvature: FloatArray
    figures: SolveFigures

    def lay_out(self, disk: TriangleMesh, seams: IntArray) -> tuple[FloatArray, SolveFigures]:
        """Return the least squares reconstruction, at the scale of the metric."""
        points = least_squares_layout(disk, self.lengths)
        one, two = (points[disk.faces[:, k]] - points[disk.faces[:, 0]] for k in (1, 2))
        area = np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]).sum()
        return points * np.sqrt(double_areas(self.lengths).sum() / area), self.figures


def linear_metric(
    mesh: TriangleMesh, lengths: FloatArray, solution: ConeSolution, rule: str
) -> LinearFlatMetric:
    """Return the paper's metric (Section 2.3) for cones and their log scale."""
    scaled = scaled_lengths(lengths, mesh.faces, solution.log_scale, rule)
    shrink = float(np.sqrt(double_areas(lengths).sum() / double_areas(scaled).sum()))
    scaled *= shrink
    curvature = angle_defect(mesh.faces, corner_angles(scaled), mesh.is_boundary_vertex)
    figures = SolveFigures(broken=int(is_broken(scaled).sum()))
    return LinearFlatMetric(
        mesh, scaled, solution.log_scale + np.log(shrink), solution.target, curvature, figures
    )


@dataclass(frozen=True)
class ExactFlatMetric:
    """Discretely conformal without curvature error; it unfolds, so the layout needs no system at all."""

    mesh: TriangleMesh
    flat: FlatTriangles
    cones: IntArray
    scale: float
    log_scale: FloatArray
    target: FloatArray
    curvature: FloatArray
    figures: SolveFigures

    def lay_out(self, disk: TriangleMesh, seams: IntArray) -> tuple[FloatArray, SolveFigures]:
        """Turn over what is inverted on its straight sides, and unfold."""
        mesh = self.mesh
        cut = mesh.is_boundary_edge.copy()
        cut[seams] = True
        pinned = np.zeros(len(mesh.vertices), dtype=bool)
        pinned[self.cones] = True
        on_seam = np.zeros(len(mesh.vertices), dtype=bool)
        on_seam[mesh.edges[seams]] = True
        untangled = untangle(self.flat, mesh.faces, pinned, on_seam, mesh.is_boundary_vertex)
        figures = replace(
            self.figures,
            untangled_triangles=int(self.flat.is_inverted.sum()),
            untangled_vertices=len(untangled.moved),
            untangled_move=untangled.largest_move,
        )
        points = unfold(untangled.flat, disk.faces, cut[mesh.halfedge_edges])
        return points * self.scale, figures


@dataclass(frozen=True)
class ExactChoices:
    """What is prescribed for an exact metric.

    Attributes:
        scale_at_cones: phi = 0 at the cones, whose curvatures come out; else their curvatures are prescribed.
        boundary: curvature wanted on the boundary; None leaves it free, phi = 0 there.
        keep_area: scale the metric to the area of the input; else phi stays 0 on a free boundary, whose
            lengths are then kept.
        best_effort: return a metric that did not converge.
        names: (n,) what the user calls each vertex.
    """

    scale_at_cones: bool
    boundary: BoundaryCurvature | None
    keep_area: bool
    best_effort: bool
    names: IntArray


def solve_exact(
    mesh: TriangleMesh, lengths: FloatArray, solution: ConeSolution, choices: ExactChoices
) -> ExactFlatMetric:
    """Return the exact discrete conformal metric that the linear solution is the first step to.

    Raises:
        ConvergenceError: the solve ends short of its tolerance, unless `best_effort`.
        CurvatureError: no metric has the curvatures.
    """
    fixed = np.zeros(len(mesh.vertices), dtype=bool)
    if choices.scale_at_cones:
        fixed[solution.cones] = True
    if choices.boundary is None:
        fixed |= mesh.is_boundary_vertex
    solved, target = _solve(mesh, lengths, solution, choices.boundary, fixed)
    if not (solved.converged or choices.best_effort):
        raise ConvergenceError(
            f"the exact metric did not converge: after {solved.steps} steps the curvature at vertex "
            f"{choices.names[solved.worst_vertex]} is off by {solved.residual:.2g} rad; "
            "--best-effort takes it as it is, --metric linear needs no convergence, --repair or remeshing may help"
        )
    flat = straight_triangles(solved.triangulation, solved.flips, len(mesh.faces) if solved.doubled else None)
    flat_lengths = solved.triangulation.length.reshape(-1, 3)
    copies = len(flat_lengths) / len(mesh.faces)
    shrink = 1.0
    if choices.keep_area:
        shrink = float(np.sqrt(copies * double_areas(lengths).sum() / double_areas(flat_lengths).sum()))
    figures = SolveFigures(
        newton_steps=solved.steps,
        euclidean_flips=solved.euclidean_flips,
        ptolemy_flips=solved.ptolemy_flips,
        residual=solved.residual,
    )
    return ExactFlatMetric(
        mesh,
        flat,
        solution.cones,
        shrink,
        solved.log_scale + np.log(shrink),
        np.where(fixed, solved.curvature, target),
        solved.curvature,
        figures,
    )


def _solve(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    boundary: BoundaryCurvature | None,
    fixed: BoolArray,
) -> tuple[ExactMetric, FloatArray]:
    """Return the metric and the curvature it was solved for; a round boundary follows from the metric."""
    inside = np.where(mesh.is_boundary_vertex, 0.0, solution.target)
    if boundary is None:
        return exact_metric(mesh, lengths, inside, fixed=fixed, start=solution.log_scale), inside
    wanted = inside + boundary.target(lengths, solution.log_scale)
    solved = exact_metric(mesh, lengths, wanted, fixed=fixed, start=solution.log_scale)
    for _ in range(ROUNDS if boundary.has_round_loops else 0):
        before, wanted = wanted, inside + boundary.target(lengths, solved.log_scale)
        if not solved.converged or np.abs(wanted - before).max() < ROUND_CHANGE * np.abs(wanted).max():
            return solved, before
        solved = exact_metric(mesh, lengths, wanted, fixed=fixed, start=solved.log_scale)
    return solved, wanted
