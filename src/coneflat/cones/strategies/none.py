"""Strategy "none": no cones; also where no vertex may be one."""

from __future__ import annotations

import numpy as np

from ...stages import ConeSolution, ConeSpec, Surface
from ..prescribed import cones_at
from ..solution import check_solution
from ..surface import ConeSurface

NO_CONES = np.empty(0, dtype=np.int64)


def place_none(surface: ConeSurface, spec: ConeSpec) -> ConeSolution:
    """Return the solution without cones, in which the boundary absorbs all curvature; see `find_cones`."""
    mesh = surface.mesh
    solution = cones_at(
        surface.laplacian, surface.curvature, mesh.is_boundary_vertex, mesh.euler_characteristic, NO_CONES
    )
    check_solution(solution, mesh, spec, "add cones or move them")
    return solution


def coneless_solution(surface: Surface, spec: ConeSpec) -> ConeSolution | None:
    """Return the solution without cones if no vertex may be a cone and no cone is needed; else None.

    Args:
        surface: connected mesh with its operators.
        spec: what is required of the cones.
    """
    absorbs, chi = spec.absorbs_curvature, surface.mesh.euler_characteristic
    is_searched = len(spec.required) or (spec.is_allowed & ~absorbs).any()
    if is_searched or not (absorbs.any() or chi == 0):
        return None
    return cones_at(surface.laplacian, surface.curvature, absorbs, chi, NO_CONES)
