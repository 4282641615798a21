"""Shortest paths and spanning trees of graphs that may have parallel edges and loops."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.jit import compiled
from ..base.sets import edges_at_nodes, grow_forest
from .heap import drop_first, push


@dataclass(frozen=True, eq=False)
class Paths:
    """The shortest path to each node from its nearest source.

    Attributes:
        distance: (n,) length of the path; infinite at nodes that are not reached.
        before, edge: (n,) the predecessor of each node on its path, and the edge from there; -1 at sources and at
            nodes that are not reached.
        source: (n,) the source of the path, -1 at nodes that are not reached.
    """

    distance: FloatArray
    before: IntArray
    edge: IntArray
    source: IntArray

    def nodes_to(self, ends: IntArray) -> IntArray:
        """Return the nodes on the paths to given nodes, each once, without the sources."""
        on_paths: dict[int, None] = {}
        for node in ends.tolist():
            while node not in on_paths and self.before[node] >= 0:
                on_paths[node] = None
                node = int(self.before[node])
        return np.array(list(on_paths), dtype=np.int64)


class Regions(NamedTuple):
    """How far two regions grow around the sources of shortest paths.

    Attributes:
        is_second: (n,) True for the sources of the second region.
        weights: (n,) weight of each node.
        total: weight of each region up to which it grows.
    """

    is_second: BoolArray
    weights: FloatArray
    total: float


@dataclass(frozen=True, eq=False)
class MultiGraph:
    """An undirected graph with edge costs; parallel edges and loops are allowed.

    Attributes:
        nodes: number of nodes.
        ends: (e, 2) the nodes that each edge connects.
        costs: (e,) edge costs, not negative.
        incident_edges: the incident edges of each node if they are known, as `edges_at_nodes` returns them.
    """

    nodes: int
    ends: IntArray
    costs: FloatArray
    incident_edges: tuple[IntArray, IntArray] | None = None

    @cached_property
    def _incident(self) -> tuple[IntArray, IntArray]:
        return edges_at_nodes(self.ends, self.nodes) if self.incident_edges is None else self.incident_edges

    def shortest_paths(
        self, sources: IntArray, targets: IntArray | None = None, regions: Regions | None = None
    ) -> Paths:
        """Return the shortest paths from the sources; edges of infinite cost are not used.

        Args:
            sources: (s,) nodes.
            targets: (t,) nodes. The search ends at the nearest of them. Nodes that are farther away are not reached,
                or have a distance that is too large. None: all nodes are reached.
            regions: the search ends where both regions, of the nodes nearest to their sources, have more than the
                total weight, after all nodes of the same distance. None: it does not end.
        """
        is_target = np.zeros(self.nodes, dtype=bool)
        if targets is not None:
            is_target[targets] = True
        distance = np.full(self.nodes, np.inf)
        before, edge, source = np.full((3, self.nodes), -1)
        limits = Regions(is_target, np.empty(0), np.inf) if regions is None else regions
        find_paths(
            *self._incident,
            self.ends,
            self.costs,
            sources,
            is_target,
            limits.is_second,
            limits.weights,
            limits.total,
            distance,
            before,
            edge,
            source,
        )
        return Paths(distance, before, edge, source)

    def minimum_spanning_tree(self) -> IntArray:
        """Return the edges of a minimum spanning forest, ascending; among edges of equal cost, the first is taken."""
        order = np.argsort(self.costs, kind="stable")
        return np.sort(order[grow_forest(self.ends[order], self.nodes)])


@compiled
def find_paths(
    starts: IntArray,
    sides: IntArray,
    ends: IntArray,
    costs: FloatArray,
    sources: IntArray,
    is_target: BoolArray,
    is_second: BoolArray,
    weights: FloatArray,
    total: float,
    distance: FloatArray,
    before: IntArray,
    edge: IntArray,
    source: IntArray,
) -> None:
    """Write the shortest paths up to the nearest target, by Dijkstra's algorithm.

    E. W. Dijkstra, "A note on two problems in connexion with graphs", 1959.

    Args:
        starts, sides: incident edges of the nodes, see `edges_at_nodes`.
        ends, costs: (e, 2) the nodes and (e,) the cost of each edge.
        sources: (s,) nodes.
        is_target: (n,) whether a node is a target.
        is_second, weights, total: see `Regions`; no weights if the search is not limited.
        distance: (n,) infinite on entry; see `Paths`.
        before, edge, source: (n,) -1 on entry; see `Paths`.
    """
    keys, items = np.empty(len(sides) + len(sources)), np.empty(len(sides) + len(sources), np.int64)
    size, first_weight, second_weight, farthest = 0, 0.0, 0.0, np.inf
    for v in sources:
        if distance[v] > 0.0:
            distance[v], source[v] = 0.0, v
            size = push(keys, items, size, 0.0, v)
    while size > 0:
        key, v = keys[0], items[0]
        if is_target[v] or key > farthest:
            break
        size = drop_first(keys, items, size)
        if key > distance[v]:
            continue
        if len(weights) > 0:
            if is_second[source[v]]:
                second_weight += weights[v]
            else:
                first_weight += weights[v]
            if farthest == np.inf and min(first_weight, second_weight) > total:
                farthest = key
        for i in range(starts[v], starts[v + 1]):
            e = sides[i]
            neighbour = ends[e, 0] + ends[e, 1] - v
            if key + costs[e] < distance[neighbour]:
                distance[neighbour], before[neighbour], edge[neighbour] = key + costs[e], v, e
                source[neighbour] = source[v]
                size = push(keys, items, size, distance[neighbour], neighbour)
