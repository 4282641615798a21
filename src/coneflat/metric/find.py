"""The flat metric of a connected mesh for its cones, with the requested method and boundary."""

from __future__ import annotations

from collections.abc import Callable

from ..base.arrays import FloatArray
from ..base.progress import stage
from ..errors import ConvergenceError
from ..geometry.handles import loop_holonomy
from ..stages import ConeSolution, FlatMetric, MetricSpec, Surface
from .boundary import BoundaryCurvature, prescribed_boundary, straight_boundary
from .corrected import corrected_flat_metric, triangles_of
from .linear import linear_flat_metric
from .solve import ExactSolver


@stage("metric")
def find_metric(surface: Surface, solution: ConeSolution, spec: MetricSpec, steps: int = 200) -> FlatMetric:
    """Return the flat metric of a connected mesh for its cones.

    Args:
        surface: the mesh with its side lengths.
        solution: cones, target curvatures and the linear log conformal factor.
        spec: the options of the metric.
        steps: maximum number of Newton steps of each attempt at an exact metric without a quantum.

    Raises:
        ConvergenceError: the exact metric was not found.
        CurvatureError: no metric has the curvatures.
        MetricError: the linear metric overflows.
    """
    mesh, lengths, quantum = surface.mesh, surface.lengths, spec.quantum
    if spec.method == "linear":
        return linear_flat_metric(mesh, lengths, solution)
    solver = ExactSolver(mesh, spec, _boundary(surface, solution, spec))
    if quantum is not None:
        if solver.boundary is None and not spec.keeps_length.any():
            holonomy = loop_holonomy(mesh, holes=True)
            try:
                if len(holonomy.loops) > 2 * mesh.genus():
                    return corrected_flat_metric(lengths, solution, solver.metric, holonomy, quantum)
            except ConvergenceError:
                # Triangles cannot be sheared enough; correcting the handles alone may succeed.
                pass
        if mesh.genus():
            return corrected_flat_metric(lengths, solution, solver.metric, loop_holonomy(mesh), quantum)
    delaunay = surface.delaunay if surface.is_reused else surface.known_delaunay
    return solver.metric(lengths, solution, delaunay, steps)


def loop_rotations(surface: Surface, spec: MetricSpec) -> Callable[[ConeSolution], FloatArray] | None:
    """Return a function from cones to the holonomy of loops across the handles in their metric, (2 genus,) radians.

    None for a linear metric, and for a mesh without handles.

    Args:
        surface: connected mesh with its operators.
        spec: specification of its metric.
    """
    if spec.method != "exact" or not surface.mesh.genus():
        return None
    holonomy, plain = loop_holonomy(surface.mesh), spec.plain()

    return lambda solution: holonomy.of_flat(triangles_of(find_metric(surface, solution, plain)))


def _boundary(surface: Surface, solution: ConeSolution, spec: MetricSpec) -> BoundaryCurvature | None:
    """Return the prescribed curvature of the boundary, or None."""
    if spec.boundary == "straight":
        return straight_boundary(surface.mesh, solution.target)
    if spec.boundary in ("disk", "polygon"):
        total = float(solution.curvatures.sum())
        corners = spec.corners.vertices, spec.corners.curvatures
        return prescribed_boundary(surface.mesh, surface.lengths, total, *corners, spec.names)
    return None
