"""Angle based flattening, linear and to the end, with cones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from .._arrays import FloatArray, IntArray
from ..cones import ConeSolution
from ..conformal.angle_conditions import AngleConditions, FoundAngles, angle_conditions, wanted_angles
from ..errors import OptionError
from ..figures import SolveFigures
from ..geometry import corner_angles
from ..layout.least_squares import fit_shapes, shapes_of_angles
from ..mesh import TriangleMesh
from ..text import plural
from .base import LaidOut, failure_notes, off_by
from .measured import laid_out_at

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
        figures = SolveFigures(newton_steps=found.steps, residual=found.residual, broken=broken)
        points = fit_shapes(disk, shapes, self.lengths)
        return laid_out_at(points, self.mesh, disk, seams, self.solution, figures, notes)


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
