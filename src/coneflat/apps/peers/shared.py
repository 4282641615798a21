"""Functions shared by the compared methods: metrics and embeddings at the area of the mesh, and notes on failures."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ... import TriangleMesh
from ...base import FloatArray, IntArray, error_text, plural
from ...errors import ConvergenceError
from ...geometry import IntrinsicTriangulation, angle_defect, corner_angles, double_areas, straight_triangles
from ...stages import ConeSolution, Cut, Embedding, FlatMetric, SolveStatistics


def failure_notes(what: str, steps: int, residual: float, unit: str, accepted: bool) -> tuple[str, ...]:
    """Return the note on a solve that did not converge, if its result is accepted.

    Args:
        what: a clause on the failure, which ends with the quantity of the residual.
        steps: number of Newton steps.
        residual, unit: value and unit of this quantity.
        accepted: whether the result is still accepted.

    Raises:
        ConvergenceError: the result is not accepted, or the residual is not finite.
    """
    failure = f"{what} {error_text(residual, unit)} after {plural(steps, 'step')}"
    if not accepted or not np.isfinite(residual):
        raise ConvergenceError(f"{failure}; method 'exact', other cones, a repair or remeshing may help")
    return (f"{failure[0].upper()}{failure[1:]}.",)


def flat_metric(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    triangulation: IntrinsicTriangulation,
    flat: FloatArray,
    log_scale: FloatArray,
    flips: IntArray,
    steps: int,
) -> FlatMetric:
    """Return a metric on a flipped triangulation, at the area of the mesh; its boundary is free.

    Args:
        mesh: a connected mesh.
        lengths: (m, 3) its side lengths.
        solution: its cones and their curvatures.
        triangulation: the flipped triangulation; its lengths are set to the flat ones.
        flat: (3m,) flat lengths.
        log_scale: (n,) phi, up to a constant.
        flips: flipped half-edges, in order.
        steps: number of Newton steps.
    """
    border, faces = mesh.is_boundary_vertex, triangulation.faces
    curvature = angle_defect(faces, corner_angles(flat.reshape(-1, 3)), border)
    error = np.where(border, 0.0, np.abs(curvature - solution.target))
    triangulation.length = flat
    statistics = SolveStatistics(newton_steps=steps, euclidean_flips=len(flips), residual=float(error.max()))
    return FlatMetric(
        mesh=mesh,
        lengths=lengths,
        cones=solution.cones,
        target=np.where(border, curvature, solution.target),
        log_scale=log_scale,
        is_open=border,
        is_fixed=np.zeros(len(border), dtype=bool),
        statistics=statistics,
        triangles=straight_triangles(triangulation, flips, len(mesh.faces)),
    ).scaled(float(np.sqrt(double_areas(lengths).sum() / double_areas(flat.reshape(-1, 3)).sum())))


def embedding_metric(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    embed: Callable[[Cut], Embedding],
    has_target_cones: bool = True,
) -> FlatMetric:
    """Return the metric object of a method that maps the cut mesh directly; its boundary is free.

    Args:
        mesh: a connected mesh.
        lengths: (m, 3) side lengths.
        solution: the cones and their curvatures.
        embed: maps the cut mesh.
        has_target_cones: whether the method prescribes the cones' curvatures.
    """
    return FlatMetric(
        mesh=mesh,
        lengths=lengths,
        cones=solution.cones,
        target=solution.target,
        log_scale=solution.log_scale,
        is_open=mesh.is_boundary_vertex,
        is_fixed=np.zeros(len(mesh.vertices), dtype=bool),
        embed=embed,
        has_target_cones=has_target_cones,
    )
