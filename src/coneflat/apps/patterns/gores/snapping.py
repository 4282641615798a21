"""Vertices that slide along a surface onto an axis or a half-plane nearby, so that its division leaves no needles."""

from __future__ import annotations

import numpy as np

from .... import TriangleMesh
from ....base import BoolArray, FloatArray, IntArray
from ....mesh import tie_key

# How far vertices slide, relative to an edge: nearer crossings would leave triangles ten times longer than wide, whose
# short sides dominate the largest strain.
MAX_SLIDE = 0.1
# How far the surface may move there, relative to the longest edge at the vertex, so that sharp corners remain.
MAX_HEIGHT = 0.02
# Area of a triangle after sliding, relative to before, below which its vertices remain.
MIN_AREA = 0.5
# Digits of lengths and keys by which the edge to slide along is chosen: rounding errors are smaller.
DIGITS = 7


def slid_to_crossings(
    mesh: TriangleMesh, is_crossed: BoolArray, share: FloatArray, is_fixed: BoolArray, longest: FloatArray
) -> FloatArray:
    """Return (n, 3) the vertices, those near a crossing of one of their edges moved there.

    Vertices of the border slide along it.

    Args:
        mesh: the mesh.
        is_crossed: (e,) the edges that are crossed.
        share: (e,) where, from their first to their second vertex.
        is_fixed: (n,) vertices that remain.
        longest: (n,) length of the longest edge at each vertex.
    """
    edge = np.tile(np.flatnonzero(is_crossed), 2)
    start, target = np.concatenate([mesh.edges[is_crossed], mesh.edges[is_crossed][:, ::-1]]).T
    part = np.concatenate([share[is_crossed], 1 - share[is_crossed]])
    may_slide = (part <= MAX_SLIDE) & ~is_fixed[start]
    may_slide &= ~mesh.is_boundary_vertex[start] | mesh.is_boundary_edge[edge]
    start, target, part = start[may_slide], target[may_slide], part[may_slide, None]
    places = mesh.vertices[start] * (1 - part) + mesh.vertices[target] * part
    lengths = np.linalg.norm(places - mesh.vertices[start], axis=1) / longest[start]
    key = np.round(tie_key(mesh.vertices), DIGITS)[target]
    return _slid(mesh, *_first_of_each(start, places, [key, np.round(lengths, DIGITS)]), longest)


def slid_to_axis(mesh: TriangleMesh, longest: FloatArray) -> FloatArray:
    """Return (n, 3) the vertices, those near a place where the third axis meets one of their triangles moved there."""
    x, y = mesh.vertices[mesh.faces][:, :, 0], mesh.vertices[mesh.faces][:, :, 1]
    opposite = np.roll(x, -1, axis=1) * np.roll(y, -2, axis=1) - np.roll(x, -2, axis=1) * np.roll(
        y, -1, axis=1
    )
    is_met = ((opposite >= 0).all(axis=1) | (opposite <= 0).all(axis=1)) & opposite.any(axis=1)
    weights = opposite[is_met] / opposite[is_met].sum(axis=1, keepdims=True)
    faces = mesh.faces[is_met]
    start = np.take_along_axis(faces, weights.argmax(axis=1)[:, None], axis=1)[:, 0]
    may_slide = (weights.max(axis=1, initial=0.0) >= 1 - MAX_SLIDE) & ~mesh.is_boundary_vertex[start]
    places = (weights[:, :, None] * mesh.vertices[faces]).sum(axis=1)[may_slide]
    places[:, :2] = 0.0
    return _slid(mesh, *_first_of_each(start[may_slide], places, [places[:, 2]]), longest)


def _first_of_each(
    vertices: IntArray, places: FloatArray, keys: list[FloatArray]
) -> tuple[IntArray, FloatArray]:
    """Return each vertex once, with its place that comes first by the last of the keys, then by those before."""
    order = np.lexsort(keys)
    unique, first = np.unique(vertices[order], return_index=True)
    return unique, places[order[first]]


def _slid(mesh: TriangleMesh, moved: IntArray, places: FloatArray, longest: FloatArray) -> FloatArray:
    """Return the vertices with some moved to places, except where the surface would be changed or folded."""
    vertices = mesh.vertices.copy()
    vertices[moved] = places
    is_lifted = _heights(mesh, vertices) > MAX_HEIGHT * longest
    vertices[is_lifted] = mesh.vertices[is_lifted]
    before = _area_vectors(mesh.vertices, mesh.faces)
    squares = (before**2).sum(axis=1)
    while True:
        products = (before * _area_vectors(vertices, mesh.faces)).sum(axis=1)
        # Triangles whose vertices were put back have their area, and remain so.
        returned = np.unique(mesh.faces[products < MIN_AREA * squares])
        if not len(returned):
            return vertices
        vertices[returned] = mesh.vertices[returned]


def _heights(mesh: TriangleMesh, vertices: FloatArray) -> FloatArray:
    """Return (n,) how far vertices moved out of the planes of their triangles, or away from the border."""
    shift = vertices - mesh.vertices
    normals = _area_vectors(mesh.vertices, mesh.faces)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), np.finfo(float).tiny)[:, None]
    heights = np.zeros(len(vertices))
    np.maximum.at(heights, mesh.faces, np.abs((shift[mesh.faces] * normals[:, None]).sum(axis=2)))
    border = mesh.edges[mesh.is_boundary_edge]
    along = mesh.vertices[border[:, 1]] - mesh.vertices[border[:, 0]]
    along /= np.linalg.norm(along, axis=1)[:, None]
    for ends in border.T:
        np.maximum.at(heights, ends, np.linalg.norm(np.cross(shift[ends], along), axis=1))
    return heights


def _area_vectors(vertices: FloatArray, faces: IntArray) -> FloatArray:
    a, b, c = vertices[faces].transpose(1, 0, 2)
    return np.cross(b - a, c - a)
