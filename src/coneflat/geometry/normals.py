"""Normals of faces, at vertices and at corners, and how sharply a surface bends at its edges."""

from __future__ import annotations

import numpy as np

from ..base.arrays import FloatArray, IntArray, dots
from ..mesh.connectivity import TriangleMesh, corner_fans
from .triangles import corner_angles, edge_lengths

#: Cosine of the angle, about 53 degrees, by which faces bend at an edge that is drawn sharp: between the 42 degrees
#: of an icosahedron, which stands for a ball, and the 60 of a hexagonal prism, which is meant to have edges.
CREASE_COSINE = 0.6


def face_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return (m, 3) normals of faces, as long as twice their areas."""
    a, b, c = (np.take(vertices, faces[:, k], axis=0) for k in range(3))
    return np.asarray(np.cross(b - a, c - a))


def vertex_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return (n, 3) unit normals, each the mean of its faces' by area; 0 where there is none."""
    return unit_vectors(sums_at(faces, face_normals(vertices, faces)[:, None], len(vertices)))


def corner_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return (m, 3, 3) the unit normal at each corner: the mean by angle of faces joined to it across no crease."""
    flat = unit_vectors(face_normals(vertices, faces))
    pairs = TriangleMesh(vertices, faces).edge_halfedges
    pairs = pairs[pairs[:, 1] >= 0]
    smooth = pairs[dots(flat[pairs[:, 0] // 3], flat[pairs[:, 1] // 3]) > CREASE_COSINE]
    count, fan = corner_fans(faces, smooth[:, 0], smooth[:, 1])
    weights = flat[:, None, :] * corner_angles(edge_lengths(vertices, faces))[:, :, None]
    return unit_vectors(sums_at(fan, weights, count))[fan]


def sums_at(places: IntArray, vectors: FloatArray, count: int) -> FloatArray:
    """Return (count, 3) for each place the sum of the vectors at it, of (m, 3) places and (m, 3 or 1, 3) vectors."""
    each = np.broadcast_to(vectors, (*places.shape, 3))
    return np.stack([np.bincount(places.ravel(), each[..., k].ravel(), count) for k in range(3)], axis=1)


def unit_vectors(vectors: FloatArray) -> FloatArray:
    """Return vectors of length one, of (k, 3) of any size; 0 for those without a direction."""
    with np.errstate(over="ignore", invalid="ignore"):
        # Squares of the largest component's parts neither overflow nor vanish.
        scaled = vectors / np.maximum(np.abs(vectors).max(axis=1, keepdims=True), np.finfo(float).tiny)
        lengths = np.linalg.norm(scaled, axis=1, keepdims=True)
    is_vector = np.isfinite(lengths) & (lengths > 0)
    return np.where(is_vector, scaled / np.where(is_vector, lengths, 1), 0.0)


def dihedral_angles(mesh: TriangleMesh) -> FloatArray:
    """Return (e,) the angle between the normals of the faces beside each edge, radians; 0 on the boundary.

    Where the faces run counterclockwise seen from outside, it is positive on ridges and negative in valleys.
    """
    normals = face_normals(mesh.vertices, mesh.faces)
    one, two = normals[mesh.edge_faces[:, 0]], normals[mesh.edge_faces[:, 1]]
    side = mesh.edge_halfedges[:, 0]
    along = mesh.vertices[mesh.heads[side]] - mesh.vertices[mesh.tails[side]]
    across = np.cross(one, two)
    angles = np.arctan2(np.sqrt(dots(across, across)), dots(one, two))
    return np.where(mesh.is_boundary_edge, 0.0, np.where(dots(across, along) < 0, -angles, angles))
