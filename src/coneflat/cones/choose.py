"""Cones of a connected mesh in the way that the options name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from scipy.sparse import csc_matrix

from .._arrays import BoolArray, FloatArray, IntArray
from ..geometry import angle_defect, corner_angles, cotangent_laplacian, cotangents
from ..geometry.delaunay import intrinsic_delaunay
from ..geometry.intrinsic import IntrinsicTriangulation
from ..geometry.operators import vertex_areas, weighted_areas
from ..geometry.ties import mesh_tie_key
from ..input.constraints import Constraints
from ..input.symmetry import Symmetry
from ..mesh import TriangleMesh
from ..options import Options
from ..progress import Stages
from ..seams.open_mesh import Slots
from ..text import plural
from ..threads import HUGE, meanwhile
from . import ConeSolution, check_enough, check_feasible, cones_at, cones_with_curvature, greedy_cones

if TYPE_CHECKING:
    from .sparse import ConeSearch, SparseCones
    from .sparse.linear_model import LinearModel

# The angle of a cone for which each triangle around it has room on its straight sides: less than half a turn, as not
# all of them can be spread alike.
ROOM = 0.6 * np.pi
# On meshes of so many vertices, a neighbour is as good a place: corners of cones there, all widened alike, must not
# exceed this, or the straight sides of a triangle may have no room for one, and the search has to be repeated.
FINE, WIDEST = 30_000, 0.95 * np.pi
# Flips for each edge that make a mesh Delaunay, above which it is stretched: scans take less than 0.2, stretched thirty
# to one 1.0 to 1.5; noise alone, up to 0.85. Not even a try where less than this share of edges is not Delaunay.
STRETCHED, MANY = 0.95, 0.15
# Up to so many corners of a polyhedron are all made cones. Below so many radians a vertex is none.
FEW, FLAT = 24, 1e-6
# The distortion asked for may be missed by so much, relatively, without a word.
NARROWLY = 1e-3
# How much larger E may get for the sake of rotations along handles.
DEARER = 1.15
# So many cones more, at least and as a share of them, may be spent on symmetry, and on one that is asked for; of a
# given number, E may be worse by this factor.
LEAST_MORE, MORE, NAMED_MORE, WORSE = 1, 0.15, 0.5, 1.1

#: Returns what loops across the handles turn by in the metric that a solution leads to, radians.
Turned: TypeAlias = Callable[[ConeSolution], FloatArray]


@dataclass(eq=False)
class Surface:
    """A connected mesh with what the choice of cones needs of its metric.

    Attributes:
        mesh: the mesh.
        lengths: (m, 3) side lengths, with which every triangle has area.
        laplacian: (n, n) cotangent Laplacian.
        curvature: (n,) angle defect, radians.
        areas: (n,) vertex areas.
        widest: (n,) the widest corner at each vertex as a share of all there.
        flips: whether Laplacian and areas may be those of its intrinsic Delaunay triangulation.
        search: the search for cones that has been opened on it, if any.
        is_kept: whether other cones will be chosen on it, for which it keeps what serves all of them.
    """

    mesh: TriangleMesh
    lengths: FloatArray
    laplacian: csc_matrix
    curvature: FloatArray
    areas: FloatArray
    widest: FloatArray
    flips: bool = True
    search: ConeSearch | None = None
    is_kept: bool = False
    _linear: LinearModel | None = None

    @classmethod
    def of(cls, mesh: TriangleMesh, lengths: FloatArray, flips: bool = True) -> Surface:
        """Return a mesh with what follows from its lengths.

        On stretched meshes the cotangents of the mesh's own triangles, many of them negative, tell little of surface
        and metric, which is found on the intrinsic Delaunay triangulation: Laplacian and areas are then those of that.

        flips: the metric is one that may flip edges; else Laplacian and areas are always the mesh's own.
        """
        n, cots = len(mesh.vertices), cotangents(lengths)
        faces, sides, delaunay = mesh.faces, lengths, None
        if flips and _far_from_delaunay(mesh, cots):
            triangulation, done = delaunay = intrinsic_delaunay(mesh, lengths)
            if len(done) > STRETCHED * len(mesh.edges):
                faces, sides = triangulation.faces, triangulation.length.reshape(-1, 3)
                cots = cotangents(sides)
        with meanwhile(partial(cotangent_laplacian, faces, cots, n), len(faces)) as weighing:
            angles = corner_angles(lengths)
            curvature = angle_defect(mesh.faces, angles, mesh.is_boundary_vertex)
            widest = np.zeros(n)
            np.maximum.at(widest, mesh.faces.ravel(), angles.ravel())
            widest /= np.where(mesh.is_boundary_vertex, np.pi, 2 * np.pi) - curvature
            areas = vertex_areas(faces, sides, n)
        surface = cls(mesh, lengths, weighing.result(), curvature, areas, widest, flips)
        if delaunay is not None and len(faces) <= HUGE:
            surface.__dict__["delaunay"] = delaunay
        return surface

    @cached_property
    def tie_key(self) -> FloatArray:
        """(n,) what breaks ties between vertices."""
        return mesh_tie_key(self.mesh)

    def linear_model(self, takes_rest: BoolArray, weights: FloatArray | None) -> LinearModel:
        """Return the linear model of cones off some vertices (n,), whose (n,) weights, or None, count in E.

        The last one is kept, unless the mesh is huge: its factorization serves other weights, too.
        """
        from .sparse.linear_model import LinearModel

        share, linear = weighted_areas(self.areas, weights), self._linear
        if linear is not None and np.array_equal(linear.is_boundary, takes_rest):
            linear = linear.weighing(share)
        else:
            linear = LinearModel.of(self.laplacian, self.curvature, share, takes_rest, self.tie_key)
        if self.is_kept or len(self.mesh.faces) <= HUGE:
            self._linear = linear
        return linear

    @cached_property
    def delaunay(self) -> tuple[IntrinsicTriangulation, IntArray]:
        """The intrinsic Delaunay triangulation, and the half-edges flipped for it."""
        return intrinsic_delaunay(self.mesh, self.lengths)

    def get_ready(self, options: Options) -> None:
        """Find what metric and cut will need of the mesh alone, unless it is huge: while cones are searched."""
        if len(self.mesh.faces) <= HUGE:
            Slots.of(self.mesh)
            if options.method == "exact" and not options.refine:
                _ = self.delaunay


def _far_from_delaunay(mesh: TriangleMesh, cots: FloatArray) -> bool:
    """Return whether many edges are not Delaunay: their opposite angles sum to more than half a turn."""
    weights = np.bincount(mesh.halfedge_edges, cots.ravel(), len(mesh.edges))
    return bool(np.count_nonzero(~mesh.is_boundary_edge & (weights < 0)) > MANY * len(mesh.edges))


def pursues(mesh: TriangleMesh, options: Options) -> bool:
    """Whether the pursuit finds the cones of a mesh."""
    is_prescribed = options.boundary_kind in ("disk", "polygon") and mesh.is_boundary_vertex.any()
    return options.cone_choice == "pursuit" or (
        options.cone_choice == "auto"
        and (options.asks_for_pursuit or not (is_prescribed or has_many_handles(mesh, options)))
    )


def has_many_handles(mesh: TriangleMesh, options: Options) -> bool:
    """Whether a mesh has so many handles, and needs so many cones for them, that few of them are no aim."""
    from .sparse.limits import MOST_CONES

    if options.cone_choice != "auto" or options.asks_for_pursuit or mesh.is_boundary_vertex.any():
        return False
    # Each handle but one takes two cones of 4 pi.
    return -mesh.euler_characteristic > MOST_CONES // 2


def choose_cones(
    surface: Surface,
    constraints: Constraints,
    options: Options,
    stages: Stages,
    turned: Turned | None = None,
    symmetry: Symmetry | None = None,
) -> ConeSolution:
    """Return cones with their curvatures and linear log scale; `turned` is asked where these are quantised.

    With a symmetry they are mirrored if few more do as well.
    """
    mesh = surface.mesh
    if pursues(mesh, options):
        corners = corners_alone(surface, constraints, options)
        return (
            _pursued(surface, constraints, options, stages, turned, symmetry) if corners is None else corners
        )
    given = surface.laplacian, surface.curvature, mesh.is_boundary_vertex, mesh.euler_characteristic
    is_greedy = options.cone_choice == "greedy" or has_many_handles(mesh, options)
    if is_greedy:
        solution = greedy_cones(
            *given,
            epsilon=options.epsilon,
            max_cones=options.max_cones,
            tie_key=surface.tie_key,
            progress=stages.tell,
        )
    elif np.isfinite(constraints.cones.curvatures).any():
        solution = _fitted(surface, constraints, options)
    else:
        solution = cones_at(*given, constraints.cones.vertices)
    if options.scale_at_cones and options.method == "exact":
        check_enough(len(solution.cones), mesh)
    else:
        advice = "allow more of them (--max-cones)" if is_greedy else "add cones or move them"
        check_feasible(solution.cones, solution.curvatures, constraints.names, advice)
    return solution


def _fitted(surface: Surface, constraints: Constraints, options: Options) -> ConeSolution:
    """Return the cones of which some or all have curvatures, the others with the best."""
    from .fitted import fitted_cones

    mesh = surface.mesh
    return fitted_cones(
        surface.linear_model(mesh.is_boundary_vertex, constraints.weights),
        mesh.euler_characteristic,
        constraints.cones.vertices,
        constraints.cones.curvatures,
        min_cone_angle=options.min_cone_angle,
        max_cone_angle=options.max_cone_angle,
    )


def corners_alone(surface: Surface, constraints: Constraints, options: Options) -> ConeSolution | None:
    """Return a polyhedron's corners as cones if they are few: it unfolds without any distortion. Else None."""
    if options.cone_choice != "auto" or options.asks_for_pursuit or options.boundary_kind == "straight":
        return None
    mesh, curvature = surface.mesh, surface.curvature
    corners = np.flatnonzero((np.abs(curvature) > FLAT) & ~mesh.is_boundary_vertex)
    angles = 2 * np.pi - curvature[corners]
    most = FEW if options.max_cones is None else min(options.max_cones, FEW)
    if not 0 < len(corners) <= most or not constraints.is_allowed[corners].all():
        return None
    if angles.min() < options.min_cone_angle or angles.max() > (options.max_cone_angle or np.inf):
        return None
    given = surface.laplacian, curvature, mesh.is_boundary_vertex, mesh.euler_characteristic
    return cones_with_curvature(*given, corners, curvature[corners])


