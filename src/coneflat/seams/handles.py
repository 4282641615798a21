"""Loops across the handles of a connected mesh, by which the rotation along each is measured."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray, IntArray
from ..geometry.ties import tie_key
from ..graph import MultiGraph
from ..mesh import TriangleMesh


def handle_loops(mesh: TriangleMesh, holes: bool = False) -> list[IntArray]:
    """Return 2 genus closed strips of triangles that no cut along one of them, or at a boundary, makes shorter.

    Each is given by the half-edges that it crosses, in order: out of the triangle of one, over it, into the triangle
    of its twin, which is that of the next. A tree of shortest ways between triangles and a tree of edges that these
    do not cross leave 2 genus edges (tree-cotree, D. Eppstein 2003); each closes a loop.

    Args:
        mesh: connected.
        holes: have loops around all but one of the boundary's loops, too, so that any closed strip is a sum of
            these and of those around inner vertices.
    """
    if not mesh.genus() and not (holes and mesh.boundary_loops[0] > 1):
        return []
    inside = np.flatnonzero(~mesh.is_boundary_edge)
    across = mesh.edge_halfedges[inside]
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    one, two = across.T // 3
    dual = MultiGraph(len(mesh.faces), one, two, np.linalg.norm(middles[one] - middles[two], axis=1))
    root = int(np.argmax(tie_key(mesh.vertices)[mesh.faces].sum(axis=1)))
    _, before, _ = dual.shortest_paths(np.array([root]))
    reached = np.flatnonzero(before >= 0)
    in_tree = np.zeros(len(inside), dtype=bool)
    in_tree[dual.edges_between(reached, before[reached])] = True

    node_of = _contract_loops(mesh, holes)
    left = np.flatnonzero(~in_tree)
    ends = node_of[mesh.edges[inside[left]]]
    primal = MultiGraph(len(node_of), ends[:, 0], ends[:, 1], np.ones(len(left)))
    closes = np.ones(len(left), dtype=bool)
    closes[primal.minimum_spanning_tree()] = False
    return [_loop(dual, across, before, edge) for edge in left[closes]]


def _contract_loops(mesh: TriangleMesh, together: bool) -> IntArray:
    """Return (n,) a node for each vertex, the same for all of a boundary loop, or of the boundary: its first."""
    count, loop = mesh.boundary_loops
    if together:
        loop = np.minimum(loop, 0)
    node_of = np.arange(len(mesh.vertices))
    on_loop = np.flatnonzero(loop >= 0)
    representative = np.full(count, len(mesh.vertices))
    np.minimum.at(representative, loop[on_loop], on_loop)
    node_of[on_loop] = representative[loop[on_loop]]
    return node_of


def _loop(dual: MultiGraph, across: IntArray, before: IntArray, edge: int) -> IntArray:
    """Return the half-edges that the loop over an edge and back through the tree crosses."""
    start, end = across[edge] // 3
    there, back = _way(start, before), _way(end, before)
    # What both ways to the root share is not walked to and fro.
    while len(there) > 1 and len(back) > 1 and there[-2] == back[-2]:
        there.pop(), back.pop()
    out, home = np.array(there[::-1]), np.array(back)
    edges = dual.edges_between(out[:-1], out[1:]), np.array([edge]), dual.edges_between(home[:-1], home[1:])
    pairs = across[np.concatenate(edges)]
    faces = np.concatenate([out, home[:-1]])
    return np.where(pairs[:, 0] // 3 == faces, pairs[:, 0], pairs[:, 1])


def _way(face: int, before: IntArray) -> list[int]:
    """Return the faces from one to the root of the tree."""
    way = [int(face)]
    while before[way[-1]] >= 0:
        way.append(int(before[way[-1]]))
    return way


def corner_signs(loop: IntArray, twin: IntArray) -> tuple[IntArray, FloatArray]:
    """Return the corners (k,) that a loop turns about, one in each triangle, and +1 where it does so to the left.

    The turning of a loop is the sum of the angles there, with these signs.

    Args:
        loop: (k,) half-edges crossed.
        twin: (3m,) the half-edge on the other side.
    """
    entry, leave = twin[np.roll(loop, 1)] % 3, loop % 3
    return loop - leave + (3 - entry - leave), np.where(entry == (leave + 1) % 3, 1.0, -1.0)
