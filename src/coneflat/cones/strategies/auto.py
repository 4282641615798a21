"""Strategy "auto": the sparse search, except where it would take too long or the boundary has a prescribed shape."""

from __future__ import annotations

from dataclasses import replace

from ...mesh.connectivity import TriangleMesh
from ...stages import ConeSolution, ConeSpec
from ..sparse.limits import MAX_SEARCHED
from ..surface import ConeSurface
from .greedy import place_greedy
from .prescribed import place_prescribed
from .sparse import place_sparse


def place_automatically(surface: ConeSurface, spec: ConeSpec) -> ConeSolution:
    """Return the cones of the strategy that suits a surface; see `find_cones`."""
    mesh = surface.mesh
    if uses_sparse_search(mesh, spec):
        return place_sparse(surface, spec)
    if has_many_handles(mesh, spec):
        note = f"The greedy search chose the cones, because {mesh.genus():,} handles need so many of them."
        return replace(place_greedy(surface, spec), notes=(note,))
    return place_prescribed(surface, spec)


def uses_sparse_search(mesh: TriangleMesh, spec: ConeSpec) -> bool:
    """Return whether the sparse search is used for the cones of a mesh.

    Args:
        mesh: connected mesh.
        spec: what is required of the cones.
    """
    return spec.strategy == "sparse" or (
        spec.strategy == "auto"
        and (spec.needs_sparse_search or not (spec.prescribes_boundary or has_many_handles(mesh, spec)))
    )


def has_many_handles(mesh: TriangleMesh, spec: ConeSpec) -> bool:
    """Return whether a mesh has so many handles that the sparse search would take too long for the required cones."""
    if spec.needs_sparse_search or mesh.is_boundary_vertex.any():
        return False
    # Each handle except one needs two cones of angle 4 pi.
    return -mesh.euler_characteristic > MAX_SEARCHED // 2
