"""Strategy "greedy": the cones of the paper's search."""

from __future__ import annotations

from ...mesh.ties import mesh_tie_key
from ...stages import ConeSolution, ConeSpec
from ..greedy import greedy_cones
from ..solution import check_solution
from ..surface import ConeSurface


def place_greedy(surface: ConeSurface, spec: ConeSpec) -> ConeSolution:
    """Return the cones of the paper's search; see `find_cones`."""
    mesh = surface.mesh
    solution = greedy_cones(
        surface.laplacian,
        surface.curvature,
        mesh.is_boundary_vertex,
        mesh.euler_characteristic,
        max_cones=spec.max_count,
        tie_key=mesh_tie_key(mesh),
    )
    check_solution(solution, mesh, spec, "allow more of them (--max-cones)")
    return solution
