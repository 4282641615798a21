"""Sides and cones that are near each other, which rounding must not put on one line, nor exchange."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from ... import TriangleMesh
from ...base import BoolArray, ComplexArray, FloatArray, IntArray
from ...mesh import NEXT, PREVIOUS, point_vertices
from .transitions import Transitions


def paths_to_sides(
    mesh: TriangleMesh,
    corners: IntArray,
    points: ComplexArray,
    cones: IntArray,
    transitions: Transitions,
    limit: float,
) -> list[list[int]]:
    """Return short paths of vertices between sides, or a side and a cone, that pass no other side or cone.

    Of all that join the same two, the shortest one; cones are joined by others.

    Args:
        mesh, corners, points: the layout.
        cones: vertices on grid points.
        transitions: of the layout.
        limit: of their lengths, in units.
    """
    sides = transitions.sides
    if not len(sides.axis):
        return []
    vertex = point_vertices(mesh.faces, corners, len(points))
    # What lies on sides has the number of one, cones have their own.
    label = np.full(len(mesh.vertices), -1)
    label[cones] = len(sides.axis) + np.arange(len(cones))
    inner = ~np.isin(vertex[sides.points], cones)
    label[vertex[sides.points[inner]]] = sides.side[inner]
    roots = np.flatnonzero(label >= 0)
    starts, ends = corners[:, NEXT].ravel(), corners[:, PREVIOUS].ravel()
    along = _along_sides(mesh, label, np.intersect1d(cones, vertex[sides.points]))
    lengths = np.abs(points[ends] - points[starts])
    kept = ~along[mesh.halfedge_edges]
    graph = csr_matrix((lengths[kept], (mesh.tails[kept], mesh.heads[kept])), shape=(len(label),) * 2)
    graph = graph.maximum(graph.T)
    distance, before, source = dijkstra(
        graph, indices=roots, limit=limit, min_only=True, return_predecessors=True
    )
    one, two = mesh.edges[~along].T
    reached = np.isfinite(distance[one]) & np.isfinite(distance[two])
    reached &= source[one] != source[two]
    one, two = one[reached], two[reached]
    total = distance[one] + distance[two] + np.asarray(graph[one, two]).ravel()
    return _shortest(one, two, total, label[source[one]], label[source[two]], before, limit, len(sides.axis))


def _along_sides(mesh: TriangleMesh, label: IntArray, ends: IntArray) -> BoolArray:
    """Return (e,) the edges along sides, given their (n,) labels and the cones at their ends."""
    both = label[mesh.edges]
    at_end = np.isin(mesh.edges, ends).any(axis=1)
    return (both >= 0).all(axis=1) & (at_end | (both[:, 0] == both[:, 1]))


def _shortest(
    one: IntArray,
    two: IntArray,
    total: FloatArray,
    here: IntArray,
    there: IntArray,
    before: IntArray,
    limit: float,
    side_count: int,
) -> list[list[int]]:
    """Return the shortest path over edges from `one` to `two` for each pair of labels, not between two cones."""
    kept = (total <= limit) & (here != there) & (np.minimum(here, there) < side_count)
    one, two, total, here, there = (values[kept] for values in (one, two, total, here, there))
    order = np.lexsort((total, np.maximum(here, there), np.minimum(here, there)))
    pairs = np.sort(np.stack([here, there], axis=1), axis=1)[order]
    first = np.ones(len(pairs), dtype=bool)
    first[1:] = (pairs[1:] != pairs[:-1]).any(axis=1)

    def to_root(vertex: int) -> list[int]:
        path = [vertex]
        while before[path[-1]] >= 0:
            path.append(int(before[path[-1]]))
        return path

    chosen = order[first]
    return [[*to_root(int(a))[::-1], *to_root(int(b))] for a, b in zip(one[chosen], two[chosen], strict=True)]


class PathVector(NamedTuple):
    """The vector between the ends of a path, in the frame of its first edge.

    Attributes:
        rows: (2, v) of it, by the variables, as far as these tell where the ends are.
        length: of it, in the layout; 0 along a single edge.
        first, last: the points at the ends.
        turn: by how many quarter turns the frame of the last edge is turned.
    """

    rows: IntArray
    length: float
    first: int
    last: int
    turn: int


def distances_to_sides(vectors: list[PathVector], transitions: Transitions) -> tuple[IntArray, FloatArray]:
    """Return (p, 2, v) the coordinate that separates the ends of vectors, with 0 for the other, and (p,) lengths."""
    found, lengths = [], []
    for one in vectors:
        known = _known_axes(transitions, one.first) & np.roll(
            _known_axes(transitions, one.last), one.turn % 2
        )
        for axis in np.flatnonzero(known).tolist():
            if one.rows[axis].any():
                found.append(np.stack([one.rows[axis], np.zeros_like(one.rows[axis])]))
                lengths.append(one.length)
    size = transitions.shifts.shape[1]
    return np.array(found, dtype=np.int64).reshape(len(found), 2, size), np.array(lengths)


def _known_axes(transitions: Transitions, point: int) -> BoolArray:
    """Return (2,) whether the variables tell a coordinate of a point."""
    held: BoolArray = transitions.held[transitions.base[point]]
    return np.roll(held, int(transitions.turn[point]) % 2)
