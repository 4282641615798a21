"""Splitting vertices along UV seams, for formats with one UV per vertex."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .._arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from ..result import Flattening


class SplitMesh(NamedTuple):
    """A mesh with one vertex for each pair of vertex and UV point that a triangle has.

    Attributes:
        vertices: (k, 3) positions.
        uv: (k, 2) UV points.
        faces: (m, 3) triangles.
        own: (k,) the vertex of the result.
        origin: (k,) the vertex of the input.
    """

    vertices: FloatArray
    uv: FloatArray
    faces: IntArray
    own: IntArray
    origin: IntArray


def split_at_seams(result: Flattening) -> SplitMesh:
    """Return the mesh of a result, split; in the order of its vertices, those without a face left out."""
    pairs = result.faces.astype(np.int64) * len(result.uv) + result.uv_faces
    kept, faces = np.unique(pairs.reshape(-1), return_inverse=True)
    own, point = np.divmod(kept, len(result.uv))
    origin = own if result.vertex_origin is None else result.vertex_origin[own]
    return SplitMesh(result.vertices[own], result.uv[point], faces.reshape(-1, 3), own, origin)
