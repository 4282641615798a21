"""Angle based flattening, linear and to the end, with cones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ..._arrays import FloatArray, IntArray
from ...cones import ConeSolution
from ...errors import OptionError
from ...geometry import corner_angles
from ...layout.least_squares import fit_shapes, shapes_of_angles
from ...mesh import TriangleMesh
from ...quality.statistics import SolveStatistics
from ...text import plural
from ..base import LaidOut, failure_notes, laid_out_at, off_by
from .conditions import (
    AngleConditions,
    AngleStep,
    FoundAngles,
    angle_conditions,
    excess_of,
    least_change,
    wanted_angles,
)

#: What is asked of the angles around cones: to sum to what is prescribed, with lengths that match across seams; or
#: nothing, the mesh being cut first: the seams are a free boundary then.
CONES = ("prescribed", "free")

Solve: TypeAlias = Callable[[AngleConditions, FloatArray], FoundAngles]


@dataclass(frozen=True, eq=False)
class AngleMetric:
    """Corner angles of a mesh, to be found before or after it is cut.

    Attributes:
        mesh: connected.
        lengths: (m, 3) its side lengths.
        solution: cones.
        solve: finds the angles.
        best_effort: take angles that did not converge.
        found: the angles, and how they fall short; None if the mesh is to be cut first.
    """

    mesh: TriangleMesh
    lengths: FloatArray
    solution: ConeSolution
    solve: Solve
    best_effort: bool
    found: tuple[FoundAngles, tuple[str, ...]] | None

    def lay_out(self, disk: TriangleMesh, seams: IntArray) -> LaidOut:
        """Return the least squares reconstruction, at the mesh's area."""
        if self.found is not None:
            found, notes = self.found
        else:
            found, notes = _find(
                disk, self.lengths, np.zeros(len(disk.vertices)), self.solve, self.best_effort
            )
            if len(seams):
                notes = (
                    "The mesh was cut first: the angles of cones, and lengths along seams, were left free.",
                    *notes,
                )
        shapes = shapes_of_angles(found.angles.reshape(-1, 3))
        broken = int(shapes.is_broken.sum())
        if broken:
            notes = (
                *notes,
                f"{plural(broken, 'triangle')} got an angle below 0: method 'abf++' allows none.",
            )
        statistics = SolveStatistics(newton_steps=found.steps, residual=found.residual, broken=broken)
        points = fit_shapes(disk, shapes, self.lengths)
        return laid_out_at(points, self.mesh, disk, seams, self.lengths, self.solution, statistics, notes)


def angle_based(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    best_effort: bool,
    solve: Solve,
    cones: str = "prescribed",
) -> AngleMetric:
    """Return a metric by angle based flattening.

    Args:
        mesh: connected.
        lengths: (m, 3) side lengths, model units.
        solution: cones and their curvatures.
        best_effort: return a metric that did not converge.
        solve: `linear_angles` (Zayer, Levy, Seidel 2007), which has nothing to converge, or `nearest_angles`, ABF++
            (Sheffer, Levy, Mogilnitsky, Bogomyakov 2005).
        cones: one of `CONES`. Cones as constraints are what the paper leaves to future work; its Table 2 is matched
            with "free" and the linear method: QC means of 1.0076 on fandisk and 1.0260 on rocker-arm for its 1.007
            and 1.027, where the constraints make 1.0116 and 1.0279.

    Raises:
        ConvergenceError: the solve ends short of its tolerance, unless `best_effort`.
        CurvatureError: a cone is too wide for its triangles.
        OptionError: there is no such choice for cones.
    """
    if cones not in CONES:
        raise OptionError(f"unknown choice for cones {cones!r}: choose from {', '.join(CONES)}")
    found = None
    if cones == "prescribed":
        found = _find(mesh, lengths, solution.target, solve, best_effort)
    return AngleMetric(mesh, lengths, solution, solve, best_effort, found)


