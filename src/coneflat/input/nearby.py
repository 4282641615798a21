"""Meshes whose numbering scatters neighbours over memory, numbered anew while they are worked on.

Subdivision puts new vertices at the end, exporters shuffle: then each loop over triangles waits for memory. Results do
not depend on the numbering but for rounding.
"""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray, IntArray
from ..compiled import compiled
from ..mesh import TriangleMesh

# Triangles from which on a mesh does not fit into the processor's own memory.
LARGE = 200_000
# Of the vertices of a mesh, how far apart the numbers of those of a triangle are where they are scattered, in the mean.
SCATTERED = 1 / 32
# Steps along each axis in which places are told from one another, as a power of two: three of them make an index.
BITS = 9


def brought_together(mesh: TriangleMesh) -> tuple[TriangleMesh, IntArray, IntArray] | None:
    """Return a mesh whose neighbours have numbers near each other, and which vertices (n,) and faces (m,) its own are.

    None: the mesh is small, or its numbering is good.
    """
    faces = mesh.faces
    if len(faces) < LARGE or mean_span(faces) < SCATTERED * len(mesh.vertices):
        return None
    face_order = along_curve(mesh.vertices, faces)
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
def along_curve(vertices: FloatArray, faces: IntArray) -> IntArray:
    """Return the triangles (m,) along a curve that fills space (G. M. Morton, 1966): their places' bits by turns."""
    steps, bins = 1 << BITS, 1 << (3 * BITS // 2 + 1)
    low, size = vertices[faces[0, 0]].copy(), 0.0
    for axis in range(3):
        low[axis] = vertices[:, axis].min()
        size = max(size, vertices[:, axis].max() - low[axis])
    codes = np.empty(len(faces), np.int64)
    for f in range(len(faces)):
        a, b, c = faces[f]
        code = 0
        for axis in range(3):
            middle = (vertices[a, axis] + vertices[b, axis] + vertices[c, axis]) / 3 - low[axis]
            step = min(int(middle / size * steps), steps - 1)
            for bit in range(BITS):
                code |= ((step >> bit) & 1) << (3 * bit + axis)
        codes[f] = code
    # By counting, first the lower half of the bits, then the upper.
    order, other = np.arange(len(faces)), np.empty(len(faces), np.int64)
    for shift in (0, 3 * BITS // 2 + 1):
        starts = np.zeros(bins + 1, np.int64)
        for f in range(len(codes)):
            starts[((codes[f] >> shift) & (bins - 1)) + 1] += 1
        for b in range(bins):
            starts[b + 1] += starts[b]
        for at in range(len(order)):
            b = (codes[order[at]] >> shift) & (bins - 1)
            other[starts[b]] = order[at]
            starts[b] += 1
        order, other = other, order
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
