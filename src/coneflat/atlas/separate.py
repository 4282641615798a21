"""The shortest cut through a disk that separates two sets of its triangles.

In the plane a minimum cut between two triangles, with lengths of edges as capacities, is a shortest path between the
two parts of the border that lie between them (planar duality): no flow has to be computed.
"""

from __future__ import annotations

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from ..geometry.charts import label_charts
from ..geometry.graph import MultiGraph, trace_back
from ..mesh import TriangleMesh


def separate(disk: TriangleMesh, one: BoolArray, other: BoolArray, costs: FloatArray) -> IntArray | None:
    """Return (m,) the piece of each triangle after the cheapest cut between two sets of them, from 0.

    None if each set, down to a single triangle, keeps the other from the border.

    Args:
        disk: a topological disk.
        one, other: (m,) True for the triangles to be separated: two sets, connected each, without a common member.
        costs: (e,) of each edge, positive.
    """
    border = disk.halfedge_edges[disk.boundary_walk()]
    both = _both_to_the_border(disk, border, one, other)
    if both is None:
        return None
    one, other = both
    beside = disk.edge_faces[border, 0]
    mark = np.where(one[beside], 1, np.where(other[beside], 2, 0))
    starts, ends = _between(disk, border, mark)
    cut = _cheapest_path(disk, starts, ends, one, other, costs)
    glued = ~disk.is_boundary_edge
    glued[cut] = False
    return label_charts(disk, glued)[1]


def _both_to_the_border(
    disk: TriangleMesh, border: IntArray, one: BoolArray, other: BoolArray
) -> tuple[BoolArray, BoolArray] | None:
    """Return two sets of triangles with a path from each to the border; of one around the other, a single triangle."""
    for first, second in (
        (one, other),
        (_single(one), other),
        (one, _single(other)),
        (_single(one), _single(other)),
    ):
        wide = _to_the_border(disk, border, first, second)
        if wide is None:
            continue
        wider = _to_the_border(disk, border, second, wide)
        if wider is not None:
            return wide, wider
    return None


def _single(chosen: BoolArray) -> BoolArray:
    """Return one of the chosen triangles alone."""
    first = np.zeros_like(chosen)
    first[np.argmax(chosen)] = True
    return first


def _to_the_border(
    disk: TriangleMesh, border: IntArray, chosen: BoolArray, barred: BoolArray
) -> BoolArray | None:
    """Return chosen triangles, with the shortest path from them to the border if none of them is there.

    None if there is no path that does not lead through those that are barred.
    """
    beside = disk.edge_faces[border, 0]
    if chosen[beside].any():
        return chosen
    inside = disk.edge_faces[~disk.is_boundary_edge]
    inside = inside[~barred[inside].any(axis=1)]
    dual = MultiGraph(len(disk.faces), inside[:, 0], inside[:, 1], np.ones(len(inside)))
    distance, before, _ = dual.shortest_paths(np.flatnonzero(chosen))
    free = beside[~barred[beside]]
    if not np.isfinite(distance[free]).any():
        return None
    nodes, _ = trace_back(free[[np.argmin(distance[free])]], before)
    widened = chosen.copy()
    widened[nodes] = True
    return widened


def widen(
    disk: TriangleMesh, one: BoolArray, other: BoolArray, areas: FloatArray, least: float
) -> tuple[BoolArray, BoolArray]:
    """Return two sets of triangles, each with those nearest to it, and nearer to it than to the other, up to an area.

    areas: (m,) of the triangles.
    """
    inside = disk.edge_faces[~disk.is_boundary_edge]
    middles = disk.vertices[disk.faces].mean(axis=1)
    lengths = np.linalg.norm(middles[inside[:, 0]] - middles[inside[:, 1]], axis=1)
    dual = MultiGraph(len(disk.faces), inside[:, 0], inside[:, 1], lengths)
    distance, _, source = dual.shortest_paths(np.flatnonzero(one | other))
    order = np.argsort(distance, kind="stable")

    def widened(chosen: BoolArray) -> BoolArray:
        own = order[chosen[source[order]]]
        full = max(np.count_nonzero(chosen), 1 + int(np.searchsorted(np.cumsum(areas[own]), least)))
        wide = np.zeros_like(chosen)
        wide[own[:full]] = True
        return wide

    return widened(one), widened(other)


def _between(disk: TriangleMesh, border: IntArray, mark: IntArray) -> tuple[IntArray, IntArray]:
    """Return the vertices of the border between the sides marked 1 and those marked 2, and between 2 and 1.

    border: (b,) edges in order. mark: (b,).
    """
    # Turned so that the sides marked 1 come last; as both sets are connected, they do not alternate.
    marked = np.flatnonzero(mark)
    turn = marked[np.flatnonzero((mark[marked] == 1) & (mark[np.roll(marked, -1)] == 2))[0]] + 1
    border, mark = np.roll(border, -turn), np.roll(mark, -turn)
    twos, ones = np.flatnonzero(mark == 2), np.flatnonzero(mark == 1)
    tails = disk.tails[disk.edge_halfedges[border, 0]]
    return tails[: twos[0] + 1], tails[twos[-1] + 1 : ones[0] + 1]


def _cheapest_path(
    disk: TriangleMesh,
    starts: IntArray,
    ends: IntArray,
    one: BoolArray,
    other: BoolArray,
    costs: FloatArray,
) -> IntArray:
    """Return the edges of the cheapest path inside a disk that runs through neither set of triangles."""
    faces = disk.edge_faces
    passable = ~disk.is_boundary_edge
    passable &= ~(one[faces].all(axis=1) | other[faces].all(axis=1))
    edges = np.flatnonzero(passable)
    ends_of = disk.edges[edges]
    graph = MultiGraph(len(disk.vertices), ends_of[:, 0], ends_of[:, 1], costs[edges])
    distance, before, _ = graph.shortest_paths(starts)
    nodes, previous = trace_back(ends[[np.argmin(distance[ends])]], before)
    return edges[graph.edges_between(nodes, previous)]
