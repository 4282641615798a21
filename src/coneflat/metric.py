"""The flat metric of a connected mesh that the options name."""

from __future__ import annotations

import numpy as np

from ._arrays import BoolArray
from .choose import Surface
from .cones import ConeSolution
from .conformal.boundary import prescribed_boundary, straight_boundary
from .conformal.turning import open_turning
from .mesh import TriangleMesh
from .methods import ExactChoices, FlatMetric, exact_flattening, linear_flattening
from .methods.handles import corrected_flattening
from .methods.others import other_method
from .options import Options
from .wishes import Wishes


def find_metric(surface: Surface, solution: ConeSolution, wishes: Wishes, options: Options) -> FlatMetric:
    """Return the flat metric that the options name."""
    mesh, lengths = surface.mesh, surface.lengths
    if options.method == "linear":
        return linear_flattening(mesh, lengths, solution, options.length_rule)
    if options.method != "exact":
        return other_method(options.method)(mesh, lengths, solution, options.best_effort)
    boundary = None
    if mesh.is_boundary_vertex.any():
        if options.boundary_kind == "straight":
            boundary = straight_boundary(mesh, solution.target)
        elif options.boundary_kind == "disk" or len(wishes.corners):
            boundary = prescribed_boundary(
                mesh,
                lengths,
                float(solution.curvatures.sum()),
                wishes.corners.vertices,
                wishes.corners.curvatures,
                wishes.names,
            )
    choices = ExactChoices(
        scale_at_cones=options.scale_at_cones,
        boundary=boundary,
        kept=_kept_boundary(mesh, wishes, options),
        # Both sides of a marked seam are to have the same length.
        keep_area=options.boundary_kind != "lengths" and not options.marks_seams,
        best_effort=options.best_effort,
        refine=options.refine,
        names=wishes.names,
    )
    if options.correct_handles and options.quantum is not None and mesh.genus():
        return corrected_flattening(lengths, solution, choices, open_turning(mesh), options.quantum)
    return exact_flattening(mesh, lengths, solution, choices)


def _kept_boundary(mesh: TriangleMesh, wishes: Wishes, options: Options) -> BoolArray:
    """Return (n,) the boundary vertices between which lengths stay: on marked seams, so that both sides are equal."""
    if options.boundary_kind == "lengths":
        return mesh.is_boundary_vertex
    if wishes.on_marks is None:
        return np.zeros(len(mesh.vertices), dtype=bool)
    return mesh.is_boundary_vertex & wishes.on_marks
