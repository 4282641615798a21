"""Splitting vertices along UV seams and creases, for formats with one UV and one normal per vertex."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..base.arrays import FloatArray, IntArray
from .normals import CornerNormals

if TYPE_CHECKING:
    from ..result import Flattening


class SplitMesh(NamedTuple):
    """A mesh with one vertex for each vertex, UV point and normal that a triangle has together.

    Attributes:
        vertices: (k, 3) positions.
        uv: (k, 2) UV points.
        faces: (m, 3) triangles.
        own: (k,) the vertex of the result.
        origin: (k,) the vertex of the input.
        normals: (k, 3) normals, if some were given.
    """

    vertices: FloatArray
    uv: FloatArray
    faces: IntArray
    own: IntArray
    origin: IntArray
    normals: FloatArray | None = None


def split_at_seams(result: Flattening, normals: CornerNormals | None = None) -> SplitMesh:
    """Return the mesh of a result, split; in the order of its vertices, those without a face left out.

    normals: those at which it is to be split, too.
    """
    own, point, faces = _pairs(result.faces.reshape(-1), result.uv_faces.reshape(-1), len(result.uv))
    shading = None
    if normals is not None:
        corners = normals.corners.reshape(-1)
        pair, normal, faces = _pairs(faces, corners, len(normals.normals))
        own, point, shading = own[pair], point[pair], normals.normals[normal]
    origin = own if result.vertex_origin is None else result.vertex_origin[own]
    return SplitMesh(result.vertices[own], result.uv[point], faces.reshape(-1, 3), own, origin, shading)


def _pairs(vertices: IntArray, points: IntArray, point_count: int) -> tuple[IntArray, IntArray, IntArray]:
    """Return the vertices and the points of all different pairs, in order, and the number of every pair."""
    vertex_of = np.full(point_count, -1, dtype=np.int64)
    vertex_of[points] = vertices
    if np.array_equal(vertex_of[points], vertices):
        # Each point has one vertex, as in all layouts of our own: they are fewer than the pairs, and sooner sorted.
        used = np.flatnonzero(vertex_of >= 0)
        point = used[np.argsort(vertex_of[used], kind="stable")]
        number = np.empty(point_count, dtype=np.int64)
        number[point] = np.arange(len(point))
        return vertex_of[point], point, number[points]
    pairs, number = np.unique(vertices * point_count + points, return_inverse=True)
    return *np.divmod(pairs, point_count), number.reshape(-1)
