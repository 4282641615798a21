"""The input's triangles cut along the edges of a flipped flat triangulation, so that none is turned over."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .._arrays import ComplexArray, FloatArray, IntArray
from ..errors import MetricError
from ..geometry.intrinsic import double

if TYPE_CHECKING:
    from ..flat.exact.metric import ExactMetric
from ..geometry.intrinsic import IntrinsicTriangulation, halfedge_twins, intrinsic_triangulation
from ..geometry.straight import FlatTriangles
from ..mesh import TriangleMesh
from .overlay import Overlay, overlay
from .subdivision import Pieces, find_pieces


@dataclass(frozen=True, eq=False)
class Refinement:
    """A mesh cut into r triangles along the edges of another triangulation, with a flat metric.

    Attributes:
        mesh: vertices: the n of the input, then x crossings on its edges; faces: in the order of the input's,
            whose corners keep their order in faces that are not cut.
        face_origin: (r,) the input face that each triangle is a part of.
        halfedge_edges: (3r,) the input edge that each half-edge lies on, -1 inside of input faces.
        flat: the triangles in the flat metric.
        log_scale: (n + x,) log conformal factor; at crossings that of the projective maps.
        crossing_edges: (x,) the input edge that each crossing lies on.
        crossing_weights: (x, 2) its barycentric coordinates there.
    """

    mesh: TriangleMesh
    face_origin: IntArray
    halfedge_edges: IntArray
    flat: FlatTriangles
    log_scale: FloatArray
    crossing_edges: IntArray
    crossing_weights: FloatArray

    @property
    def edge_origin(self) -> IntArray:
        """(e,) the input edge that each edge lies on, -1 for those inside of input faces."""
        origin = np.full(len(self.mesh.edges), -1)
        origin[self.mesh.halfedge_edges] = self.halfedge_edges
        return origin

    def edges_on(self, edges: IntArray) -> IntArray:
        """Return the refined mesh's edges that lie on some edges of the input, its seams for instance."""
        return np.unique(self.mesh.halfedge_edges[np.isin(self.halfedge_edges, edges)])

    def interpolate(self, values: FloatArray, edges: IntArray) -> FloatArray:
        """Return (n + x, ...) values at all vertices from those at the input's, linear along its edges.

        Args:
            values: (n, ...) values at the input's vertices.
            edges: (e, 2) the input's edges, `mesh.edges`.
        """
        return interpolate(values, edges[self.crossing_edges], self.crossing_weights)


def interpolate(values: FloatArray, ends: IntArray, weights: FloatArray) -> FloatArray:
    """Return (n + x, ...) values at vertices followed by those between pairs of vertices.

    Args:
        values: (n, ...) values at the vertices.
        ends: (x, 2) pairs of vertices.
        weights: (x, 2) barycentric coordinates between them.
    """
    weights = weights.reshape(weights.shape + (1,) * (values.ndim - 1))
    between = weights[:, 0] * values[ends[:, 0]] + weights[:, 1] * values[ends[:, 1]]
    return np.concatenate([values, between])


def refine(mesh: TriangleMesh, metric: ExactMetric) -> Refinement:
    """Return the mesh cut along the edges of the flat metric's triangulation.

    In a flat metric found with flips, straight triangles in the place of the input's may be turned over. The
    pieces into which the edges of the flipped triangulation cut them are not: all of them have area.

    Args:
        mesh: the mesh.
        metric: from `exact_metric(mesh, ..., delaunay=False)`. Of a doubled surface the first half is refined.

    Raises:
        MetricError: the metric comes from Euclidean flips, too, or is not one of this mesh.

    Notes:
        The vertices are the cusps of a hyperbolic surface, and the edges of both triangulations its geodesics,
        which are straight lines in the Klein model of each ideal triangle. So a piece of their common
        subdivision is a convex polygon in a triangle of the input as well as in a flat one, and a projective map
        takes the one to the other; it is the discrete conformal map (Springborn, Schroeder, Pinkall, "Conformal
        equivalence of triangle meshes", 2008; Gillespie, Springborn, Crane, "Discrete conformal equivalence of
        polyhedral surfaces", 2021). Here it is made linear on the triangles of each polygon.

        Where triangles of the metric are broken, triangles of the refinement have no area: `flat.is_inverted`.

        The cost is a few passes over the mesh, and linear in the number of crossings.
    """
    from ..geometry.straight import find_turns, place_triangles

    if metric.euclidean_flips:
        raise MetricError(
            f"the metric comes from {metric.euclidean_flips} Euclidean flips, which leave the conformal class of "
            "the mesh's own triangles; call exact_metric with delaunay=False to refine the mesh"
        )
    source = intrinsic_triangulation(mesh, np.ones((len(mesh.faces), 3)))
    original = np.arange(len(mesh.vertices))
    if metric.doubled:
        source, original = double(source)
    phi = metric.log_scale[original]
    flat = metric.triangulation
    crossings = overlay(source, flat, metric.flips, phi)
    ends = np.stack([source.tail[crossings.leaving], source.tail[source.twin[crossings.leaving]]], axis=1)
    positions = interpolate(mesh.vertices[original], ends, crossings.on_leaving)
    sides, turns = np.empty((2, len(flat.twin)), dtype=np.complex128)
    place_triangles(flat.length, sides)
    find_turns(flat.twin, sides, turns)
    pieces = find_pieces(source, flat, sides, crossings, positions)
    log_scale = np.concatenate([phi, crossings.log_scale])
    return assemble_pieces(mesh, source, crossings, positions, log_scale, pieces, turns)


def assemble_pieces(
    mesh: TriangleMesh,
    source: IntrinsicTriangulation,
    crossings: Overlay,
    positions: FloatArray,
    log_scale: FloatArray,
    pieces: Pieces,
    turns: ComplexArray,
) -> Refinement:
    """Return the pieces of the mesh's own faces, without those of its mirror image, and the crossings at their corners.

    turns: (3m,) from the frame across each half-edge of the flat triangulation to that of its own triangle.
    """
    leaving = crossings.leaving
    halfedge = np.where(leaving < mesh.faces.size, leaving, source.twin[leaving])
    is_own = halfedge < mesh.faces.size
    count = int(np.searchsorted(pieces.origin, len(mesh.faces)))
    used = np.zeros(len(positions), dtype=bool)
    used[pieces.corners[:count]] = True
    used = is_own & used[source.vertex_count :]
    kept = np.zeros(len(positions), dtype=bool)
    kept[: len(mesh.vertices)] = True
    kept[source.vertex_count :] = used
    number = np.cumsum(kept) - 1
    edges, leaving = mesh.halfedge_edges[halfedge[used]], leaving[used]
    weights = crossings.on_leaving[used]
    backwards = source.tail[leaving] != mesh.edges[edges, 0]
    weights[backwards] = weights[backwards, ::-1]
    refined = TriangleMesh(positions[kept], number[pieces.corners[:count]])
    twin = halfedge_twins(refined)
    on_flat, on_input = pieces.on_flat[:count].ravel(), pieces.on_input[:count].ravel()
    return Refinement(
        refined,
        pieces.origin[:count],
        np.where(on_input >= 0, mesh.halfedge_edges[on_input], -1),
        FlatTriangles(
            pieces.sides[:count].ravel(), np.where((on_flat >= 0) & (twin >= 0), turns[on_flat], 1.0), twin
        ),
        log_scale[kept],
        edges,
        weights,
    )
