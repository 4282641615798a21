"""Charts of a mesh whose triangle corners have points in the plane, and the seams between and within charts."""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.jit import compiled
from ..base.sets import number_sets, unite
from .connectivity import TriangleMesh, end_corners

# Largest UV distance, relative to the UV edge length, at which the two sides of an edge count as joined.
JOIN_TOLERANCE = 1e-6

Values = TypeVar("Values", FloatArray, IntArray)


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
    corners = np.ascontiguousarray(corners)
    if among is not None:
        return among[find_split(mesh.edge_halfedges[among], corners)]
    return np.flatnonzero(find_split(mesh.edge_halfedges, corners))


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
    return find_joined(mesh.edge_halfedges, uv, JOIN_TOLERANCE)


def label_charts(mesh: TriangleMesh, joined: BoolArray) -> tuple[int, IntArray]:
    """Return the number of charts, and (m,) the chart of each triangle; `joined` (e,) is True for edges in charts."""
    number, labels = label_across(mesh.edge_halfedges, joined, len(mesh.faces))
    return int(number), labels


@compiled
def label_across(edge_halfedges: IntArray, joined: BoolArray, count: int) -> tuple[int, IntArray]:
    """Return the number of components of `count` triangles connected across joined edges (e,), and that of each."""
    parent = np.arange(count)
    for e in range(len(joined)):
        if joined[e]:
            unite(parent, edge_halfedges[e, 0] // 3, edge_halfedges[e, 1] // 3)
    return number_sets(parent), parent


@compiled
def find_split(edge_halfedges: IntArray, corners: IntArray) -> BoolArray:
    """Return (e,) whether the two sides of each edge have different points at their ends; False on the boundary.

    Args:
        edge_halfedges: (e, 2) the half-edges of each edge, of opposite directions; -1 on the boundary.
        corners: (m, 3) the point at each corner.
    """
    split = np.zeros(len(edge_halfedges), np.bool_)
    for e in range(len(edge_halfedges)):
        h, t = edge_halfedges[e]
        if t >= 0:
            f, g = h // 3, t // 3
            split[e] = (
                corners[f, (h + 1) % 3] != corners[g, (t + 2) % 3]
                or corners[f, (h + 2) % 3] != corners[g, (t + 1) % 3]
            )
    return split


@compiled
def find_joined(edge_halfedges: IntArray, corner_uv: FloatArray, near: float) -> BoolArray:
    """Return (e,) whether the two sides of each edge have the same ends in the plane; False on the boundary.

    Args:
        edge_halfedges: (e, 2) the half-edges of each edge, of opposite directions; -1 on the boundary.
        corner_uv: (m, 3, 2) positions of the corners.
        near: largest distance of coinciding ends, relative to the longer side.
    """
    joined = np.zeros(len(edge_halfedges), np.bool_)
    for e in range(len(edge_halfedges)):
        h, t = edge_halfedges[e]
        if t < 0:
            continue
        f, g = h // 3, t // 3
        start, end = corner_uv[f, (h + 1) % 3], corner_uv[f, (h + 2) % 3]
        other_end, other_start = corner_uv[g, (t + 1) % 3], corner_uv[g, (t + 2) % 3]
        if (
            start[0] == other_start[0]
            and start[1] == other_start[1]
            and end[0] == other_end[0]
            and end[1] == other_end[1]
        ):
            joined[e] = True
            continue
        gap = max(
            math.hypot(start[0] - other_start[0], start[1] - other_start[1]),
            math.hypot(end[0] - other_end[0], end[1] - other_end[1]),
        )
        length = math.hypot(end[0] - start[0], end[1] - start[1])
        other_length = math.hypot(other_end[0] - other_start[0], other_end[1] - other_start[1])
        joined[e] = gap <= near * max(length, other_length)
    return joined
