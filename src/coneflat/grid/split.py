"""Edges between cones split, so that triangles can follow wherever their cones go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .._arrays import BoolArray, ComplexArray, FloatArray, IntArray
from ..layout.relax.relax import rest_sides
from ..layout.relax.seam_chains import find_chains
from ..mesh import NEXT, PREVIOUS, TriangleMesh
from .aligned import Layout
from .sides import find_sides
from .transitions import charts_of

# Triangles that one with given sides split falls apart into, by their corners: 0 to 2 its own, 3 + i the middle of the
# side opposite corner i. The sides split are the bits of the index.
PIECES: tuple[tuple[tuple[int, int, int], ...], ...] = (
    ((0, 1, 2),),
    ((0, 1, 3), (0, 3, 2)),
    ((1, 2, 4), (1, 4, 0)),
    ((4, 3, 2), (0, 1, 3), (0, 3, 4)),
    ((2, 0, 5), (2, 5, 1)),
    ((5, 1, 3), (2, 0, 5), (2, 5, 3)),
    ((0, 5, 4), (1, 2, 4), (1, 4, 5)),
    ((0, 5, 4), (5, 1, 3), (4, 3, 2), (3, 4, 5)),
)


def between_whole(layout: Layout) -> BoolArray:
    """Return (e,) the edges between two vertices that are to lie on grid points.

    A triangle of three such has no place where these come to lie in a row.
    """
    is_whole = np.zeros(len(layout.mesh.vertices), dtype=bool)
    is_whole[layout.whole] = True
    return np.asarray(is_whole[layout.mesh.edges].all(axis=1))


def split_edges(layout: Layout, is_split: BoolArray) -> Layout:
    """Return a layout of the same surface with edges split in the middle; is_split: (e,)."""
    mesh, corners, points = layout.mesh, layout.corners, layout.points
    edge_of = mesh.halfedge_edges.reshape(-1, 3)
    number = np.full(len(mesh.edges), -1)
    number[is_split] = len(mesh.vertices) + np.arange(int(is_split.sum()))
    middle = mesh.vertices[mesh.edges[is_split]].mean(axis=1)
    own, pairs = _middle_points(corners, is_split[edge_of], len(points))
    origin, piece = _pieces((is_split[edge_of] * [1, 2, 4]).sum(axis=1))
    faces, new_corners = (
        np.take_along_axis(np.concatenate(both, axis=1)[origin], piece, axis=1)
        for both in ((mesh.faces, number[edge_of]), (corners, own))
    )
    places = np.take_along_axis(_six_places(layout.lengths)[origin], piece, axis=1)
    whole_mesh = TriangleMesh(np.concatenate([mesh.vertices, middle]), faces)
    lengths: FloatArray = np.abs(places[:, PREVIOUS] - places[:, NEXT])
    new_points = np.concatenate([points, points[pairs].mean(axis=1)])
    split = replace(layout, mesh=whole_mesh, lengths=lengths, corners=new_corners, points=new_points)
    return replace(split, sides=find_sides(whole_mesh, new_corners, new_points, _is_straight(split)))


def _pieces(kind: IntArray) -> tuple[IntArray, IntArray]:
    """Return (t,) the triangle of each piece, in order, and (t, 3) its corners; kind: (m,) the sides split."""
    origin, corners = [], []
    for which, pieces in enumerate(PIECES):
        at = np.flatnonzero(kind == which)
        for piece in pieces:
            origin.append(at)
            corners.append(np.tile(piece, (len(at), 1)))
    all_of = np.concatenate(origin)
    order = np.argsort(all_of, kind="stable")
    return all_of[order], np.concatenate(corners)[order]


def _middle_points(corners: IntArray, is_split: BoolArray, count: int) -> tuple[IntArray, IntArray]:
    """Return (m, 3) the point in the middle of each side that is split, from `count`, and (k, 2) between which."""
    ends = np.sort(np.stack([corners[:, NEXT], corners[:, PREVIOUS]], axis=-1), axis=-1)
    pairs, index = np.unique(ends[is_split], axis=0, return_inverse=True)
    own = np.full(corners.shape, -1)
    own[is_split] = count + index.ravel()
    return own, pairs


def _six_places(lengths: FloatArray) -> ComplexArray:
    """Return (m, 6) corners of triangles with given sides, and the middles of these, in the plane."""
    sides = rest_sides(lengths)
    places = np.stack([np.zeros(len(sides)), sides[:, 2], -sides[:, 1]], axis=1)
    middles = (places[:, NEXT] + places[:, PREVIOUS]) / 2
    return np.concatenate([places, middles], axis=1)


def _is_straight(layout: Layout) -> BoolArray:
    """Return (u,) the points of components whose boundary has straight sides."""
    count = len(layout.points)
    chains = find_chains(layout.mesh, layout.corners, layout.points, layout.cones)
    chart, component = charts_of(layout.corners, count, chains)
    of_point = component[chart]
    known = layout.sides.points
    return np.isin(of_point, of_point[known])