def _pursued(
    surface: Surface,
    constraints: Constraints,
    options: Options,
    stages: Stages,
    turned: Turned | None,
    symmetry: Symmetry | None,
) -> ConeSolution:
    """Return the fewest cones for the distortion allowed, or the best of the number asked for."""
    mesh = surface.mesh
    only = only_choice(surface, constraints, options)
    if only is not None:
        return only
    search = search_on(surface, constraints, options, stages)
    with meanwhile(partial(surface.get_ready, options), len(mesh.faces)):
        found = _searched(search, surface, constraints, options, turned, symmetry)
    return replace(found, cones=found.cones[~mesh.is_boundary_vertex[found.cones]])


def _searched(
    search: ConeSearch,
    surface: Surface,
    constraints: Constraints,
    options: Options,
    turned: Turned | None,
    symmetry: Symmetry | None,
) -> ConeSolution:
    """Return what a search finds; see `_pursued`."""
    distortion, count, most = options.distortion, options.cone_count, options.max_cones
    if options.quantise is None:
        sparse = search.fewest(distortion, most) if count is None else search.best_of(count)
        if symmetry is not None and not len(constraints.required):
            sparse = mirrored_cones(search, sparse, symmetry, constraints, options)
        return sparse.solution
    from ..geometry.handles import open_turning
    from .integer.align import align_handles
    from .integer.search import quantise_cones

    quantised = quantise_cones(search, options.quantise, distortion=distortion, count=count, most=most)
    if turned is not None and surface.mesh.genus():
        by_scale = open_turning(surface.mesh).by_log_scale(surface.lengths)
        bound = max(quantised.distortion * DEARER, distortion if count is None else 0.0)
        quantised = align_handles(search, quantised, by_scale, turned, bound)
    return quantised.solution


