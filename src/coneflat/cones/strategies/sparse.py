"""Strategy "sparse": the fewest cones for the allowed distortion, or the best cones of the requested number."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...base.arrays import IntArray
from ...base.notes import Unmet
from ...base.text import plural
from ...mesh.connectivity import TriangleMesh
from ...stages import ConeSolution, ConeSpec
from ..sparse import ConeSearch, SparseCones
from ..sparse.limits import MAX_SEARCHED
from ..surface import ConeSurface
from .none import NO_CONES, coneless_solution

if TYPE_CHECKING:
    from ..integer.search import QuantisedCones

# Relative excess of the distortion over the requested one up to which there is no note.
RELATIVE_TOLERANCE = 1e-3
# Largest factor by which E may grow when cones are moved to align the rotations along handles.
HOLONOMY_FACTOR = 1.15


def place_sparse(surface: ConeSurface, spec: ConeSpec) -> ConeSolution:
    """Return the fewest cones for the allowed distortion, or the best cones of the requested number; see `find_cones`.

    Cones at the boundary are corners of a straight boundary, whose curvature is part of the target.
    """
    mesh = surface.mesh
    coneless = coneless_solution(surface, spec)
    if coneless is not None:
        return replace(coneless, notes=unmet_requests(mesh, coneless.cones, 0.0, spec))
    if needs_no_cone(surface, spec):
        return surface.linear_model(spec).solution_of(NO_CONES, np.empty(0))
    search = surface.search(spec)
    result: SparseCones | QuantisedCones
    if spec.quantum is not None:
        result = quantised_cones(surface, search, spec, spec.quantum)
    elif spec.count is not None:
        result = search.best_of(spec.count)
    else:
        result = search.fewest(spec.distortion, spec.max_count)
    solution = result.solution
    cones = solution.cones[~mesh.is_boundary_vertex[solution.cones]]
    notes = unmet_requests(mesh, cones, result.distortion, spec)
    return replace(solution, cones=cones, notes=notes)


def needs_no_cone(surface: ConeSurface, spec: ConeSpec) -> bool:
    """Return whether the distortion without cones is allowed, on a surface whose boundary absorbs the curvature.

    Most sheets are such. A search, which is set up first, would take twice the time of the rest on a leaf of eight
    triangles.
    """
    has_requests = spec.count is not None or spec.quantum is not None or len(spec.required)
    if has_requests or not spec.absorbs_curvature.any():
        return False
    return surface.linear_model(spec).distortion <= spec.distortion


def quantised_cones(
    surface: ConeSurface, search: ConeSearch, spec: ConeSpec, quantum: float
) -> QuantisedCones:
    """Return cones whose curvatures are multiples of a quantum; those on handles are moved to align rotations."""
    from ...geometry.handles import loop_holonomy
    from ..integer.alignment import align_handles
    from ..integer.search import quantise_cones

    quantised = quantise_cones(
        search, quantum, distortion=spec.distortion, count=spec.count, max_count=spec.max_count
    )
    if spec.rotations is None:
        return quantised
    bound = quantised.distortion * HOLONOMY_FACTOR
    if spec.count is None:
        bound = max(bound, spec.distortion)
    by_scale = loop_holonomy(surface.mesh).by_log_scale(surface.lengths)
    return align_handles(search, quantised, by_scale, spec.rotations, bound)


def unmet_requests(
    mesh: TriangleMesh, cones: IntArray, distortion: float, spec: ConeSpec
) -> tuple[Unmet, ...]:
    """Return notes if the requested number of cones or distortion is not met, one sentence each.

    Args:
        mesh: connected mesh.
        cones: (s,) those that were found; on the boundary they do not count.
        distortion: the area distortion that remains.
        spec: what is required of the cones.
    """
    cone_count, genus = int((~mesh.is_boundary_vertex[cones]).sum()), mesh.genus()
    if spec.count is not None:
        if cone_count == spec.count:
            return ()
        reason = (
            "within the given bounds, more cones would not reduce the distortion, or there is no inner vertex for "
            "them"
        )
        if spec.count > cone_count >= MAX_SEARCHED:
            reason = f"searches place {MAX_SEARCHED} at most, in addition to required ones"
        return (Unmet(f"{plural(cone_count, 'cone')} instead of the {spec.count:,} asked for: {reason}."),)
    if distortion <= spec.distortion * (1 + RELATIVE_TOLERANCE):
        return ()
    reason = "no better cones were found within the given bounds"
    if spec.quantum is not None and genus and distortion <= spec.distortion * HOLONOMY_FACTOR:
        reason = "cones were moved to align the rotations along handles"
    note = (
        f"The area distortion is {distortion:.3g} with {plural(cone_count, 'cone')}, above the "
        f"{spec.distortion:g} allowed: {reason}."
    )
    return (Unmet(note),)
