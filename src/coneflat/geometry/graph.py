"""Shortest paths and spanning trees on graphs that may have parallel edges and loops."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra, minimum_spanning_tree

from .._arrays import FloatArray, IntArray
from ..mesh import sort_pairs


@dataclass(frozen=True, eq=False)
class MultiGraph:
    """An undirected graph with positive edge costs.

    Attributes:
        nodes: number of nodes.
        tails, heads: (e,) ends of each edge.
        costs: (e,) positive.
    """

    nodes: int
    tails: IntArray
    heads: IntArray
    costs: FloatArray

    @cached_property
    def _simple(self) -> tuple[IntArray, IntArray]:
        """The cheapest edge of each pair of adjacent nodes, and the sorted keys of the pairs."""
        order, first = sort_pairs(self.tails, self.heads, self.nodes)
        if not first.all():
            group = np.cumsum(first)
            order = order[np.lexsort((self.costs[order], group))]
        chosen = order[first]
        chosen = chosen[self.tails[chosen] != self.heads[chosen]]
        return chosen, self._keys(self.tails[chosen], self.heads[chosen])

    def _keys(self, one: IntArray, two: IntArray) -> IntArray:
        keys: IntArray = np.minimum(one, two).astype(np.int64) * self.nodes + np.maximum(one, two)
        return keys

    def edges_between(self, one: IntArray, two: IntArray) -> IntArray:
        """Return the cheapest edge between each pair of adjacent nodes."""
        chosen, keys = self._simple
        return chosen[np.searchsorted(keys, self._keys(one, two))]

    def shortest_paths(self, sources: IntArray) -> tuple[FloatArray, IntArray, IntArray]:
        """Return each node's distance to the nearest source, its predecessor, and that source.

        The predecessor is -1 at a source; both are -1 at a node that no source reaches.
        """
        chosen, _ = self._simple
        matrix = csr_matrix(
            (self.costs[chosen], (self.tails[chosen], self.heads[chosen])), shape=(self.nodes, self.nodes)
        )
        distance, predecessor, source = dijkstra(
            matrix, directed=False, indices=sources, min_only=True, return_predecessors=True
        )
        none = -1
        return (
            distance,
            np.maximum(predecessor, none).astype(np.int64),
            np.maximum(source, none).astype(np.int64),
        )

    def minimum_spanning_tree(self) -> IntArray:
        """Return the edges of a minimum spanning forest."""
        chosen, _ = self._simple
        # Ranks instead of costs: SciPy takes a zero for no edge.
        rank = np.empty(len(chosen))
        rank[np.lexsort((chosen, self.costs[chosen]))] = np.arange(1, len(chosen) + 1)
        matrix = csr_matrix((rank, (self.tails[chosen], self.heads[chosen])), shape=(self.nodes, self.nodes))
        tree = minimum_spanning_tree(matrix).tocoo()
        return self.edges_between(tree.row.astype(np.int64), tree.col.astype(np.int64))


def trace_back(starts: IntArray, predecessor: IntArray) -> tuple[IntArray, IntArray]:
    """Return the (node, predecessor) steps on the paths from `starts` to their sources, each once."""
    steps: dict[int, int] = {}
    for start in starts.tolist():
        node = start
        while node not in steps and (before := int(predecessor[node])) >= 0:
            steps[node] = before
            node = before
    return np.array(list(steps.keys()), dtype=np.int64), np.array(list(steps.values()), dtype=np.int64)
