"""Flattening: cones, target curvatures, scaling, cutting, layout (Section 4 of the paper)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csc_matrix

from ._arrays import BoolArray, FloatArray, IntArray
from .assemble import assemble
from .cones import ConeSolution, check_enough, check_feasible, cones_at, cones_with_curvature, greedy_cones
from .conformal.boundary import prescribed_boundary
from .errors import CurvatureError
from .geometry import (
    angle_defect,
    corner_angles,
    cotangent_laplacian,
    cotangents,
    edge_lengths,
    mollify,
)
from .geometry.ties import tie_key
from .inputs import as_input
from .mesh import TriangleMesh
from .methods import ExactChoices, FlatMetric, LaidOut, exact_flattening, linear_flattening
from .numbering import at_unit_size, locate, select, turn_corners
from .options import Boundary, Cones, Options
from .result import Flattening
from .seams import cut_open, find_seams
from .stages import Progress, Stages
from .validation import check_mesh


def flatten(
    mesh: Any,
    faces: ArrayLike | None = None,
    *,
    cones: Cones = "greedy",
    epsilon: float = 1.0,
    max_cones: int | None = None,
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
        cones: "greedy" searches for cones; "none" uses none (bounded meshes and tori); vertices get the
            curvatures that minimise scale distortion; a map from vertex to curvature in radians is
            taken as it is. Vertices are those of the input.
        epsilon: the greedy search stops when log scale factors differ by at most this.
        max_cones: the greedy search stops at this many cones per component; None for no limit.
        metric: "exact" has no curvature error and no flipped triangle, "linear" is the paper's.
        length_rule: of the linear metric: "integral" scales an edge by the mean of exp(phi) along it, "mean"
            by exp of the mean.
        at_cones: of the exact metric: "scale" prescribes phi = 0 at the cones and their curvatures come out,
            "curvature" prescribes those of the search; "auto" is "curvature" where curvatures are given or
            the boundary is prescribed, else "scale".
        boundary: of the exact metric: "free" has the least area distortion (phi = 0 there), "lengths" is the
            same at the model's own scale, so that boundary lengths are kept, "disk" makes it round; vertices
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
        cones,
        epsilon,
        max_cones,
        metric,
        length_rule,
        at_cones,
        boundary,
        best_effort,
        refine,
        repair,
        strict,
    )
    stages = Stages(progress)
    with stages("check"):
        given = as_input(mesh, faces)
        checked = at_unit_size(check_mesh(given.vertices, given.faces, repair=repair))
        lengths, note = mollify(
            edge_lengths(checked.mesh.vertices, checked.mesh.faces), strict=strict, names=checked.face_origin
        )
        is_diagonal = turn_corners(checked, ~given.is_side())
        given_cones = locate(checked, "cone", options.given_cones)
        corners = locate(checked, "corner", options.corners)
        parts = checked.mesh.split_components()
    pieces = []
    for part, vertices, part_faces in parts:
        given_here = Given(
            lengths[part_faces],
            *select(given_cones, vertices),
            *select(corners, vertices),
            is_diagonal[part_faces],
            checked.vertex_origin[vertices],
        )
        stages.share = len(part_faces) / len(checked.mesh.faces)
        try:
            pieces.append(flatten_component(part, given_here, options, stages))
        except CurvatureError as error:
            if len(parts) == 1:
                raise
            where = f"in the component of vertex {given_here.names[0]} ({len(part_faces):,} triangles)"
            raise CurvatureError(f"{where}: {error}") from error
        stages.done += stages.share
    return assemble(given, checked, parts, pieces, options, stages, () if note is None else (note,))


@dataclass(frozen=True, eq=False)
class Given:
    """What the input says about a component.

    Attributes:
        lengths: (m, 3) side lengths, with which every triangle has area.
        cones, cone_curvatures: (s,) vertices and radians; NaN where the curvature is to be computed.
        corners, corner_curvatures: (c,) the same of corners of the boundary.
        is_diagonal: (m, 3) sides inside a polygon of the input, which should not be cut.
        names: (n,) what the user calls each vertex.
    """

    lengths: FloatArray
    cones: IntArray
    cone_curvatures: FloatArray
    corners: IntArray
    corner_curvatures: FloatArray
    is_diagonal: BoolArray
    names: IntArray


def flatten_component(mesh: TriangleMesh, given: Given, options: Options, stages: Stages) -> LaidOut:
    """Flatten a connected mesh to one disk."""
    lengths = given.lengths
    with stages("cones", 0.4):
        curvature = angle_defect(mesh.faces, corner_angles(lengths), mesh.is_boundary_vertex)
        laplacian = cotangent_laplacian(mesh.faces, cotangents(lengths), len(mesh.vertices))
        solution = find_cones(mesh, laplacian, curvature, given, options, stages)

    with stages("metric", 0.75):
        metric = find_metric(mesh, solution, given, options)

    with stages("cut", 0.85):
        edge_costs = lengths.ravel()[mesh.edge_halfedges[:, 0]]
        avoided = np.zeros(len(mesh.edges), dtype=bool)
        avoided[mesh.halfedge_edges[given.is_diagonal.ravel()]] = True
        seams = find_seams(mesh, solution.cones, edge_costs, avoided)
        disk = cut_open(mesh, seams).mesh

    with stages("layout", 1.0):
        return metric.lay_out(disk, seams)


def find_cones(
    mesh: TriangleMesh,
    laplacian: csc_matrix,
    curvature: FloatArray,
    given: Given,
    options: Options,
    stages: Stages,
) -> ConeSolution:
    """Return cones with their curvatures and linear log scale by the method that the options name."""
    surface = laplacian, curvature, mesh.is_boundary_vertex, mesh.euler_characteristic
    if options.method == "greedy":
        solution = greedy_cones(
            *surface,
            epsilon=options.epsilon,
            max_cones=options.max_cones,
            tie_key=tie_key(mesh.vertices),
            progress=stages.tell,
        )
    elif len(given.cones) and np.isfinite(given.cone_curvatures).all():
        solution = cones_with_curvature(*surface, given.cones, given.cone_curvatures)
    else:
        solution = cones_at(*surface, given.cones)
    if options.scale_at_cones and options.metric == "exact":
        check_enough(len(solution.cones), mesh)
    else:
        advice = (
            "allow more of them (--max-cones)" if options.method == "greedy" else "add cones or move them"
        )
        check_feasible(solution.cones, solution.curvatures, given.names, advice)
    return solution


def find_metric(mesh: TriangleMesh, solution: ConeSolution, given: Given, options: Options) -> FlatMetric:
    """Return the flat metric that the options name."""
    lengths = given.lengths
    if options.metric == "linear":
        return linear_flattening(mesh, lengths, solution, options.length_rule)
    is_prescribed = options.boundary_kind == "disk" or len(given.corners) > 0
    boundary = None
    if is_prescribed and mesh.is_boundary_vertex.any():
        total = float(solution.curvatures.sum())
        boundary = prescribed_boundary(
            mesh, lengths, total, given.corners, given.corner_curvatures, given.names
        )
    choices = ExactChoices(
        scale_at_cones=options.scale_at_cones,
        boundary=boundary,
        keep_area=options.boundary_kind != "lengths",
        best_effort=options.best_effort,
        refine=options.refine,
        names=given.names,
    )
    return exact_flattening(mesh, lengths, solution, choices)
