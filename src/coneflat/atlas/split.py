"""Splitting a layout that overlaps itself."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray, IntArray
from ..mesh import TriangleMesh, corner_fans
from .regions import overlap_layers
from .separate import separate, widen


def split_overlaps(
    points: FloatArray,
    corners: IntArray,
    costs: FloatArray,
    areas: FloatArray,
    pairs: IntArray,
    least: float = 0.0,
) -> IntArray:
    """Return (m,) the chart of each triangle, numbered from 0, so that no chart has both of a pair.

    The two layers of the largest overlap are separated by the cheapest cut, then those of the next that is left.

    Args:
        points: (u, 2) of the plane.
        corners: (m, 3) indices of points; the triangles of a connected disk.
        costs: (3m,) positive, what it costs to cut the side opposite each corner.
        areas: (m,) by which overlaps are compared.
        pairs: (k, 2) of triangles to be separated.
        least: the area that a chart should have at least.
    """
    chart = np.zeros(len(corners), dtype=np.int64)
    while len(pairs):
        one, other = _largest(pairs, corners, areas)
        faces = np.flatnonzero(chart == chart[one[0]])
        disk = as_disk(points, corners[faces])
        layers = np.isin(faces, one), np.isin(faces, other)
        if least > 0:
            layers = widen(disk, *layers, areas[faces], least)
        sides = disk.edge_halfedges[:, 0]
        pieces = separate(disk, *layers, costs[3 * faces[sides // 3] + sides % 3])
        chart[faces] = np.where(pieces == 0, chart[faces], chart.max() + pieces)
        pairs = pairs[chart[pairs[:, 0]] == chart[pairs[:, 1]]]
    return chart


def as_disk(points: FloatArray, corners: IntArray) -> TriangleMesh:
    """Return triangles of the plane as a mesh of their own, opened where they touch in a point only."""
    is_used = np.zeros(len(points), dtype=bool)
    is_used[corners] = True
    pinched = TriangleMesh(points[is_used], (np.cumsum(is_used) - 1)[corners])
    if np.count_nonzero(pinched.is_boundary_edge) == np.count_nonzero(pinched.is_boundary_vertex):
        return pinched
    inside = pinched.edge_halfedges[~pinched.is_boundary_edge]
    count, fans = corner_fans(pinched.faces, *inside.T)
    vertices = np.empty((count, 2))
    vertices[fans] = pinched.vertices[pinched.faces]
    return TriangleMesh(vertices, fans)


def _largest(pairs: IntArray, corners: IntArray, areas: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the triangles of the two layers of the overlap in which most area is involved."""
    best, most = (pairs[0, :1], pairs[0, 1:]), -1.0
    for one, other in overlap_layers(pairs, corners):
        size = float(min(areas[one].sum(), areas[other].sum()))
        if size > most:
            best, most = (one, other), size
    return best
