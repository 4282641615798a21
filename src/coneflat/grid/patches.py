"""Patches between sharp edges, each flattened with straight sides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import ComplexArray, FloatArray, IntArray
from ..cones import ConeSolution
from ..cones.choose import ROOM, Surface
from ..cones.integer.search import quantise_cones
from ..cones.sparse import ConeSearch
from ..errors import CurvatureError
from ..flat.exact.boundary import straight_boundary
from ..flat.exact.flatten import ExactChoices, exact_flattening
from ..geometry.planar import as_complex, signed_double_areas
from ..geometry.ties import tie_key
from ..mesh import NEXT, PREVIOUS, TriangleMesh
from ..options import Options
from ..seams import cut_open, edge_costs, find_seams

QUARTER = np.pi / 2


@dataclass(frozen=True, eq=False)
class FlatPatch:
    """A patch in the plane, at its own area, its sides along the axes.

    Attributes:
        points: (u,) of the plane.
        corners: (m, 3) the point at each triangle corner.
        cones: vertices of the patch, inside.
        turned: (t,) triangles that are turned over, as they are too coarse for straight sides.
    """

    points: ComplexArray
    corners: IntArray
    cones: IntArray
    turned: IntArray


def flatten_patch(
    mesh: TriangleMesh, lengths: FloatArray, quarters: IntArray, distortion: float, options: Options
) -> FlatPatch:
    """Return a connected patch flattened conformally, with angles of whole quarter turns on its boundary.

    Args:
        mesh: the patch.
        lengths: (m, 3) side lengths.
        quarters: (n,) the quarter turns of the angle at each vertex on the boundary.
        distortion: the area distortion allowed, the standard deviation of the log of the scale by area.
        options: what else is asked of the cones inside.

    Raises:
        CurvatureError: no cones inside make up for the corners.
        ConvergenceError, MetricError: no metric was found.
    """
    on_boundary = mesh.is_boundary_vertex
    corners = np.where(on_boundary, QUARTER * (2 - quarters), 0.0)
    solution = _cones(mesh, lengths, corners, distortion, options)
    choices = ExactChoices(scale_at_cones=False, boundary=straight_boundary(mesh, solution.target))
    # Rotations along handles are no quarter turns yet, nor are loops of the boundary parallel: both come to be so when
    # patches are brought together.
    metric = exact_flattening(mesh, lengths, solution, choices)
    costs = edge_costs(mesh, lengths.ravel()[mesh.edge_halfedges[:, 0]], creases=options.creases)
    seams = find_seams(mesh, solution.cones, costs)
    laid_out = metric.lay_out(cut_open(mesh, seams).mesh, seams)
    turned = np.flatnonzero(signed_double_areas(laid_out.points[laid_out.corners]) <= 0)
    points = as_complex(laid_out.points)
    points = points * np.exp(-1j * _side_angle(mesh, laid_out.corners, points))
    return FlatPatch(points, laid_out.corners, solution.cones, turned)


def _cones(
    mesh: TriangleMesh, lengths: FloatArray, corners: FloatArray, distortion: float, options: Options
) -> ConeSolution:
    """Return cones inside a patch whose (n,) corners are given: these are taken off the curvature to be made up for."""
    surface = Surface.of(mesh, lengths)
    inside = ~mesh.is_boundary_vertex
    total = 4 * mesh.euler_characteristic - round(float(corners.sum()) / QUARTER)
    room = ROOM * np.bincount(mesh.faces.ravel(), minlength=len(mesh.vertices))
    try:
        search = ConeSearch(
            surface.laplacian,
            surface.curvature - corners,
            surface.areas,
            np.zeros(len(inside), dtype=bool),
            total / 4,
            tie_key=tie_key(mesh.vertices),
            min_cone_angle=options.min_cone_angle,
            max_cone_angle=options.max_cone_angle,
            allowed=inside,
            room=room.astype(np.float64),
        )
        found = quantise_cones(search, QUARTER, distortion=distortion).solution
    except CurvatureError as error:
        raise CurvatureError(
            f"a patch of {len(mesh.faces):,} triangles with corners of {corners.sum() / np.pi:.3g} pi in all: {error}"
        ) from error
    target = np.where(inside, found.target, corners)
    return ConeSolution(found.cones, target, found.log_scale)


def _side_angle(mesh: TriangleMesh, corners: IntArray, points: ComplexArray) -> float:
    """Return the direction of most of a boundary, up to quarter turns."""
    border = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
    side = points[corners[:, PREVIOUS].ravel()[border]] - points[corners[:, NEXT].ravel()[border]]
    return float(np.angle((np.abs(side) * (side / np.abs(side)) ** 4).sum()) / 4) if len(side) else 0.0
