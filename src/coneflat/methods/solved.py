"""What methods that solve for a metric on other triangles have in common."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray
from ..cones import ConeSolution
from ..conformal.exact import ExactMetric
from ..mesh import TriangleMesh
from .exact import ExactFlatMetric, area_factor


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
