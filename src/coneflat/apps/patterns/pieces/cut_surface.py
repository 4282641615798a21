"""A surface cut into pieces in the plane, and further cuts of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .... import Flattening, TriangleMesh
from ....base import BoolArray, FloatArray, IntArray, mask_of
from ....geometry import double_areas, edge_lengths, find_overlaps
from ....measures import measure_map
from ....mesh import label_faces, open_along, point_seams, point_vertices
from .numbering import order_by_size
from .strain import FlatEdges


@dataclass(frozen=True, eq=False)
class CutSurface:
    """A mesh of n vertices and m triangles whose pieces lie in the plane, each anywhere, at the scale of the mesh.

    Attributes:
        mesh: the mesh.
        corners: (m, 3) the point of each triangle corner.
        points: (u, 2) the points.
        sequence: (m,) the number of the piece of each triangle, if pieces have an order; None: by area.
    """

    mesh: TriangleMesh
    corners: IntArray
    points: FloatArray
    sequence: IntArray | None = None

    @classmethod
    def of(cls, result: Flattening) -> CutSurface:
        """Return a flattening as a cut surface."""
        mesh = TriangleMesh(result.vertices, result.faces)
        return cls(mesh, result.uv_faces, result.uv / result.uv_scale)

    @cached_property
    def edges(self) -> FlatEdges:
        """The edges of the pieces."""
        return FlatEdges.of(self.mesh, self.corners)

    @cached_property
    def edge_lengths(self) -> FloatArray:
        """(e,) the lengths of the edges of the mesh."""
        return lengths_of_edges(self.mesh)

    @cached_property
    def seams(self) -> IntArray:
        """(k,) the edges of the mesh that were cut."""
        return point_seams(self.mesh, self.corners)

    @property
    def seam_length(self) -> float:
        """The length of all seams on the surface."""
        return float(self.edge_lengths[self.seams].sum())

    @cached_property
    def is_border_vertex(self) -> BoolArray:
        """(n,) vertices on seams or on the border of the mesh."""
        return mask_of(len(self.mesh.vertices), self.mesh.edges[self.seams]) | self.mesh.is_boundary_vertex

    @cached_property
    def vertex_of_point(self) -> IntArray:
        """(u,) the vertex of each point."""
        return point_vertices(self.mesh.faces, self.corners, len(self.points))

    @cached_property
    def pieces(self) -> IntArray:
        """(m,) the piece of each triangle, from 0, in their order, or else the largest first."""
        if self.sequence is not None:
            return self.sequence
        label = np.unique(label_faces(self.corners, len(self.points))[1], return_inverse=True)[1].reshape(-1)
        areas, centres = piece_areas(self.mesh, label)
        rank = np.empty(len(areas), dtype=np.int64)
        rank[order_by_size(areas, centres)] = np.arange(len(areas))
        return rank[label]

    @property
    def piece_count(self) -> int:
        """The number of pieces."""
        return int(self.pieces.max()) + 1

    @cached_property
    def triangles_of_pieces(self) -> list[IntArray]:
        """The triangles (k,) of each piece."""
        order = np.argsort(self.pieces, kind="stable")
        return np.split(order, np.cumsum(np.bincount(self.pieces))[:-1])

    @property
    def points_of_pieces(self) -> Iterator[IntArray]:
        """The points (k,) of each piece, in the order of the pieces."""
        return (np.unique(self.corners[triangles]) for triangles in self.triangles_of_pieces)

    @cached_property
    def piece_of_point(self) -> IntArray:
        """(u,) the piece of each point."""
        piece = np.zeros(len(self.points), dtype=np.int64)
        piece[self.corners] = self.pieces[:, None]
        return piece

    @property
    def places(self) -> FloatArray:
        """(m, 3, 2) the corners of the triangles in the plane."""
        return self.points[self.corners]

    def with_points(self, points: FloatArray) -> CutSurface:
        """Return the surface with its points (u, 2) elsewhere in the plane."""
        moved = replace(self, points=points)
        # All that is computed from the mesh and the corners alone is the same.
        vars(moved).update({name: value for name, value in vars(self).items() if name != "points"})
        return moved

    def cut_along(self, seams: IntArray, places: FloatArray | None = None) -> CutSurface:
        """Return the surface with other seams; the sides of closed ones meet in the middle.

        Args:
            seams: (k,) edges of the mesh.
            places: (m, 3, 2) the corners of the triangles in the plane; None for those that they have.
        """
        corners = open_along(self.mesh, seams).mesh.faces
        flat = (self.places if places is None else places).reshape(-1, 2)
        count = np.bincount(corners.ravel())
        sums = np.stack([np.bincount(corners.ravel(), column) for column in flat.T], axis=1)
        return replace(self, corners=corners, points=sums / count[:, None], sequence=None)

    def overlaps(self) -> IntArray:
        """Return (k, 2) the pairs of triangles of the same piece that overlap."""
        apart = 1.5 * self.piece_of_point * np.ptp(self.points, axis=0).max()
        return find_overlaps((self.points + np.stack([apart, 0 * apart], axis=1))[self.corners]).pairs


def piece_areas(mesh: TriangleMesh, pieces: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return (k,) the areas of pieces on a surface, and (k, 3) their centres of area.

    pieces: (m,) the piece of each triangle.
    """
    areas = double_areas(edge_lengths(mesh.vertices, mesh.faces)) / 2
    moments = areas[:, None] * mesh.vertices[mesh.faces].mean(axis=1)
    sums = np.bincount(pieces, areas).astype(np.float64)
    centres = np.stack([np.bincount(pieces, column) for column in moments.T], axis=1)
    return sums, centres / np.maximum(sums, np.finfo(float).tiny)[:, None]


def lengths_of_edges(mesh: TriangleMesh) -> FloatArray:
    """Return (e,) the lengths of the edges of a mesh."""
    ends = mesh.vertices[mesh.edges]
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)


def largest_stretches(surface: CutSurface) -> FloatArray:
    """Return (m,) of both singular values of the map of each triangle, minus 1, the one of larger absolute value."""
    measured = measure_map(surface.mesh, surface.places)
    scale, root = np.exp(measured.log_area_scale), np.sqrt(measured.qc)
    changes = np.stack([scale * root - 1, scale / root - 1])
    return changes[np.abs(changes).argmax(axis=0), np.arange(len(scale))]
