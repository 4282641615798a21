"""Cones of a connected mesh by the strategy that is asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from ..base.arrays import FloatArray
from ..base.defaults import TYPED_TOLERANCE
from ..base.progress import Stopwatch
from ..base.text import plural
from ..base.threads import MEMORY_BOUND_TRIANGLES
from ..geometry.operators import weighted_areas
from ..mesh.ties import mesh_tie_key
from ..stages import ConeSolution, ConeSpec, Surface
from .given import cones_at, cones_with_curvature, fitted_cones
from .greedy import greedy_cones
from .solution import check_enough, check_feasible

if TYPE_CHECKING:
    from .integer.search import QuantisedCones
    from .sparse import ConeSearch, SparseCones
    from .sparse.linear_model import LinearModel

# The angle of a cone for which each triangle around it has room on its straight sides: less than half a turn, as not
# all of them can be spread alike.
CONE_ANGLE_PER_TRIANGLE = 0.6 * np.pi
# On meshes of so many vertices, a neighbour is as good a place: corners of cones there, all widened alike, must not
# exceed this, or the straight sides of a triangle may have no room for one, and the search has to be repeated: 14% of
# the time of a horse of 97,000 triangles.
FINE_VERTICES, MAX_CORNER = 30_000, 0.95 * np.pi
# Up to so many corners of a polyhedron are all made cones.
MAX_POLYHEDRON_CORNERS = 24
# The distortion asked for may be missed by so much, relatively, without a note.
RELATIVE_TOLERANCE = 1e-3
# How much larger E may get for the sake of rotations along handles.
HOLONOMY_FACTOR = 1.15

#: Returns the rotations of loops across the handles in the metric that a solution leads to, radians.
Holonomy: TypeAlias = Callable[[ConeSolution], FloatArray]


def find_cones(
    surface: Surface, spec: ConeSpec, watch: Stopwatch, holonomy: Holonomy | None = None
) -> ConeSolution:
    """Return cones with their curvatures and linear log scale.

    Args:
        surface: the mesh.
        spec: what is asked of the cones.
        watch: told what is being done.
        holonomy: measures rotations along handles; called where curvatures are quantised on a mesh with handles.

    Raises:
        CurvatureError: no metric has the curvatures.
    """
    mesh = surface.mesh
    too_many_handles = has_many_handles(surface, spec)
    if uses_sparse_search(surface, spec):
        corners = polyhedron_corners(surface, spec)
        return _search(surface, spec, watch, holonomy) if corners is None else corners
    given = surface.laplacian, surface.curvature, mesh.is_boundary_vertex, mesh.euler_characteristic
    is_greedy = spec.strategy == "greedy" or too_many_handles
    if is_greedy:
        solution = greedy_cones(
            *given, max_cones=spec.max_count, tie_key=mesh_tie_key(mesh), progress=watch.tell
        )
    elif len(spec.given):
        solution = _fit_given(surface, spec)
    else:  # "none", or none of the given ones is here
        solution = cones_at(*given, spec.given.vertices)
    if spec.scale_at_cones:
        check_enough(len(solution.cones), mesh)
    else:
        advice = "allow more of them (--max-cones)" if is_greedy else "add cones or move them"
        check_feasible(solution.cones, solution.curvatures, spec.names, advice)
    if too_many_handles:
        note = (
            f"A surface with {mesh.genus():,} handles needs so many cones that the greedy search placed them."
        )
        return replace(solution, notes=(note,))
    return solution


def uses_sparse_search(surface: Surface, spec: ConeSpec) -> bool:
    """Whether the sparse search finds the cones of a mesh."""
    return spec.strategy == "sparse" or (
        spec.strategy == "auto"
        and (spec.needs_sparse_search or not (spec.prescribes_boundary or has_many_handles(surface, spec)))
    )


def has_many_handles(surface: Surface, spec: ConeSpec) -> bool:
    """Whether a mesh has so many handles that the sparse search would take too long for the cones they need."""
    from .sparse.limits import MAX_SEARCHED

    mesh = surface.mesh
    if spec.strategy != "auto" or spec.needs_sparse_search or mesh.is_boundary_vertex.any():
        return False
    # Each handle but one takes two cones of 4 pi.
    return -mesh.euler_characteristic > MAX_SEARCHED // 2


def polyhedron_corners(surface: Surface, spec: ConeSpec) -> ConeSolution | None:
    """Return a polyhedron's corners as cones if they are few: it unfolds without any distortion. Else None."""
    if spec.strategy != "auto" or spec.needs_sparse_search or spec.searches_corners:
        return None
    mesh, curvature = surface.mesh, surface.curvature
    corners = np.flatnonzero((np.abs(curvature) > TYPED_TOLERANCE) & ~mesh.is_boundary_vertex)
    angles = 2 * np.pi - curvature[corners]
    most = min(MAX_POLYHEDRON_CORNERS, MAX_POLYHEDRON_CORNERS if spec.max_count is None else spec.max_count)
    if not 0 < len(corners) <= most or not spec.is_allowed[corners].all():
        return None
    if angles.min() < spec.min_angle or angles.max() > (spec.max_angle or np.inf):
        return None
    given = surface.laplacian, curvature, mesh.is_boundary_vertex, mesh.euler_characteristic
    return cones_with_curvature(*given, corners, curvature[corners])


