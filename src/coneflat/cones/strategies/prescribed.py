"""Strategy "prescribed": the cones that the user chose, with the best curvatures where none are prescribed."""

from __future__ import annotations

from dataclasses import replace

from ...stages import ConeSolution, ConeSpec
from ..prescribed import fitted_cones
from ..solution import check_solution
from ..surface import ConeSurface
from .none import place_none


def place_prescribed(surface: ConeSurface, spec: ConeSpec) -> ConeSolution:
    """Return the prescribed cones, none if they are on other components; see `find_cones`.

    Curvatures that are not prescribed are fitted. On a straight boundary they are its corners.
    """
    if not (len(spec.prescribed) or spec.searches_corners):
        return place_none(surface, spec)
    mesh = surface.mesh
    solution = fitted_cones(
        surface.linear_model(spec),
        mesh.euler_characteristic,
        spec.prescribed.vertices,
        spec.prescribed.curvatures,
        min_cone_angle=spec.min_angle,
        max_cone_angle=spec.max_angle,
    )
    solution = replace(solution, cones=solution.cones[~mesh.is_boundary_vertex[solution.cones]])
    check_solution(solution, mesh, spec, "add cones or move them")
    return solution