def mirrored_cones(
    search: ConeSearch, found: SparseCones, symmetry: Symmetry, constraints: Constraints, options: Options
) -> SparseCones:
    """Return cones in mirrored pairs and on the plane of symmetry; those found without if that takes many more."""
    from .sparse.mirrored import MirroredSearch

    given, cones = options.cone_count, found.solution.cones
    goal = max(options.distortion, found.distortion) if given is None else WORSE * found.distortion
    more = NAMED_MORE if symmetry.is_named else MORE
    most = given if given is not None else len(cones) + max(LEAST_MORE, int(more * len(cones)))
    if given is None and options.max_cones is not None:
        most = min(most, options.max_cones)
    mirrored = MirroredSearch(search, symmetry.mirror.partner, symmetry.on_plane, constraints.is_allowed)
    best = mirrored.fewest(goal * goal, most, [search.unknowns_of(cones)])
    if best is None or best.distortion > goal * (1 + NARROWLY):
        return found
    return best


def only_choice(surface: Surface, constraints: Constraints, options: Options) -> ConeSolution | None:
    """Return the solution without cones where no vertex may be one, and none need be; else None."""
    mesh = surface.mesh
    takes_rest = _takes_rest(mesh, constraints, options)
    if (constraints.is_allowed & ~takes_rest).any() or not (
        takes_rest.any() or mesh.euler_characteristic == 0
    ):
        return None
    given = surface.laplacian, surface.curvature, takes_rest, mesh.euler_characteristic
    return cones_at(*given, np.empty(0, dtype=np.int64))


