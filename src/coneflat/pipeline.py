"""Flattening: cones, target curvatures, scaling, cutting, layout (Section 4 of the paper)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import BoolArray, FloatArray, IntArray
from .assemble import assemble
from .choose import Surface, choose_cones, pursues
from .cones import ConeSolution
from .conformal.boundary import prescribed_boundary, straight_boundary
from .errors import ConvergenceError, CurvatureError
from .geometry import (
    angle_defect,
    corner_angles,
    cotangent_laplacian,
    cotangents,
    edge_lengths,
    mollify,
)
from .geometry.areas import area_distortion, vertex_areas
from .inputs import as_input
from .mesh import TriangleMesh
from .methods import ExactChoices, FlatMetric, LaidOut, exact_flattening, linear_flattening
from .numbering import at_unit_size, turn_corners
from .options import Boundary, Cones, Options
from .result import Flattening
from .seams import cut_open, find_seams
from .stages import Progress, Stages
from .text import plural
from .validation import check_mesh
from .wishes import Wishes, locate_wishes

# Searches for cones at most: each forbids those where the triangles of the one before had no room for the angle.
SEARCHES = 4
# Radians by which a cone is off then: a full turn, less what rounding and untangled neighbours make.
UNHELD = 1.0


def flatten(
    mesh: Any,
    faces: ArrayLike | None = None,
    *,
    cones: Cones = "auto",
    distortion: float = 0.2,
    cone_count: int | None = None,
    max_cones: int | None = None,
    min_cone_angle: float = math.pi / 2,
    max_cone_angle: float | None = 4 * math.pi,
    positive_only: bool = False,
    weights: ArrayLike | str | None = None,
    required_cones: Iterable[int] = (),
    forbidden_cones: Iterable[int] = (),
    allowed_cones: Iterable[int] | None = None,
    quantum: float | None = None,
    correct_handles: bool = False,
    epsilon: float = 1.0,
    metric: str = "exact",
    length_rule: str = "integral",
    at_cones: str = "auto",
    boundary: Boundary = "free",
    best_effort: bool = False,
    refine: bool = False,
    repair: bool = False,
    strict: bool = False,
    progress: Progress | None = None,
) -> Flattening:
    """Flatten a triangle mesh of any topology conformally, one disk per connected component.

    Args:
        mesh: vertices (n, 3) if `faces` is given; else a path, a `MeshFile`, a pair (vertices, faces), or
            a mesh of trimesh, meshio or pyvista.
        faces: (m, 3) vertex indices from 0.
        cones: "pursuit" finds the fewest cones for the area distortion allowed, "greedy" is the paper's search,
            "none" uses none (bounded meshes and tori); vertices get the curvatures that minimise scale
            distortion; a map from vertex to curvature in radians is taken as it is. "auto" is "pursuit",
            but "none" for components with a prescribed boundary. Vertices are those of the input.
        distortion: of the pursuit: the area distortion E allowed in the linear model, the standard deviation of
            the log scale by area.
        cone_count: of the pursuit: a number of cones per component, to be placed for the least distortion, instead.
        max_cones: both searches stop at this many cones per component; None for no limit.
        min_cone_angle, max_cone_angle: of the pursuit: bounds of the cones' angles, 2 pi - curvature, radians;
            None for no upper bound.
        positive_only: of the pursuit: no cones of negative curvature.
        weights: of the pursuit: (n,) importance of each input vertex, 0 and up; distortion keeps off what weighs
            more. Or the name of a property in the file, or "color": 1 for grey vertices, 100 for painted ones.
        required_cones, forbidden_cones, allowed_cones: of the pursuit: vertices that are cones in any case, that may
            not be, that alone may be.
        quantum: of the pursuit: cones have curvatures that are multiples of this, pi / 2 say, radians. Then
            the two sides of a seam are turned by such a multiple, but for what handles leave.
        correct_handles: of quanta and the exact metric: change the metric, as little as can be, so that
            rotations along handles are multiples, too; it is then not quite conformal.
        epsilon: the greedy search stops when log scale factors differ by at most this.
        metric: "exact" has no curvature error and no flipped triangle, "linear" is the paper's.
        length_rule: of the linear metric: "integral" scales an edge by the mean of exp(phi) along it, "mean"
            by exp of the mean.
        at_cones: of the exact metric: "scale" prescribes phi = 0 at the cones and their curvatures come out,
            "curvature" prescribes those of the search; "auto" is "scale" after a greedy search and at given
            positions, unless the boundary is prescribed, and else "curvature".
        boundary: of the exact metric: "free" has the least area distortion (phi = 0 there), "lengths" is the
            same at the model's own scale, so that boundary lengths are kept, "disk" makes it round, "straight" has
            straight sides between corners that the pursuit finds like cones; vertices
            make it a polygon with these corners and straight sides between, all of one angle, and a map
            from vertex to curvature in radians one with these.
        best_effort: return a metric that did not converge to its tolerance, instead of refusing it.
        refine: of the exact metric: return the mesh cut along the edges of the flat triangulation, on which the
            map has no inverted triangle by construction, instead of the input's own triangles.
        repair: drop, split and cut what makes the input no manifold, instead of refusing it.
        strict: refuse triangles without area, instead of opening them by a tiny perturbation.
        progress: called with the name of each stage and the fraction of triangles done.

    Raises:
        MeshError: the mesh cannot be flattened; see `coneflat.errors` for its kinds.
        CurvatureError: no metric has the curvatures asked for.
        OptionError: an option makes no sense.
        MetricError: the computation found no finite result.
    """
    options = Options(
        cones=cones,
        distortion=distortion,
        cone_count=cone_count,
        max_cones=max_cones,
        min_cone_angle=min_cone_angle,
        max_cone_angle=max_cone_angle,
        positive_only=positive_only,
        weights=weights,
        required_cones=required_cones,
        forbidden_cones=forbidden_cones,
        allowed_cones=allowed_cones,
        quantum=quantum,
        correct_handles=correct_handles,
        epsilon=epsilon,
        metric=metric,
        length_rule=length_rule,
        at_cones=at_cones,
        boundary=boundary,
        best_effort=best_effort,
        refine=refine,
        repair=repair,
        strict=strict,
    )
    stages = Stages(progress)
    with stages("check"):
        given = as_input(mesh, faces)
        checked = at_unit_size(check_mesh(given.vertices, given.faces, repair=repair))
        lengths, note = mollify(
            edge_lengths(checked.mesh.vertices, checked.mesh.faces), strict=strict, names=checked.face_origin
        )
        is_diagonal = turn_corners(checked, ~given.is_side())
        wishes = locate_wishes(checked, options, given)
        parts = checked.mesh.split_components()
    pieces = []
    for part, vertices, part_faces in parts:
        stages.share = len(part_faces) / len(checked.mesh.faces)
        shape = lengths[part_faces], is_diagonal[part_faces], wishes.within(vertices)
        try:
            pieces.append(flatten_component(part, *shape, options, stages))
        except (CurvatureError, ConvergenceError) as error:
            if len(parts) == 1:
                raise
            where = f"in the component of vertex {checked.vertex_origin[vertices[0]]} ({len(part_faces):,} triangles)"
            raise type(error)(f"{where}: {error}") from error
        stages.done += stages.share
    return assemble(given, checked, parts, pieces, options, stages, () if note is None else (note,))


def flatten_component(
    mesh: TriangleMesh,
    lengths: FloatArray,
    is_diagonal: BoolArray,
    wishes: Wishes,
    options: Options,
    stages: Stages,
) -> LaidOut:
    """Flatten a connected mesh to one disk.

    Args:
        mesh: the mesh.
        lengths: (m, 3) side lengths, with which every triangle has area.
        is_diagonal: (m, 3) sides inside a polygon of the input, which should not be cut.
        wishes: what the user says of its vertices.
        options: all others.
        stages: told how far it is.
    """
    for _ in range(SEARCHES):
        laid_out = _flatten_once(mesh, lengths, is_diagonal, wishes, options, stages)
        unheld = unheld_cones(laid_out)
        if not len(unheld) or not pursues(mesh, options):
            break
        wishes = wishes.without(unheld)
    return replace(laid_out, notes=laid_out.notes + shortfalls(laid_out, wishes.names))


def shortfalls(laid_out: LaidOut, names: IntArray) -> tuple[str, ...]:
    """Return what the layout does not keep of the metric, one sentence each."""
    notes = []
    unheld = unheld_cones(laid_out)
    if len(unheld):
        angle = 2 - laid_out.target[unheld[0]] / np.pi
        notes.append(
            f"{plural(len(unheld), 'cone')} too wide for the triangles around: that at vertex {names[unheld[0]]} has "
            f"an angle of {angle:.3g} pi. Choose others, or refine (--refine)."
        )
    sides = laid_out.points[laid_out.corners]
    one, two = sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]
    flipped = int(np.count_nonzero(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0] <= 0))
    if flipped and laid_out.figures.ptolemy_flips + laid_out.figures.euclidean_flips:
        notes.append(
            f"{plural(flipped, 'triangle')} could not be turned over on the input's own triangles: refine (--refine), "
            "which cannot invert any."
        )
    return tuple(notes)


def unheld_cones(laid_out: LaidOut) -> IntArray:
    """Return the cones that the triangles around them cannot make room for, each having an angle below pi."""
    error = laid_out.target - laid_out.curvature
    return laid_out.cones[np.abs(error[laid_out.cones]) > UNHELD]


def _flatten_once(
    mesh: TriangleMesh,
    lengths: FloatArray,
    is_diagonal: BoolArray,
    wishes: Wishes,
    options: Options,
    stages: Stages,
) -> LaidOut:
    with stages("cones", 0.4):
        curvature = angle_defect(mesh.faces, corner_angles(lengths), mesh.is_boundary_vertex)
        laplacian = cotangent_laplacian(mesh.faces, cotangents(lengths), len(mesh.vertices))
        areas = vertex_areas(mesh.faces, lengths, len(mesh.vertices))
        surface = Surface(mesh, lengths, laplacian, curvature, areas)
        solution = choose_cones(surface, wishes, options, stages)

    with stages("metric", 0.75):
        metric = find_metric(surface, solution, wishes, options)

    with stages("cut", 0.85):
        forbidden = np.zeros(len(mesh.edges), dtype=bool)
        forbidden[mesh.halfedge_edges[is_diagonal.ravel()]] = True
        seams = find_seams(mesh, solution.cones, lengths.ravel()[mesh.edge_halfedges[:, 0]], forbidden)
        disk = cut_open(mesh, seams).mesh

    with stages("layout", 1.0):
        laid_out = metric.lay_out(disk, seams)
        linear, reached = (
            area_distortion(phi, areas) for phi in (solution.log_scale, laid_out.log_scale[: len(areas)])
        )
        figures = replace(laid_out.figures, area_distortion_linear=linear, area_distortion=reached)
        return replace(laid_out, figures=figures)


def find_metric(surface: Surface, solution: ConeSolution, wishes: Wishes, options: Options) -> FlatMetric:
    """Return the flat metric that the options name."""
    mesh, lengths = surface.mesh, surface.lengths
    if options.metric == "linear":
        return linear_flattening(mesh, lengths, solution, options.length_rule)
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
        keep_area=options.boundary_kind != "lengths",
        best_effort=options.best_effort,
        refine=options.refine,
        names=wishes.names,
    )
    return exact_flattening(mesh, lengths, solution, choices)
