"""Triangulations whose edges may be flipped: half-edge arrays instead of faces.

After flips two vertices can share several edges, an edge can end where it starts, and a triangle can be glued
to itself, so a triangle is known by its half-edges and not by its vertices. Slots are numbered as in
`coneflat.mesh.connectivity`: half-edge h = 3 f + i is the side of triangle f opposite corner i.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import FloatArray, IntArray
from ..mesh.connectivity import TriangleMesh


@dataclass(eq=False)
class IntrinsicTriangulation:
    """A triangulated surface given by gluings and lengths. Flips change its arrays in place.

    Attributes:
        twin: (3m,) the half-edge glued to each half-edge, -1 on the boundary.
        tail: (3m,) the vertex each half-edge starts from.
        length: (3m,) length of each half-edge, model units; the same bits on both sides of an edge.
        vertex_count: n.
    """

    twin: IntArray
    tail: IntArray
    length: FloatArray
    vertex_count: int

    @property
    def face_count(self) -> int:
        """The number of triangles."""
        return len(self.twin) // 3

    @property
    def faces(self) -> IntArray:
        """(m, 3) the vertex at each corner."""
        return self.tail.reshape(-1, 3)[:, [2, 0, 1]]

    def copy(self) -> IntrinsicTriangulation:
        """Return an independent copy."""
        return IntrinsicTriangulation(
            self.twin.copy(), self.tail.copy(), self.length.copy(), self.vertex_count
        )


def halfedge_twins(mesh: TriangleMesh) -> IntArray:
    """Return (3m,) the half-edge on the other side of each half-edge, -1 on the boundary."""
    sides = mesh.edge_halfedges
    twin = np.full(mesh.faces.size, -1, dtype=np.int64)
    inner = sides[sides[:, 1] >= 0]
    twin[inner[:, 0]] = inner[:, 1]
    twin[inner[:, 1]] = inner[:, 0]
    return twin


def intrinsic_triangulation(mesh: TriangleMesh, lengths: FloatArray) -> IntrinsicTriangulation:
    """Return the mesh's own triangles as an intrinsic triangulation.

    Args:
        mesh: the mesh.
        lengths: (m, 3) side lengths, model units.
    """
    twin = halfedge_twins(mesh)
    length = np.ascontiguousarray(lengths, dtype=np.float64).ravel().copy()
    lower = np.flatnonzero(twin > np.arange(len(twin)))
    length[twin[lower]] = length[lower]
    return IntrinsicTriangulation(twin, mesh.tails.copy(), length, len(mesh.vertices))


def double(triangulation: IntrinsicTriangulation) -> tuple[IntrinsicTriangulation, IntArray]:
    """Return the double of a bounded triangulation, and which vertex each of its vertices is a copy of.

    Triangles and vertices keep their numbers; triangle m + f mirrors triangle f, with its sides 1 and 2
    exchanged; boundary vertices are their own images. Edges of the boundary become inner edges, which can be
    flipped: no obtuse angle opposite a boundary edge is in the way of a Delaunay triangulation any more.
    """
    twin, tail, n = triangulation.twin, triangulation.tail, triangulation.vertex_count
    slots = np.arange(len(twin))
    head = tail[slots - slots % 3 + (slots + 1) % 3]
    mirror = len(twin) + slots - slots % 3 + np.array([0, 2, 1])[slots % 3]
    outer = twin < 0
    inside = np.ones(n, dtype=bool)
    inside[tail[outer]] = False
    inside[head[outer]] = False
    image = np.arange(n)
    image[inside] = n + np.arange(inside.sum())

    both = 2 * len(twin)
    new_twin, new_tail, length = np.empty(both, np.int64), np.empty(both, np.int64), np.empty(both)
    new_twin[slots] = np.where(outer, mirror, twin)
    new_twin[mirror] = np.where(outer, slots, mirror[twin])
    new_tail[slots], new_tail[mirror] = tail, image[head]
    length[slots] = length[mirror] = triangulation.length
    original = np.concatenate([np.arange(n), np.flatnonzero(inside)])
    return IntrinsicTriangulation(new_twin, new_tail, length, len(original)), original
