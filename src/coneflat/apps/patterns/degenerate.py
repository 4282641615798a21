"""Triangles without area, replaced without a change of the surface: lengths in the plane could not be those on it."""

from __future__ import annotations

import numpy as np

from ... import TriangleMesh
from ...base import BoolArray, FloatArray, IntArray
from ...errors import DegenerateFaceError
from ...geometry import double_areas, edge_lengths

# Smallest height of a triangle, relative to its longest side.
MIN_HEIGHT = 1e-9
# Passes in which triangles are replaced: fans of them need one for each.
PASSES = 30


def without_degenerate(mesh: TriangleMesh) -> tuple[TriangleMesh, int]:
    """Return a mesh without triangles of no area, and how many there were.

    The longest side of such a triangle is replaced by the other diagonal of the quad of both of its triangles; at the
    border of the mesh, the triangle is left out.

    Raises:
        DegenerateFaceError: there are others.
    """
    count = int(_is_degenerate(mesh.vertices, mesh.faces).sum())
    for _ in range(PASSES):
        is_flat = _is_degenerate(mesh.vertices, mesh.faces)
        if not is_flat.any():
            return mesh, count
        mesh = _with_replaced(mesh, is_flat)
    raise DegenerateFaceError(
        f"{count:,} triangles without area could not be replaced: merge vertices at the same places first"
    )


def _is_degenerate(vertices: FloatArray, faces: IntArray) -> BoolArray:
    lengths = edge_lengths(vertices, faces)
    return double_areas(lengths) <= MIN_HEIGHT * lengths.max(axis=1) ** 2


def _with_replaced(mesh: TriangleMesh, is_flat: BoolArray) -> TriangleMesh:
    """Return a mesh with some of the given triangles replaced, none of which share a triangle."""
    faces, lengths = mesh.faces.copy(), edge_lengths(mesh.vertices, mesh.faces)
    is_changed, stays = np.zeros(len(faces), dtype=bool), np.ones(len(faces), dtype=bool)
    for face in np.flatnonzero(is_flat).tolist():
        corner = int(lengths[face].argmax())
        first, second = mesh.edge_halfedges[mesh.halfedge_edges[3 * face + corner]].tolist()
        if second < 0:
            stays[face], is_changed[face] = False, True
            continue
        twin = second if first == 3 * face + corner else first
        neighbour, opposite = divmod(twin, 3)
        if is_changed[face] or is_changed[neighbour]:
            continue
        tip, tail, head = (int(mesh.faces[face, (corner + k) % 3]) for k in range(3))
        apex = int(mesh.faces[neighbour, opposite])
        faces[face], faces[neighbour] = (tip, tail, apex), (tip, apex, head)
        is_changed[[face, neighbour]] = True
    return TriangleMesh(mesh.vertices, faces[stays])
