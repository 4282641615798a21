"""What methods that solve for a metric have in common: its size, and what is said if it did not converge."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray
from ..cones import ConeSolution
from ..conformal.exact import ExactMetric
from ..errors import ConvergenceError
from ..geometry import double_areas
from ..mesh import TriangleMesh
from .exact import ExactFlatMetric


def noted(failure: str | None, best_effort: bool) -> tuple[str, ...]:
    """Return how a solve fell short, a clause or None, as notes if the best effort will do.

    Raises:
        ConvergenceError: it will not.
    """
    if failure is None:
        return ()
    if not best_effort:
        raise ConvergenceError(
            f"{failure}; --best-effort takes it as it is, --method exact is surer, other cones or remeshing may help"
        )
    return (f"{failure[0].upper()}{failure[1:]}.",)


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
    flat = solved.triangulation.length.reshape(-1, 3)
    copies = len(flat) / len(mesh.faces)  # 2 where the surface was doubled
    shrink = float(np.sqrt(copies * double_areas(lengths).sum() / double_areas(flat).sum()))
    target = np.where(mesh.is_boundary_vertex, solved.curvature, solution.target)
    return ExactFlatMetric(mesh, solution.cones, target, solved, shrink, False, notes)
