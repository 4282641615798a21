"""What methods that solve for a metric have in common: its size, and what is said if it did not converge."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray
from ..conformal.exact import ExactMetric
from ..cones import ConeSolution
from ..errors import ConvergenceError
from ..geometry import double_areas
from ..mesh import TriangleMesh
from .exact import ExactFlatMetric


def at_own_area(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    solved: ExactMetric,
    failure: str | None,
    best_effort: bool,
) -> ExactFlatMetric:
    """Return a metric, to be scaled to the area of the mesh, where the boundary is free.

    Args:
        mesh: connected.
        lengths: (m, 3) its side lengths.
        solution: its cones and their curvatures.
        solved: the metric.
        failure: how it fell short, a clause; None if it did not.
        best_effort: note that instead of refusing the metric.

    Raises:
        ConvergenceError: it fell short.
    """
    notes: tuple[str, ...] = ()
    if failure is not None:
        if not best_effort:
            raise ConvergenceError(
                f"{failure}; --best-effort takes it as it is, --method exact is surer, other cones or remeshing may help"
            )
        notes = (f"{failure[0].upper()}{failure[1:]}.",)
    flat = solved.triangulation.length.reshape(-1, 3)
    copies = len(flat) / len(mesh.faces)  # 2 where the surface was doubled
    shrink = float(np.sqrt(copies * double_areas(lengths).sum() / double_areas(flat).sum()))
    target = np.where(mesh.is_boundary_vertex, solved.curvature, solution.target)
    return ExactFlatMetric(mesh, solution.cones, target, solved, shrink, False, notes)
