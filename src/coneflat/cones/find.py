"""Cones of a connected mesh by the requested strategy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from ..base.arrays import FloatArray, IntArray
from ..base.notes import Unmet
from ..base.progress import report_detail, stage
from ..base.text import plural
from ..base.threads import MEMORY_BOUND_TRIANGLES
from ..geometry.operators import weighted_areas
from ..mesh.connectivity import TriangleMesh
from ..mesh.ties import mesh_tie_key
from ..stages import ConeSolution, ConeSpec, Surface
from .greedy import greedy_cones
from .prescribed import cones_at, fitted_cones
from .solution import check_enough, check_feasible
from .sparse import ConeSearch, SparseCones
from .sparse.limits import MAX_SEARCHED
from .sparse.linear_model import LinearModel

if TYPE_CHECKING:
    from .integer.search import QuantisedCones

# Cone angle per triangle around a cone, radians, up to which the triangles can realise it with straight sides. It
# is less than pi, since the angle cannot be distributed evenly over the triangles.
CONE_ANGLE_PER_TRIANGLE = 0.6 * np.pi
# On meshes with this number of vertices, a neighbouring vertex is as good for a cone. The corners at a cone, all
# widened by the same factor, must then not exceed this angle. Otherwise a triangle with straight sides may be unable to
# realise its corner, and the search has to be repeated, which takes 14% of the time on a horse of 97,000 triangles.
FINE_VERTICES, MAX_CORNER = 30_000, 0.95 * np.pi
# Relative excess of the distortion over the requested one up to which there is no note.
RELATIVE_TOLERANCE = 1e-3
# Largest factor by which E may grow when cones are moved to align the rotations along handles.
HOLONOMY_FACTOR = 1.15

#: Function that returns the rotations of loops along the handles in the metric of a solution, (2 genus,) radians.
Holonomy: TypeAlias = Callable[[ConeSolution], FloatArray]


@stage("cones")
def find_cones(surface: Surface, spec: ConeSpec, holonomy: Holonomy | None = None) -> ConeSolution:
    """Return cones with their curvatures and linear log conformal factor.

    Args:
        surface: the mesh.
        spec: the options of the cones.
        holonomy: measures rotations along handles; used if curvatures are quantised on a mesh with handles.

    Raises:
        CurvatureError: no metric has the required curvatures.
    """
    mesh = surface.mesh
    too_many_handles = has_many_handles(mesh, spec)
    if uses_sparse_search(mesh, spec):
        return _search(surface, spec, holonomy)
    operators = surface.laplacian, surface.curvature, mesh.is_boundary_vertex, mesh.euler_characteristic
    is_greedy = spec.strategy == "greedy" or too_many_handles
    if is_greedy:
        solution = greedy_cones(
            *operators, max_cones=spec.max_count, tie_key=mesh_tie_key(mesh), progress=report_detail
        )
    elif len(spec.prescribed) or spec.searches_corners:
        solution = _fit_given(surface, spec)
    else:  # "none", or no given cone is on this component
        solution = cones_at(*operators, spec.prescribed.vertices)
    if spec.scale_at_cones:
        check_enough(len(solution.cones), mesh)
    else:
        advice = "allow more of them (--max-cones)" if is_greedy else "add cones or move them"
        check_feasible(solution.cones, solution.curvatures, spec.names, advice)
    if too_many_handles:
        note = f"The greedy search chose the cones, because {mesh.genus():,} handles need so many of them."
        return replace(solution, notes=(note,))
    return solution


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


def leaves_flat_disks(spec: ConeSpec) -> bool:
    """Return whether a flat disk gets no cones by any search: none are requested, and its boundary is free."""
    requests = spec.count, spec.quantum
    is_free = not (spec.prescribes_boundary or spec.searches_corners or spec.strategy == "greedy")
    return (
        is_free
        and not (len(spec.prescribed) or len(spec.required))
        and all(request is None for request in requests)
    )


def has_many_handles(mesh: TriangleMesh, spec: ConeSpec) -> bool:
    """Return whether a mesh has so many handles that the sparse search would take too long for the required cones."""
    if spec.strategy != "auto" or spec.needs_sparse_search or mesh.is_boundary_vertex.any():
        return False
    # Each handle except one needs two cones of angle 4 pi.
    return -mesh.euler_characteristic > MAX_SEARCHED // 2


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
    return cones_at(surface.laplacian, surface.curvature, absorbs, chi, np.empty(0, dtype=np.int64))


def needs_no_cone(surface: Surface, spec: ConeSpec) -> bool:
    """Return whether the distortion without cones is allowed, on a surface whose boundary absorbs the curvature.

    Most sheets are such. A search, which is set up first, would take twice the time of the rest on a leaf of eight
    triangles.
    """
    is_asked = spec.count is None and spec.quantum is None and not len(spec.required)
    if not (is_asked and spec.absorbs_curvature.any()):
        return False
    return linear_model(surface, spec).distortion <= spec.distortion


def open_search(surface: Surface, spec: ConeSpec) -> ConeSearch:
    """Return a search for cones; a cached search of the surface is reused, restricted to the allowed vertices.

    Args:
        surface: connected mesh with its operators.
        spec: what is required of the cones.
    """
    mesh = surface.mesh
    search: ConeSearch | None = surface.memo.get("search")
    if search is not None:
        search.restrict(~search.is_boundary & spec.is_allowed)
        return search
    max_angles = (
        CONE_ANGLE_PER_TRIANGLE * np.bincount(mesh.faces.ravel(), minlength=len(mesh.vertices))
        + np.pi * mesh.is_boundary_vertex
    )
    if len(max_angles) >= FINE_VERTICES:
        max_angles = np.minimum(max_angles, MAX_CORNER / surface.widest)
    search = ConeSearch(
        linear_model(surface, spec),
        mesh.euler_characteristic,
        # A boundary corner of angle a has the curvature pi - a; inner cones use the same bound of curvature.
        min_cone_angle=spec.min_angle + (np.pi if spec.searches_corners else 0.0),
        max_cone_angle=spec.max_angle,
        positive_only=spec.positive_only,
        required=spec.required,
        allowed=spec.is_allowed,
        max_angles=max_angles.astype(np.float64),
    )
    search.progress = report_detail
    if len(mesh.faces) <= MEMORY_BOUND_TRIANGLES:  # else it would use too much memory
        surface.memo["search"] = search
    return search


def close_search(surface: Surface) -> None:
    """Delete the cached search for cones of a surface, which uses much memory."""
    surface.memo.pop("search", None)


def linear_model(surface: Surface, spec: ConeSpec) -> LinearModel:
    """Return the linear model of cones at vertices that do not absorb curvature, with the weights of `spec` in E.

    The last model is cached, unless the mesh is huge: its factorization is valid for other weights, too.
    """
    share, absorbs = weighted_areas(surface.areas, spec.weights), spec.absorbs_curvature
    linear: LinearModel | None = surface.memo.get("linear")
    if linear is not None and np.array_equal(linear.is_boundary, absorbs):
        linear = linear.with_weights(share)
    else:
        key = mesh_tie_key(surface.mesh)
        linear = LinearModel.of(surface.laplacian, surface.curvature, share, absorbs, key)
    if surface.is_reused or len(surface.mesh.faces) <= MEMORY_BOUND_TRIANGLES:
        surface.memo["linear"] = linear
    return linear


def _fit_given(surface: Surface, spec: ConeSpec) -> ConeSolution:
    """Return the given cones; curvatures that are not given are fitted. On a straight boundary they are its corners."""
    solution = fitted_cones(
        linear_model(surface, spec),
        surface.mesh.euler_characteristic,
        spec.prescribed.vertices,
        spec.prescribed.curvatures,
        min_cone_angle=spec.min_angle,
        max_cone_angle=spec.max_angle,
    )
    return replace(solution, cones=solution.cones[~surface.mesh.is_boundary_vertex[solution.cones]])


def _search(surface: Surface, spec: ConeSpec, holonomy: Holonomy | None) -> ConeSolution:
    """Return the fewest cones for the allowed distortion, or the best cones of the requested number."""
    mesh = surface.mesh
    coneless = coneless_solution(surface, spec)
    if coneless is not None:
        return replace(coneless, notes=unmet_requests(mesh, coneless.cones, 0.0, spec))
    if needs_no_cone(surface, spec):
        none = np.empty(0, dtype=np.int64)
        return replace(linear_model(surface, spec).solution_of(none, np.empty(0)), is_searched=True)
    search = open_search(surface, spec)
    distortion, count, max_count = spec.distortion, spec.count, spec.max_count
    search_result: SparseCones | QuantisedCones
    if spec.quantum is None:
        search_result = search.fewest(distortion, max_count) if count is None else search.best_of(count)
    else:
        from ..geometry.handles import loop_holonomy
        from .integer.search import align_handles, quantise_cones

        search_result = quantised = quantise_cones(
            search, spec.quantum, distortion=distortion, count=count, max_count=max_count
        )
        if holonomy is not None:
            bound = max(quantised.distortion * HOLONOMY_FACTOR, distortion if count is None else 0.0)
            by_scale = loop_holonomy(mesh).by_log_scale(surface.lengths)
            search_result = align_handles(search, quantised, by_scale, holonomy, bound)
    solution = search_result.solution
    cones = solution.cones[~mesh.is_boundary_vertex[solution.cones]]
    notes = unmet_requests(mesh, cones, search_result.distortion, spec)
    return replace(solution, cones=cones, is_searched=True, notes=notes)


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
        note = (
            f"{plural(cone_count, 'cone')} instead of the {spec.count:,} asked for: within the given bounds, more "
            "cones would not reduce the distortion, or there is no inner vertex for them."
        )
        return (Unmet(note),)
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
