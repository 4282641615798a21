"""Seams of a connected mesh: a Steiner tree of the cones and boundary loops, and loops around the handles.

Every boundary loop is contracted to one node, which makes the surface closed. A spanning tree T of its
vertices, and a spanning tree of its faces over the edges not in T, leave 2 * genus edges (tree-cotree,
D. Eppstein 2003). T with those edges cuts the surface to a disk; what dangles is not needed. T is grown from
a Steiner tree of the terminals by shortest paths, and the face tree is the one that leaves the edges which
close the shortest loops (J. Erickson and K. Whittlesey 2005).
"""

from __future__ import annotations

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from ..geometry.ties import tie_key
from ..graph import MultiGraph, trace_back
from ..mesh import TriangleMesh
from .steiner import SteinerTree, steiner_tree

# Relative: on grids many paths are equally long, and rounding should not choose among them, lest the result
# depend on the numbering. Far above rounding, far below what anyone would see in a seam.
TIE_BREAK = 1e-7


def find_seams(
    mesh: TriangleMesh,
    cones: IntArray,
    edge_costs: FloatArray,
    is_forbidden: BoolArray | None = None,
) -> IntArray:
    """Return the edges (k,) to cut so that a connected mesh becomes a disk with all cones on its border.

    Args:
        mesh: the mesh.
        cones: (s,) vertices that the seams must reach.
        edge_costs: (e,) positive; the length of each edge, say.
        is_forbidden: (e,) edges to cut only if nothing else serves, such as diagonals of polygons.
    """
    key = tie_key(mesh.vertices)
    edge_costs = edge_costs * (1 + TIE_BREAK * key[mesh.edges].sum(axis=1))
    if is_forbidden is not None and is_forbidden.any():
        edge_costs = np.where(is_forbidden, edge_costs + edge_costs.sum(), edge_costs)
    node_of, node_count, loop_nodes = contract_loops(mesh)
    inside = np.flatnonzero(~mesh.is_boundary_edge)
    ends = node_of[mesh.edges[inside]]
    graph = MultiGraph(node_count, ends[:, 0], ends[:, 1], edge_costs[inside])

    terminals = np.union1d(node_of[cones], loop_nodes)
    tree = steiner_tree(graph, terminals if len(terminals) else _base_point(key))
    handles = _handle_edges(mesh, graph, inside, tree) if mesh.genus() else np.empty(0, dtype=np.int64)
    return inside[_prune(graph, np.union1d(tree.edges, handles), terminals)]


def contract_loops(mesh: TriangleMesh) -> tuple[IntArray, int, IntArray]:
    """Return the node of each vertex (n,), the number of nodes, and the nodes of the boundary loops.

    Nodes are numbered as the vertices are, a loop as its first vertex.
    """
    count, loop = mesh.boundary_loops
    node_of = np.arange(len(mesh.vertices))
    on_loop = np.flatnonzero(loop >= 0)
    representative = np.full(count, len(mesh.vertices))
    np.minimum.at(representative, loop[on_loop], on_loop)
    node_of[on_loop] = representative[loop[on_loop]]
    return node_of, len(mesh.vertices), representative


def _base_point(key: FloatArray) -> IntArray:
    """Return where the loops of a surface without terminals meet: far out."""
    return np.array([np.argmax(key)])


def _handle_edges(mesh: TriangleMesh, graph: MultiGraph, inside: IntArray, tree: SteinerTree) -> IntArray:
    """Return the edges that close loops around the handles, with the paths from there to the tree."""
    distance, predecessor, _ = graph.shortest_paths(tree.nodes)
    nodes = np.flatnonzero(predecessor >= 0)
    in_tree = np.zeros(len(inside), dtype=bool)
    in_tree[tree.edges] = True
    in_tree[graph.edges_between(nodes, predecessor[nodes])] = True

    # The face tree takes the edges that would close the longest loops.
    loop_length = distance[graph.tails] + graph.costs + distance[graph.heads]
    outside = np.flatnonzero(~in_tree)
    faces = mesh.edge_faces[inside[outside]]
    dual = MultiGraph(len(mesh.faces), faces[:, 0], faces[:, 1], -loop_length[outside])
    is_left = np.ones(len(outside), dtype=bool)
    is_left[dual.minimum_spanning_tree()] = False
    closing = outside[is_left]
    ends = np.concatenate([graph.tails[closing], graph.heads[closing]])
    nodes, before = trace_back(ends, predecessor)
    return np.union1d(closing, graph.edges_between(nodes, before))


def _prune(graph: MultiGraph, edges: IntArray, keep: IntArray) -> IntArray:
    """Return the edges without the branches that end at no node of `keep`."""
    is_kept = np.zeros(graph.nodes, dtype=bool)
    is_kept[keep] = True
    while len(edges):
        degree = np.bincount(graph.tails[edges], minlength=graph.nodes)
        degree += np.bincount(graph.heads[edges], minlength=graph.nodes)
        dangling = (degree == 1) & ~is_kept
        stays = ~(dangling[graph.tails[edges]] | dangling[graph.heads[edges]])
        if stays.all():
            break
        edges = edges[stays]
    return edges
