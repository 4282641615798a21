"""Edges of layouts that are split, for example between vertices on grid points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base import BoolArray, ComplexArray, FloatArray, IntArray, mask_of
from ..geometry import rest_sides
from ..mesh import NEXT, PREVIOUS
from .features import split_longest
from .grid_layout import GridLayout, at_origin, find_sides, joined_charts


def split_between_nodes(layout: GridLayout, lines: IntArray | None = None) -> GridLayout:
    """Return a layout with the edges between vertices on grid points split.

    Otherwise triangles may have grid points at all corners, which degenerate if they are collinear. Vertices of edges
    (k,) that may get on grid lines may become such points.
    """
    mesh = layout.mesh
    is_node = mask_of(len(mesh.vertices), layout.nodes)
    may_be = is_node if lines is None else is_node | mask_of(len(is_node), mesh.edges[lines])
    tails, heads = mesh.edges.T
    is_split = (is_node[tails] & may_be[heads]) | (may_be[tails] & is_node[heads])
    return with_split_edges(layout, is_split) if is_split.any() else layout


def with_split_edges(layout: GridLayout, is_split: BoolArray) -> GridLayout:
    """Return a layout of the same surface with the edges `is_split` (e,) split at their midpoints."""
    points = layout.points
    mesh, origin, piece = split_longest(layout.mesh, is_split, layout.lengths)
    middles, pairs = _middle_points(layout, is_split)
    six = np.concatenate([layout.corners, middles], axis=1)
    corners, places = (
        np.take_along_axis(six_of[origin], piece, axis=1) for six_of in (six, _six_places(layout.lengths))
    )
    lengths: FloatArray = np.abs(places[:, PREVIOUS] - places[:, NEXT])
    points = np.concatenate([points, points[pairs].mean(axis=1)])
    # The order of edges along the seams changes, so charts may be joined at other chains.
    split, component = joined_charts(
        replace(layout, mesh=mesh, lengths=lengths, corners=corners, points=points)
    )
    # Components whose boundary has straight sides still have them.
    sides = find_sides(split, np.isin(component, component[layout.sides.points]))
    return at_origin(replace(split, sides=sides), component)


def _middle_points(layout: GridLayout, is_split: BoolArray) -> tuple[IntArray, IntArray]:
    """Return (m, 3) the midpoints of split sides, numbered after the points, and (k, 2) the end points of the sides."""
    sides = np.flatnonzero(is_split[layout.mesh.halfedge_edges])
    ends = np.sort(np.stack(layout.ends, axis=1)[sides], axis=1)
    pairs, index = np.unique(ends, axis=0, return_inverse=True)
    middles = np.full(layout.corners.size, -1)
    middles[sides] = len(layout.points) + index.ravel()
    return middles.reshape(-1, 3), pairs


def _six_places(lengths: FloatArray) -> ComplexArray:
    """Return (m, 6) the corners of triangles with given side lengths in the plane, and the midpoints of their sides."""
    sides = rest_sides(lengths)
    places = np.stack([np.zeros(len(sides)), sides[:, 2], -sides[:, 1]], axis=1)
    middles = (places[:, NEXT] + places[:, PREVIOUS]) / 2
    return np.concatenate([places, middles], axis=1)
