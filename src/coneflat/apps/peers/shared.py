"""The metric of the compared methods, which map the cut mesh directly."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ... import TriangleMesh
from ...base import FloatArray
from ...stages import ConeSolution, Cut, Embedding, FlatMetric


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