def only_choice(surface: Surface, spec: ConeSpec) -> ConeSolution | None:
    """Return the solution without cones where no vertex may be one, and none need be; else None."""
    mesh, absorbs = surface.mesh, spec.absorbs_curvature
    if (spec.is_allowed & ~absorbs).any() or not (absorbs.any() or mesh.euler_characteristic == 0):
        return None
    given = surface.laplacian, surface.curvature, absorbs, mesh.euler_characteristic
    return cones_at(*given, np.empty(0, dtype=np.int64))


def open_search(surface: Surface, spec: ConeSpec, watch: Stopwatch) -> ConeSearch:
    """Return a search for cones; one that is open on the surface goes on where cones are still allowed."""
    from .sparse import ConeSearch

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
        surface.laplacian,
        surface.curvature,
        surface.areas,
        spec.absorbs_curvature,
        mesh.euler_characteristic,
        # A corner of angle a has a curvature of pi - a: cones inside keep to the same bound.
        min_cone_angle=spec.min_angle + (np.pi if spec.searches_corners else 0.0),
        max_cone_angle=spec.max_angle,
        positive_only=spec.positive_only,
        weights=spec.weights,
        required=spec.required,
        allowed=spec.is_allowed,
        max_angles=max_angles.astype(np.float64),
        linear=linear_model(surface, spec),
    )
    search.tell = watch.tell
    if len(mesh.faces) <= MEMORY_BOUND_TRIANGLES:  # else it holds too much memory
        surface.memo["search"] = search
    return search


def close_search(surface: Surface) -> None:
    """Forget the search for cones on a surface, which takes much memory."""
    surface.memo.pop("search", None)


def linear_model(surface: Surface, spec: ConeSpec) -> LinearModel:
    """Return the linear model of cones off the vertices that absorb curvature, with the weights of the spec in E.

    The last one is stored, unless the mesh is huge: its factorization serves other weights, too.
    """
    from .sparse.linear_model import LinearModel

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
    """Return the cones of which some or all have curvatures, the others with the best."""
    on_boundary = replace(spec, absorbs_curvature=surface.mesh.is_boundary_vertex)
    return fitted_cones(
        linear_model(surface, on_boundary),
        surface.mesh.euler_characteristic,
        spec.given.vertices,
        spec.given.curvatures,
        min_cone_angle=spec.min_angle,
        max_cone_angle=spec.max_angle,
    )


def _search(surface: Surface, spec: ConeSpec, watch: Stopwatch, holonomy: Holonomy | None) -> ConeSolution:
    """Return the fewest cones for the distortion allowed, or the best of the number asked for."""
    mesh = surface.mesh
    only = only_choice(surface, spec)
    if only is not None:
        return replace(only, notes=_unmet(mesh.genus(), len(only.cones), 0.0, spec))
    search = open_search(surface, spec, watch)
    distortion, count, most = spec.distortion, spec.count, spec.max_count
    found: SparseCones | QuantisedCones
    if spec.quantum is None:
        found = search.fewest(distortion, most) if count is None else search.best_of(count)
    else:
        from ..geometry.handles import loop_holonomy
        from .integer.search import align_handles, quantise_cones

        found = quantised = quantise_cones(
            search, spec.quantum, distortion=distortion, count=count, most=most
        )
        if holonomy is not None:
            bound = max(quantised.distortion * HOLONOMY_FACTOR, distortion if count is None else 0.0)
            by_scale = loop_holonomy(mesh).by_log_scale(surface.lengths)
            found = align_handles(search, quantised, by_scale, holonomy, bound)
    solution = found.solution
    cones = solution.cones[~mesh.is_boundary_vertex[solution.cones]]
    notes = _unmet(mesh.genus(), len(cones), found.distortion, spec)
    return replace(solution, cones=cones, is_searched=True, notes=notes)


def _unmet(genus: int, cone_count: int, distortion: float, spec: ConeSpec) -> tuple[str, ...]:
    """Return what is unmet of the number of cones or of the distortion, one sentence each."""
    if spec.count is not None:
        if cone_count == spec.count:
            return ()
        return (
            f"{plural(cone_count, 'cone')} instead of the {spec.count:,} asked for: more of them, within the "
            "bounds given, would gain nothing or have no vertex inside to be at.",
        )
    if distortion <= spec.distortion * (1 + RELATIVE_TOLERANCE):
        return ()
    why = "no better was found within the bounds given"
    if spec.quantum is not None and genus and distortion <= spec.distortion * HOLONOMY_FACTOR:
        why = "cones were moved a little for the sake of the rotations along handles"
    return (
        f"The area distortion is {distortion:.3g} with {plural(cone_count, 'cone')}, above the "
        f"{spec.distortion:g} allowed: {why}.",
    )
