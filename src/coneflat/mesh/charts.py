"""Charts of a mesh whose triangle corners have points in the plane, and the seams between and within charts."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from .connectivity import TriangleMesh, end_corners, label_components

# Largest UV distance, relative to the UV edge length, at which the two sides of an edge count as joined.
JOIN_TOLERANCE = 1e-6

Values = TypeVar("Values", FloatArray, IntArray, ComplexArray)


def both_sides(mesh: TriangleMesh, edges: IntArray, at_corners: Values) -> tuple[Values, Values]:
    """Return the values (k, 2, ...) at the ends of inner edges in the first and in the second face of each edge.

    Both have the same order of ends.

    Args:
        mesh: the mesh.
        edges: (k,) inner edges.
        at_corners: (m, 3, ...) values at the corners.
    """
    flat = at_corners.reshape(-1, *at_corners.shape[2:])
    one, two = (end_corners(mesh.edge_halfedges[edges, side]) for side in (0, 1))
    return flat[np.stack(one, axis=1)], flat[np.stack(two[::-1], axis=1)]


def point_seams(mesh: TriangleMesh, corners: IntArray, among: IntArray | None = None) -> IntArray:
    """Return the inner edges whose two sides have different points.

    Args:
        mesh: the mesh.
        corners: (m, 3) the point at each corner.
        among: edges to choose from; None: all.
    """
    inner = np.flatnonzero(~mesh.is_boundary_edge) if among is None else among[~mesh.is_boundary_edge[among]]
    here, there = both_sides(mesh, inner, corners)
    return inner[(here[:, 0] != there[:, 0]) | (here[:, 1] != there[:, 1])]


def point_vertices(faces: IntArray, corners: IntArray, count: int) -> IntArray:
    """Return (count,) the vertex of each point; faces, corners: (m, 3) the vertex and the point at each corner."""
    vertex = np.zeros(count, dtype=np.int64)
    vertex[corners.ravel()] = faces.ravel()
    return vertex


def uv_seams(mesh: TriangleMesh, corner_uv: FloatArray) -> IntArray:
    """Return the inner edges whose two sides do not coincide in the plane; `corner_uv` is (m, 3, 2)."""
    return np.flatnonzero(~joined_edges(mesh, corner_uv) & ~mesh.is_boundary_edge)


def joined_edges(mesh: TriangleMesh, corner_uv: FloatArray) -> BoolArray:
    """Return (e,) True for inner edges whose two sides coincide in the plane; `corner_uv` is (m, 3, 2)."""
    uv = np.ascontiguousarray(corner_uv, dtype=np.float64)
    inner = np.flatnonzero(~mesh.is_boundary_edge)
    here, there = both_sides(mesh, inner, uv.view(np.complex128)[..., 0])
    gap = np.abs(here - there).max(axis=1)
    length = np.maximum(np.abs(here[:, 1] - here[:, 0]), np.abs(there[:, 1] - there[:, 0]))
    joined = np.zeros(len(mesh.edges), dtype=bool)
    joined[inner] = gap <= JOIN_TOLERANCE * length
    return joined


def label_charts(mesh: TriangleMesh, joined: BoolArray) -> tuple[int, IntArray]:
    """Return the number of charts, and (m,) the chart of each triangle; `joined` (e,) is True for edges in charts."""
    return label_components(len(mesh.faces), *mesh.edge_faces[joined].T)