def _find(
    mesh: TriangleMesh, lengths: FloatArray, curvature: FloatArray, solve: Solve, best_effort: bool
) -> tuple[FoundAngles, tuple[str, ...]]:
    """Return the angles for the given (n,) curvature inside, and how they fall short."""
    wanted = wanted_angles(mesh, corner_angles(lengths), curvature)
    found = solve(angle_conditions(mesh, curvature), wanted)
    failure = None
    if not found.converged:
        failure = (
            f"angle based flattening did not converge: after {plural(found.steps, 'step')} the conditions on angles "
            f"are {off_by(found.residual, '')}"
        )
    return found, failure_notes(failure, best_effort and bool(np.isfinite(found.angles).all()))


# Steps at most; what conditions may be off by in the end, radians and logs; and the largest change of an angle that
# another step would make: conditions are to hold exactly, while a minimum need not be found to the last digits.
STEPS, TOLERANCE, LAST_CHANGE = 100, 1e-9, 1e-6
# Part of the objective's own second derivative that is kept at least, so that each step has a minimum.
CONVEX = 0.1
# How much of the way to 0 or pi a step may take an angle; by how much the weight of one grows that would go farther.
PART, HEAVIER = 0.5, 2.0


def nearest_angles(conditions: AngleConditions, wanted: FloatArray) -> FoundAngles:
    """Return the angles of a flat metric whose differences from those wanted have the least sum of relative squares.

    ABF++ (A. Sheffer, B. Levy, M. Mogilnitsky, A. Bogomyakov, "ABF++: fast and robust angle based flattening", 2005):
    Newton's method for sum w (x - wanted)^2 / 2, w = 1 / wanted^2, with Lagrange multipliers, each system reduced to
    the multipliers of vertices. Products of sines are taken by their logs here: that makes the second derivative of
    the Lagrangian diagonal with nothing neglected, and convergence quadratic where it stays positive.

    A step that would take angles more than half way to 0 or pi is shortened to that, and their weights grow. The
    Lagrangian has a saddle point and no minimum, so that a line search as in `solver.newton` would have no measure.

    Args:
        conditions: to be fulfilled.
        wanted: (3m,) radians, positive and less than pi.
    """
    angles, weights = wanted.copy(), wanted**-2
    sums = len(conditions.totals)
    forces = np.zeros(sums + conditions.ratios.shape[0])
    residual, change = conditions.residual(angles), np.inf
    step: AngleStep | None = None
    for count in range(STEPS + 1):
        bend = -(conditions.ratios.T @ forces[sums:]) / np.sin(angles) ** 2
        step = least_change(
            conditions.slopes(angles),
            conditions.off(angles),
            excess_of(angles),
            np.maximum(weights + bend, CONVEX * weights),
            weights * (angles - wanted),
            step,
        )
        change = float(np.abs(step.change).max())
        converged = residual <= TOLERANCE and change <= LAST_CHANGE
        if converged or count == STEPS or not np.isfinite(change):
            break
        room = PART * np.where(step.change < 0, angles, np.pi - angles)
        goes_far = np.abs(step.change) > room
        part = float((room[goes_far] / np.abs(step.change[goes_far])).min(initial=1.0))
        weights[goes_far] *= HEAVIER
        angles += part * step.change
        forces += part * (step.forces - forces)
        residual = conditions.residual(angles)
    return FoundAngles(angles, count, converged, residual)


# Radians that an angle counts as at least, where the log of its sine is wanted.
TINY = 1e-9


def linear_angles(conditions: AngleConditions, wanted: FloatArray) -> FoundAngles:
    """Return the angles that fulfil the conditions to first order with the least relative change.

    R. Zayer, B. Levy, H.-P. Seidel, "Linear angle based parameterization", 2007: the logarithm of the wheel condition
    is expanded about the wanted angles. With the sums around vertices and in triangles, which are linear, it makes a
    system A x = b in the errors x of these angles; with D, diagonal, of the angles themselves, the D^-1 x of least
    norm is D A^T (A D^2 A^T)^-1 b: one solve. The angles are not bound to be positive, and fulfil wheel
    conditions up to the square of the errors.

    Args:
        conditions: to be fulfilled.
        wanted: (3m,) radians, positive and less than pi.
    """
    off, slopes = conditions.off(wanted), conditions.slopes(wanted)
    step = least_change(slopes, off, excess_of(wanted), wanted**-2, np.zeros_like(wanted))
    angles = wanted + step.change
    return FoundAngles(angles, 1, True, conditions.residual(np.clip(angles, TINY, np.pi - TINY)))
