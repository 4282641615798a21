"""Meshes whose numbering scatters neighbours over memory, numbered anew while they are worked on.

Subdivision puts new vertices at the end, exporters shuffle: then each loop over triangles waits for memory. Results do
not depend on the numbering but for rounding.
"""

from __future__ import annotations

import numpy as np

from .._arrays import IntArray
from ..compiled import compiled
from ..mesh import TriangleMesh
from ..threads import HUGE

# Triangles from which on a mesh does not fit into the processor's own memory.
LARGE = 200_000
# Of the vertices of a mesh, how far apart the numbers of those of a triangle are where they are scattered, in the mean.
SCATTERED = 1 / 32


def brought_together(mesh: TriangleMesh) -> tuple[TriangleMesh, IntArray, IntArray] | None:
    """Return a connected mesh whose neighbours have numbers near each other; with its (n,) vertices and (m,) faces.

    These are numbered as in the other one. Copies of a mesh stay alike. None: it is small, or huge, where memory is
    what matters, or its numbering is good.
    """
    faces = mesh.faces
    if not LARGE <= len(faces) <= HUGE or mean_span(faces) < SCATTERED * len(mesh.vertices):
        return None
    face_order = by_distance(mesh.halfedge_edges.reshape(-1, 3), mesh.edge_halfedges)
    vertex_order, found = by_first_use(faces, face_order, len(mesh.vertices))
    return TriangleMesh(mesh.vertices[vertex_order], found), vertex_order, face_order


@compiled
def mean_span(faces: IntArray) -> float:
    """Return how far apart the numbers of vertices of a triangle are, in the mean."""
    total = 0.0
    for f in range(len(faces)):
        a, b, c = faces[f]
        total += max(a, b, c) - min(a, b, c)
    return total / len(faces)


@compiled
def by_distance(edge_of: IntArray, sides: IntArray) -> IntArray:
    """Return the triangles (m,) of a connected mesh by how many edges are crossed from the first one to them.

    edge_of: (m, 3) the edge of each half-edge. sides: (e, 2) the half-edges of each edge, -1 for none.
    """
    order, is_listed = np.zeros(len(edge_of), np.int64), np.zeros(len(edge_of), np.bool_)
    is_listed[0] = True
    listed = 1
    for at in range(len(order)):
        for edge in edge_of[order[at]]:
            for side in sides[edge]:
                if side >= 0 and not is_listed[side // 3]:
                    is_listed[side // 3] = True
                    order[listed] = side // 3
                    listed += 1
    return order


@compiled
def by_first_use(faces: IntArray, face_order: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Return vertices (n,) as triangles in an order need them first; and the triangles (m, 3), so ordered, of these."""
    number, order, found = np.full(count, -1), np.empty(count, np.int64), np.empty(faces.shape, np.int64)
    used = 0
    for new in range(len(face_order)):
        for corner in range(3):
            vertex = faces[face_order[new], corner]
            if number[vertex] < 0:
                number[vertex], order[used] = used, vertex
                used += 1
            found[new, corner] = number[vertex]
    return order[:used], found
