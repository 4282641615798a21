"""Strain of layouts: the relative change of length of every edge, and the bounds of a material."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .... import TriangleMesh
from ....base import BoolArray, FloatArray, IntArray, has_any, mask_of
from ....geometry import double_areas, edge_lengths


@dataclass(frozen=True, eq=False)
class FlatEdges:
    """The k edges of triangles in the plane; the two sides of a seam are different edges.

    Attributes:
        ends: (k, 2) their points, the smaller index first.
        lengths: (k,) their lengths on the surface.
        edges: (k,) the edge of the mesh of each of them.
        partners: (q, 2) the two sides of each of q seam edges, as indices of flat edges.
        double_areas: (m,) twice the areas of the triangles on the surface.
    """

    ends: IntArray
    lengths: FloatArray
    edges: IntArray
    partners: IntArray
    double_areas: FloatArray

    @classmethod
    def of(cls, mesh: TriangleMesh, corners: IntArray) -> FlatEdges:
        """Return the edges of a layout; corners: (m, 3) the point at each corner of the triangles of `mesh`."""
        sides = np.stack([corners[:, [1, 2, 0]], corners[:, [2, 0, 1]]], axis=2).reshape(-1, 2)
        # Pairs of points as single numbers are sorted several times as fast.
        count = int(corners.max()) + 1
        keys, first = np.unique(sides.min(axis=1) * count + sides.max(axis=1), return_index=True)
        ends = np.stack([keys // count, keys % count], axis=1)
        edges = mesh.halfedge_edges[first]
        tips = mesh.vertices[mesh.edges[edges]]
        order = np.argsort(edges, kind="stable")
        is_pair = edges[order[1:]] == edges[order[:-1]]
        partners = np.stack([order[:-1][is_pair], order[1:][is_pair]], axis=1)
        lengths = np.linalg.norm(tips[:, 1] - tips[:, 0], axis=1)
        return cls(ends, lengths, edges, partners, double_areas(edge_lengths(mesh.vertices, mesh.faces)))

    def around(self, is_free: BoolArray, is_triangle: BoolArray) -> FlatEdges:
        """Return the edges with free points (n,) and their partners; is_triangle: (m,) the triangles to keep."""
        has_free: BoolArray = has_any(is_free, self.ends)
        partners = self.partners[has_any(has_free, self.partners)]
        chosen = has_free | mask_of(len(has_free), partners)
        number = np.cumsum(chosen) - 1
        return FlatEdges(
            self.ends[chosen],
            self.lengths[chosen],
            self.edges[chosen],
            number[partners],
            self.double_areas[is_triangle],
        )

    def vectors(self, points: FloatArray) -> FloatArray:
        """Return (k, 2) the flat edges as vectors."""
        return points[self.ends[:, 1]] - points[self.ends[:, 0]]

    def strains(self, points: FloatArray) -> FloatArray:
        """Return (k,) the relative changes of length."""
        return np.linalg.norm(self.vectors(points), axis=1) / self.lengths - 1


@dataclass(frozen=True)
class Stretch:
    """How far a material may be strained.

    Attributes:
        warp: largest relative change of length along the grain, which is the second axis of the plane.
        weft: the same across the grain.

    Notes:
        In a direction at an angle t to the grain, it is warp cos^2 t + weft sin^2 t, as the strain of a fabric without
        shear would be.
    """

    warp: float
    weft: float

    def bounds(self, vectors: FloatArray) -> FloatArray:
        """Return (k,) the largest strains along vectors (k, 2)."""
        squares = vectors**2
        return (self.weft * squares[:, 0] + self.warp * squares[:, 1]) / squares.sum(axis=1)


def relative_strains(edges: FlatEdges, points: FloatArray, stretch: Stretch) -> FloatArray:
    """Return (k,) the strains divided by the bounds in their directions: from -1 to 1 where a material allows them."""
    return edges.strains(points) / stretch.bounds(edges.vectors(points))