def _takes_rest(mesh: TriangleMesh, constraints: Constraints, options: Options) -> BoolArray:
    """Return (n,) the boundary vertices that take what curvature the cones leave.

    Corners of a straightened boundary are part of the trade, like the cones inside; but not on marked seams.
    """
    if options.boundary_kind != "straight":
        return mesh.is_boundary_vertex
    if constraints.on_marks is None:
        return np.zeros(len(mesh.vertices), dtype=bool)
    return mesh.is_boundary_vertex & constraints.on_marks


def search_on(surface: Surface, constraints: Constraints, options: Options, stages: Stages) -> ConeSearch:
    """Return a search for cones as the options and the user's constraints have it.

    One that is open on the surface goes on: only where cones are allowed may have changed.
    """
    from .sparse import ConeSearch

    mesh = surface.mesh
    is_straight = options.boundary_kind == "straight" and mesh.is_boundary_vertex.any()
    room = (
        ROOM * np.bincount(mesh.faces.ravel(), minlength=len(mesh.vertices)) + np.pi * mesh.is_boundary_vertex
    )
    if surface.search is not None:
        surface.search.restrict(~surface.search.is_boundary & constraints.is_allowed)
        return surface.search
    if len(room) >= FINE:
        room = np.minimum(room, WIDEST / surface.widest)
    takes_rest = _takes_rest(mesh, constraints, options)
    search = ConeSearch(
        surface.laplacian,
        surface.curvature,
        surface.areas,
        takes_rest,
        mesh.euler_characteristic,
        # A corner of angle a has a curvature of pi - a: cones inside keep to the same bound.
        min_cone_angle=options.min_cone_angle + (np.pi if is_straight else 0.0),
        max_cone_angle=options.max_cone_angle,
        positive_only=options.positive_only,
        weights=constraints.weights,
        required=constraints.required.vertices,
        allowed=constraints.is_allowed,
        room=None if options.refine else room.astype(np.float64),
        linear=surface.linear_model(takes_rest, constraints.weights),
    )
    search.tell = stages.tell
    if len(mesh.faces) <= HUGE:  # else it holds too much memory
        surface.search = search
    return search


def cone_notes(mesh: TriangleMesh, cone_count: int, distortion: float, options: Options) -> tuple[str, ...]:
    """Return what falls short of what was asked of the cones, one sentence each.

    Args:
        mesh: connected.
        cone_count: how many cones were found.
        distortion: the area distortion of the linear model with them.
        options: what was asked.
    """
    if has_many_handles(mesh, options):
        return (
            f"A surface with {mesh.genus():,} handles needs so many cones that the greedy search placed them.",
        )
    if not pursues(mesh, options):
        return ()
    if options.cone_count is not None:
        if cone_count == options.cone_count:
            return ()
        return (
            f"{plural(cone_count, 'cone')} instead of the {options.cone_count:,} asked for: more of them, within the "
            "bounds given, would gain nothing or have no vertex inside to be at.",
        )
    if distortion <= options.distortion * (1 + NARROWLY):
        return ()
    why = "no better was found within the bounds given"
    if options.quantise is not None and mesh.genus() and distortion <= options.distortion * DEARER:
        why = "cones were moved a little for the sake of the rotations along handles"
    return (
        f"The area distortion is {distortion:.3g} with {plural(cone_count, 'cone')}, above the "
        f"{options.distortion:g} allowed: {why}.",
    )
