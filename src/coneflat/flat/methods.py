"""The flat metric of a connected mesh that the options name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TypeAlias

import numpy as np

from .._arrays import BoolArray, FloatArray
from ..cones import ConeSolution
from ..cones.choose import Surface, Turned
from ..errors import ConvergenceError, OptionError
from ..geometry.handles import open_turning
from ..input.constraints import Constraints
from ..mesh import TriangleMesh
from ..options import Options
from .base import FlatMetric
from .exact.boundary import prescribed_boundary, straight_boundary
from .exact.flatten import ExactChoices, ExactFlatMetric, exact_flattening
from .exact.handles import corrected_flattening
from .linear import linear_flattening


def find_metric(
    surface: Surface, solution: ConeSolution, constraints: Constraints, options: Options
) -> FlatMetric:
    """Return the flat metric that the options name."""
    mesh, lengths = surface.mesh, surface.lengths
    if options.method == "linear":
        return linear_flattening(mesh, lengths, solution)
    if options.method != "exact":
        metric = other_method(options.method)(mesh, lengths, solution, options.best_effort)
        if isinstance(metric, ExactFlatMetric):
            return replace(metric, split=options.split and options.lengths is None)
        return metric
    choices = _exact_choices(surface, solution, constraints, options)
    if options.correct_handles and options.quantise is not None:
        if not held_boundary(mesh, constraints, options).any():
            turning = open_turning(mesh, holes=True)
            try:
                if len(turning.loops) > 2 * mesh.genus():
                    return corrected_flattening(lengths, solution, choices, turning, options.quantise)
            except ConvergenceError:
                # Triangles cannot turn as far; handles alone may.
                pass
        if mesh.genus():
            return corrected_flattening(lengths, solution, choices, open_turning(mesh), options.quantise)
    # What is known is the same, bit for bit, as what the metric would find.
    flipped = surface.delaunay if surface.is_kept or "delaunay" in surface.__dict__ else None
    return exact_flattening(mesh, lengths, solution, choices, flipped)


def turning_meter(surface: Surface, constraints: Constraints, options: Options) -> Turned | None:
    """Return what tells by how much loops across handles turn with given cones; None where nobody asks."""
    if options.quantise is None or options.method != "exact" or not surface.mesh.genus():
        return None
    mesh, turning = surface.mesh, open_turning(surface.mesh)
    plain = replace(options, correct_handles=False, best_effort=True)

    def turned(solution: ConeSolution) -> FloatArray:
        choices = _exact_choices(surface, solution, constraints, plain)
        return turning.of_flat(exact_flattening(mesh, surface.lengths, solution, choices).straight())

    return turned


def _exact_choices(
    surface: Surface, solution: ConeSolution, constraints: Constraints, options: Options
) -> ExactChoices:
    mesh, lengths = surface.mesh, surface.lengths
    boundary = None
    if mesh.is_boundary_vertex.any():
        if options.boundary_kind == "straight":
            boundary = straight_boundary(mesh, solution.target)
        elif options.boundary_kind == "disk" or len(constraints.corners):
            boundary = prescribed_boundary(
                mesh,
                lengths,
                float(solution.curvatures.sum()),
                constraints.corners.vertices,
                constraints.corners.curvatures,
                constraints.names,
            )
    return ExactChoices(
        scale_at_cones=options.scale_at_cones,
        boundary=boundary,
        kept=_kept_boundary(mesh, constraints, options),
        # Both sides of a marked seam are to have the same length.
        keep_area=options.boundary_kind != "lengths" and not options.marks_seams,
        best_effort=options.best_effort,
        refine=options.refine,
        # The positions of new vertices would tell nothing of lengths that are given.
        split=options.split and options.lengths is None,
        names=constraints.names,
    )


def held_boundary(mesh: TriangleMesh, constraints: Constraints, options: Options) -> BoolArray:
    """Return (n,) the boundary vertices that stay where the metric has them: their shape or lengths are prescribed."""
    if options.boundary_kind in ("disk", "straight") or len(constraints.corners):
        return mesh.is_boundary_vertex
    return _kept_boundary(mesh, constraints, options)


def _kept_boundary(mesh: TriangleMesh, constraints: Constraints, options: Options) -> BoolArray:
    """Return (n,) the boundary vertices between which lengths stay: on marked seams, so that both sides are equal."""
    if options.boundary_kind == "lengths":
        return mesh.is_boundary_vertex
    if constraints.on_marks is None:
        return np.zeros(len(mesh.vertices), dtype=bool)
    return mesh.is_boundary_vertex & constraints.on_marks


#: Takes a connected mesh, its (m, 3) side lengths, cones with their curvatures, and whether a result that did not
#: converge is wanted nevertheless.
Method: TypeAlias = Callable[[TriangleMesh, FloatArray, ConeSolution, bool], FlatMetric]


def other_method(name: str) -> Method:
    """Return the method of a name.

    Raises:
        OptionError: there is none of that name.
    """
    match name:
        case "circle-patterns" | "circle-patterns/fixed":
            from .circle_patterns.flatten import circle_patterns

            return partial(circle_patterns, delaunay=name == "circle-patterns")
        case "ricci":
            from .ricci import ricci_flow

            return ricci_flow
        case "linear-abf" | "linear-abf/free":
            from .angle_based.flatten import angle_based, linear_angles

            cones = "prescribed" if name == "linear-abf" else "free"
            return partial(angle_based, solve=linear_angles, cones=cones)
        case "abf++" | "abf++/free":
            from .angle_based.flatten import angle_based, nearest_angles

            return partial(
                angle_based, solve=nearest_angles, cones="prescribed" if name == "abf++" else "free"
            )
        case "lscm":
            from .disk_maps import least_squares_conformal, map_cut_mesh

            return partial(map_cut_mesh, name="LSCM", place=least_squares_conformal)
        case "spectral":
            from .disk_maps import map_cut_mesh, spectral_conformal

            return partial(map_cut_mesh, name="the spectral method", place=spectral_conformal)
        case "bff":
            from .bff import boundary_first

            return boundary_first
    raise OptionError(f"unknown method {name!r}")
