"""Shortest paths and spanning trees on graphs that may have parallel edges and loops."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .._arrays import BoolArray, FloatArray, Int32Array, IntArray
from .._sets import unite
from ..compiled import compiled
from ..kept import kept_with
from ..mesh import TriangleMesh


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

    def edges_between(self, one: IntArray, two: IntArray) -> IntArray:
        """Return the cheapest edge between each pair of adjacent nodes, of several the first."""
        edges = np.empty(len(one), dtype=np.int64)
        find_edges(*self._beside, *self._ends, self.costs, one, two, edges)
        return edges

    @cached_property
    def _beside(self) -> tuple[IntArray, IntArray]:
        """Where the edges at each node begin, and these: at `2 e` edge e from its tail, at `2 e + 1` from its head."""
        starts = np.zeros(self.nodes + 1, dtype=np.int64)
        sides = np.empty(2 * len(self.costs), dtype=np.int64)
        list_sides(*self._ends, starts, sides)
        return starts, sides

    @cached_property
    def _ends(self) -> tuple[IntArray, IntArray]:
        """Tails and heads, in one piece each."""
        return np.ascontiguousarray(self.tails), np.ascontiguousarray(self.heads)

    def shortest_paths(
        self, sources: IntArray, targets: IntArray | None = None
    ) -> tuple[FloatArray, IntArray, IntArray]:
        """Return each node's distance to the nearest source, its predecessor, and that source.

        The predecessor is -1 at a source; both are -1 at a node that no source reaches.

        Args:
            sources: nodes.
            targets: nodes of which only the nearest is of interest: the search ends there, and what lies farther away
                is as if it could not be reached, or farther than it is.
        """
        is_target = np.zeros(self.nodes, dtype=bool)
        if targets is not None:
            is_target[targets] = True
        distance = np.full(self.nodes, np.inf)
        before, source = np.full((2, self.nodes), -1)
        find_paths(*self._beside, *self._ends, self.costs, sources, is_target, distance, before, source)
        return distance, before, source

    def widened(self, label: IntArray, weights: FloatArray, least: float) -> IntArray:
        """Return sets of nodes, each with those nearest to it, and nearer to it than to others, up to a weight.

        Args:
            label: (n,) the set of each node, from 0, or -1.
            weights: (n,) of the nodes.
            least: the weight that each set is to have at least, if it can.
        """
        wide = label.copy()
        widen_sets(*self._beside, *self._ends, self.costs, np.flatnonzero(label >= 0), weights, least, wide)
        return wide

    def minimum_spanning_tree(self) -> IntArray:
        """Return the edges of a minimum spanning forest; of equally dear ones the first."""
        in_tree = np.zeros(len(self.costs), dtype=bool)
        grow_forest(np.argsort(self.costs, kind="stable"), *self._ends, self.nodes, in_tree)
        return np.flatnonzero(in_tree)


def edges_beside(mesh: TriangleMesh) -> tuple[IntArray, IntArray]:
    """Return where the edges at each vertex begin, and these, as `list_sides` has them; they are kept with the mesh."""

    def find() -> tuple[IntArray, IntArray]:
        begin = np.zeros(len(mesh.vertices) + 1, dtype=np.int64)
        beside = np.empty(2 * len(mesh.edges), dtype=np.int64)
        tails, heads = np.ascontiguousarray(mesh.edges.T)
        list_sides(tails, heads, begin, beside)
        return begin, beside

    return kept_with(mesh, "edges_beside", find)


def trace_back(starts: IntArray, predecessor: IntArray) -> tuple[IntArray, IntArray]:
    """Return the (node, predecessor) steps on the paths from `starts` to their sources, each once."""
    steps: dict[int, int] = {}
    for start in starts.tolist():
        node = start
        while node not in steps and (before := int(predecessor[node])) >= 0:
            steps[node] = before
            node = before
    return np.array(list(steps.keys()), dtype=np.int64), np.array(list(steps.values()), dtype=np.int64)


@compiled
def grow_forest(order: IntArray, tails: IntArray, heads: IntArray, nodes: int, in_tree: BoolArray) -> None:
    """Mark the edges, taken in an order, that join what those before them had not (J. B. Kruskal 1956).

    in_tree: (e,) False on entry.
    """
    parent = np.arange(nodes)
    for e in order:
        in_tree[e] = unite(parent, tails[e], heads[e])


@compiled
def list_sides(tails: IntArray, heads: IntArray, starts: IntArray, sides: IntArray) -> None:
    """Fill where the sides of edges at each node begin, (n + 1,) zeros on entry, and the sides: 2 e and 2 e + 1."""
    for e in range(len(tails)):
        starts[tails[e]] += 1
        starts[heads[e]] += 1
    total = 0
    for v in range(len(starts)):
        total += starts[v]
        starts[v] = total
    for e in range(len(tails) - 1, -1, -1):
        starts[heads[e]] -= 1
        sides[starts[heads[e]]] = 2 * e + 1
        starts[tails[e]] -= 1
        sides[starts[tails[e]]] = 2 * e


@compiled
def find_edges(
    starts: IntArray,
    sides: IntArray,
    tails: IntArray,
    heads: IntArray,
    costs: FloatArray,
    one: IntArray,
    two: IntArray,
    edges: IntArray,
) -> None:
    """Fill the cheapest edges between pairs of adjacent nodes, of several the first; for sides see `list_sides`."""
    for i in range(len(one)):
        here, there = one[i], two[i]
        if starts[here + 1] - starts[here] > starts[there + 1] - starts[there]:
            here, there = there, here
        least, edges[i] = np.inf, -1
        for at in range(starts[here], starts[here + 1]):
            e = sides[at] // 2
            other = tails[e] if sides[at] % 2 else heads[e]
            if other == there and (edges[i] < 0 or costs[e] < least):
                least, edges[i] = costs[e], e


@compiled
def find_paths(
    starts: IntArray,
    sides: IntArray,
    tails: IntArray,
    heads: IntArray,
    costs: FloatArray,
    sources: IntArray,
    is_target: BoolArray,
    distance: FloatArray,
    before: IntArray,
    source: IntArray,
) -> None:
    """Fill distances (infinite on entry), predecessors and sources (-1 on entry), as far as the nearest target.

    starts, sides: of the edges at each node, see `list_sides`.
    """
    keys, items = np.empty(len(sides) + len(sources)), np.empty(len(sides) + len(sources), np.int64)
    size = 0
    for v in sources:
        if distance[v] > 0.0:
            distance[v], source[v] = 0.0, v
            size = push(keys, items, size, 0.0, v)
    while size > 0:
        key, v = keys[0], items[0]
        if is_target[v]:
            break
        size = drop_first(keys, items, size)
        if key > distance[v]:
            continue
        for i in range(starts[v], starts[v + 1]):
            e = sides[i] // 2
            other = tails[e] if sides[i] % 2 else heads[e]
            if key + costs[e] < distance[other]:
                distance[other], before[other], source[other] = key + costs[e], v, source[v]
                size = push(keys, items, size, distance[other], other)


@compiled
def widen_sets(
    starts: IntArray,
    sides: IntArray,
    tails: IntArray,
    heads: IntArray,
    costs: FloatArray,
    seeds: IntArray,
    weights: FloatArray,
    least: float,
    label: IntArray,
) -> None:
    """Widen sets of nodes; see `MultiGraph.widened`. starts, sides: of the edges at each node, see `list_sides`."""
    keys, items = np.empty(len(sides) + len(seeds)), np.empty(len(sides) + len(seeds), np.int64)
    distance = np.full(len(label), np.inf)
    near = label.copy()
    total = np.zeros(label.max() + 1)
    size, lacking = 0, len(total)
    for v in seeds:
        distance[v] = 0.0
        size = push(keys, items, size, 0.0, v)
        total[label[v]] += weights[v]
    for i in range(len(total)):
        lacking -= total[i] >= least
    while size > 0 and lacking > 0:
        key, v = keys[0], items[0]
        size = drop_first(keys, items, size)
        if key > distance[v]:
            continue
        own = near[v]
        if label[v] < 0 and total[own] < least:
            label[v] = own
            total[own] += weights[v]
            lacking -= total[own] >= least
        for i in range(starts[v], starts[v + 1]):
            e = sides[i] // 2
            other = tails[e] if sides[i] % 2 else heads[e]
            if key + costs[e] < distance[other]:
                distance[other], near[other] = key + costs[e], own
                size = push(keys, items, size, distance[other], other)


@compiled
def push(keys: FloatArray, items: IntArray | Int32Array, size: int, key: float, item: int) -> int:
    """Put an item on a heap, four below each, and return its new size."""
    i = size
    while i > 0:
        parent = (i - 1) >> 2
        if keys[parent] <= key:
            break
        keys[i] = keys[parent]
        items[i] = items[parent]
        i = parent
    keys[i] = key
    items[i] = item
    return size + 1


@compiled
def drop_first(keys: FloatArray, items: IntArray | Int32Array, size: int) -> int:
    """Take the least item off a heap and return its new size."""
    size -= 1
    key, item = keys[size], items[size]
    i = 0
    while True:
        first = 4 * i + 1
        if first >= size:
            break
        child, least = first, keys[first]
        for other in range(first + 1, min(first + 4, size)):
            if keys[other] < least:
                child, least = other, keys[other]
        if least >= key:
            break
        keys[i] = least
        items[i] = items[child]
        i = child
    keys[i] = key
    items[i] = item
    return size
