"""Flattening: cones, target curvatures, scaling, cutting, layout (Section 4 of the paper)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csc_matrix

from ._arrays import BoolArray, FloatArray, IntArray
from .assemble import assemble
from .cones import ConeSolution, check_feasible, cones_at, cones_with_curvature, greedy_cones
from .conformal.linear import scaled_lengths
from .geometry import (
    angle_defect,
    corner_angles,
    cotangent_laplacian,
    cotangents,
    double_areas,
    edge_lengths,
    is_broken,
    mollify,
)
from .inputs import as_input
from .layout import least_squares_layout
from .mesh import TriangleMesh
from .numbering import locate_cones, turn_corners
from .options import Cones, Options
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
    metric: str = "linear",
    length_rule: str = "integral",
    layout: str = "least-squares",
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
        metric: "linear", the paper's.
        length_rule: "integral" scales an edge by the mean of exp(phi) along it, "mean" by exp of the mean.
        layout: "least-squares", the reconstruction of ABF++.
        repair: drop, split and cut what makes the input no manifold, instead of refusing it.
        strict: refuse triangles without area, instead of opening them by a tiny perturbation.
        progress: called with the name of each stage and the fraction of triangles done.

    Raises:
        MeshError: the mesh cannot be flattened; see `coneflat.errors` for its kinds.
        CurvatureError: no metric has the curvatures asked for.
        OptionError: an option makes no sense.
        MetricError: the computation found no finite result.
    """
    options = Options(cones, epsilon, max_cones, metric, length_rule, layout, repair, strict)
    stages = Stages(progress)
    with stages("check"):
        given = as_input(mesh, faces)
        checked = check_mesh(given.vertices, given.faces, repair=repair)
        is_diagonal = turn_corners(checked, ~given.is_side())
        given_cones = locate_cones(checked, options.given)
        parts = checked.mesh.split_components()
    pieces = []
    done = 0
    for part, vertices, part_faces in parts:
        stages.fraction = done / len(checked.mesh.faces)
        own = np.isin(given_cones[0], vertices)
        own_cones = np.searchsorted(vertices, given_cones[0][own]), given_cones[1][own]
        names = checked.vertex_origin[vertices]
        pieces.append(flatten_component(part, options, stages, own_cones, is_diagonal[part_faces], names))
        done += len(part_faces)
    stages.fraction = 1.0
    return assemble(given, checked, parts, pieces, options, stages)


@dataclass(frozen=True)
class Piece:
    """One connected component, flattened.

    Attributes:
        points: (c, 2) layout at the model's own scale.
        corners: (m, 3) index into `points` of every triangle corner.
        solution: cones, target curvatures and log scale.
        curvature: (n,) curvature of the metric that was laid out, radians.
        seams: (k, 2) vertex pairs.
        broken: triangles of the metric that break the triangle inequality.
        note: what was done to triangles without area, if anything.
    """

    points: FloatArray
    corners: IntArray
    solution: ConeSolution
    curvature: FloatArray
    seams: IntArray
    broken: int
    note: str | None


def flatten_component(
    mesh: TriangleMesh,
    options: Options,
    stages: Stages,
    given_cones: tuple[IntArray, FloatArray],
    is_diagonal: BoolArray,
    names: IntArray,
) -> Piece:
    """Flatten a connected mesh to one disk.

    Args:
        mesh: connected and checked.
        options, stages: as in `flatten`.
        given_cones: vertices and their curvatures, NaN where these are to be computed.
        is_diagonal: (m, 3) sides inside a polygon of the input, which should not be cut.
        names: (n,) what the user calls each vertex.
    """
    with stages("cones"):
        lengths, note = mollify(edge_lengths(mesh.vertices, mesh.faces), strict=options.strict)
        curvature = _curvature(mesh, lengths)
        laplacian = cotangent_laplacian(mesh.faces, cotangents(lengths), len(mesh.vertices))
        solution = find_cones(mesh, laplacian, curvature, options, given_cones)
        check_feasible(solution.cones, solution.curvatures, names, "add cones or move them")

    with stages("metric"):
        scaled = scaled_lengths(lengths, mesh.faces, solution.log_scale, options.length_rule)
        shrink = np.sqrt(double_areas(lengths).sum() / double_areas(scaled).sum())
        scaled *= shrink
        solution = solution.shifted(float(np.log(shrink)))

    with stages("cut"):
        edge_costs = lengths.ravel()[mesh.edge_halfedges[:, 0]]
        avoided = np.zeros(len(mesh.edges), dtype=bool)
        avoided[mesh.halfedge_edges[is_diagonal.ravel()]] = True
        seams = find_seams(mesh, solution.cones, edge_costs, avoided)
        disk = cut_open(mesh, seams).mesh

    with stages("layout"):
        points = least_squares_layout(disk, scaled)
        points *= np.sqrt(double_areas(lengths).sum() / np.abs(_signed_areas(points, disk.faces)).sum())

    return Piece(
        points,
        disk.faces,
        solution,
        _curvature(mesh, scaled),
        mesh.edges[seams],
        int(is_broken(scaled).sum()),
        note,
    )


def find_cones(
    mesh: TriangleMesh,
    laplacian: csc_matrix,
    curvature: FloatArray,
    options: Options,
    given: tuple[IntArray, FloatArray],
) -> ConeSolution:
    """Return cones with their curvatures and log scale by the method that the options name."""
    surface = laplacian, curvature, mesh.is_boundary_vertex, mesh.euler_characteristic
    if options.method == "greedy":
        return greedy_cones(*surface, epsilon=options.epsilon, max_cones=options.max_cones)
    cones, curvatures = given
    if len(cones) and np.isfinite(curvatures).all():
        return cones_with_curvature(*surface, cones, curvatures)
    return cones_at(*surface, cones)


def _curvature(mesh: TriangleMesh, lengths: FloatArray) -> FloatArray:
    return angle_defect(mesh.faces, corner_angles(lengths), mesh.is_boundary_vertex)


def _signed_areas(points: FloatArray, faces: IntArray) -> FloatArray:
    one, two = points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]]
    areas: FloatArray = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    return areas
