"""Splitting a layout that overlaps itself."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray, IntArray
from ..mesh import TriangleMesh, corner_fans
from .regions import largest_layers
from .separate import separate, widen


def split_overlaps(
    points: FloatArray,
    corners: IntArray,
    costs: FloatArray,
    areas: FloatArray,
    pairs: IntArray,
    least: float = 0.0,
    most: float = np.inf,
) -> IntArray | None:
    """Return (m,) the chart of each triangle, numbered from 0, so that no chart has both of a pair; None if too many.

    The two layers of the largest overlap are separated by the cheapest cut, then those of the largest that is left in
    each piece.

    Args:
        points: (u, 2) of the plane.
        corners: (m, 3) indices of points; the triangles of a connected disk.
        costs: (3m,) positive, what it costs to cut the side opposite each corner.
        areas: (m,) by which overlaps are compared.
        pairs: (k, 2) of triangles to be separated, in lexicographic order.
        least: the area that a chart should have at least.
        most: the number of charts that are too many.
    """
    chart, count = np.zeros(len(corners), dtype=np.int64), 1
    waiting = [(np.arange(len(corners)), pairs)] if len(pairs) else []
    while waiting and count < most:
        faces, pairs = waiting.pop()
        disk = as_disk(points, corners[faces])
        one, other = np.zeros((2, len(faces)), dtype=bool)
        for layer, members in zip((one, other), largest_layers(pairs, disk.faces, areas[faces]), strict=True):
            layer[members] = True
        if least > 0:
            one, other = widen(disk, one, other, areas[faces], least)
        sides = disk.edge_halfedges[:, 0]
        pieces = separate(disk, one, other, costs[3 * faces[sides // 3] + sides % 3])
        if pieces is None:
            # They stay together, and overlap: so it is measured, and told.
            continue
        left = np.where(pieces[pairs[:, 0]] == pieces[pairs[:, 1]], pieces[pairs[:, 0]], -1)
        for piece in range(int(pieces.max()) + 1):
            members = np.flatnonzero(pieces == piece)
            if piece:
                chart[faces[members]] = count
                count += 1
            if (left == piece).any():
                waiting.append((faces[members], np.searchsorted(members, pairs[left == piece])))
    return None if waiting else chart


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
