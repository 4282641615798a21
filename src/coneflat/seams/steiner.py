"""Short trees that connect given nodes of a graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import FloatArray, IntArray
from ..graph import MultiGraph, trace_back


@dataclass(frozen=True, eq=False)
class SteinerTree:
    """A tree through terminals.

    Attributes:
        edges: (k,) its edges in the graph.
        nodes: (k + 1,) its nodes.
    """

    edges: IntArray
    nodes: IntArray


def steiner_tree(graph: MultiGraph, terminals: IntArray) -> SteinerTree:
    """Return a tree that connects the terminals, at most twice as long as the shortest.

    K. Mehlhorn, "A faster approximation algorithm for the Steiner problem in graphs", 1988: one search from
    all terminals at once, then a minimum spanning tree over the cheapest bridges between their regions.
    """
    if len(terminals) < 2:
        return SteinerTree(np.empty(0, dtype=np.int64), np.asarray(terminals, dtype=np.int64))
    distance, predecessor, source = graph.shortest_paths(terminals)
    bridge_edges = _bridges(graph, terminals, distance, source)
    ends = np.concatenate([graph.tails[bridge_edges], graph.heads[bridge_edges]])
    nodes, before = trace_back(ends, predecessor)
    edges = np.union1d(bridge_edges, graph.edges_between(nodes, before))
    return SteinerTree(edges, np.unique(np.concatenate([graph.tails[edges], graph.heads[edges]])))


def _bridges(graph: MultiGraph, terminals: IntArray, distance: FloatArray, source: IntArray) -> IntArray:
    """Return the graph edges that join the terminals' regions to one tree, cheapest paths first."""
    region = np.full(graph.nodes, -1, dtype=np.int64)
    region[terminals] = np.arange(len(terminals))
    region = region[source]
    one, two = region[graph.tails], region[graph.heads]
    between = np.flatnonzero(one != two)
    length = distance[graph.tails[between]] + graph.costs[between] + distance[graph.heads[between]]
    regions = MultiGraph(len(terminals), one[between], two[between], length)
    return between[regions.minimum_spanning_tree()]
