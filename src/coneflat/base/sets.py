"""Graphs: incident edges of nodes, and connected components by union-find."""

from __future__ import annotations

import numpy as np

from .arrays import BoolArray, FloatArray, IntArray
from .jit import compiled


@compiled
def edges_at_nodes(ends: IntArray, nodes: int) -> tuple[IntArray, IntArray]:
    """Return the incident edges of each node in compressed form.

    Args:
        ends: (e, 2) the nodes that each edge connects.
        nodes: number n of nodes.

    Returns:
        (n + 1,) where the edges of each node start, and (2e,) these edges, ascending at each node; each edge is listed
        at both of its ends.
    """
    starts = np.zeros(nodes + 1, np.int64)
    for e in range(len(ends)):
        for x in range(2):
            starts[ends[e, x] + 1] += 1
    for v in range(nodes):
        starts[v + 1] += starts[v]
    place, sides = starts.copy(), np.empty(2 * len(ends), np.int64)
    for e in range(len(ends)):
        for x in range(2):
            v = ends[e, x]
            sides[place[v]] = e
            place[v] += 1
    return starts, sides


@compiled
def largest_at(places: IntArray, values: FloatArray, count: int) -> FloatArray:
    """Return (count,) the largest of the values (k,) that have each place (k,), 0 if none is larger.

    NumPy's `maximum.at` takes ten times as long.
    """
    largest = np.zeros(count)
    for k in range(len(places)):
        largest[places[k]] = max(largest[places[k]], values[k])
    return largest


@compiled
def find_root(parent: IntArray, node: int) -> int:
    """Return the root of the union-find tree of a node; the path to it is halved."""
    while parent[node] != node:
        parent[node] = parent[parent[node]]
        node = parent[node]
    return node


@compiled
def grow_forest(ends: IntArray, nodes: int) -> BoolArray:
    """Return (e,) which edges are in the spanning forest that takes edges greedily in their order (Kruskal 1956)."""
    parent, in_tree = np.empty(nodes, np.int64), np.zeros(len(ends), np.bool_)
    for v in range(nodes):
        parent[v] = v
    for e in range(len(ends)):
        in_tree[e] = unite(parent, ends[e, 0], ends[e, 1])
    return in_tree


@compiled
def label_nodes(count: int, tails: IntArray, heads: IntArray) -> tuple[int, IntArray]:
    """Return the number of connected components and the (count,) component of each node, numbered by first node."""
    parent = np.empty(count, np.int64)
    for v in range(count):
        parent[v] = v
    for e in range(len(tails)):
        unite(parent, tails[e], heads[e])
    return number_trees(parent), parent


@compiled
def number_trees(parent: IntArray) -> int:
    """Replace the parents in a union-find forest by the numbers of the trees, by first node; return their count."""
    number = 0
    for v in range(len(parent)):  # a parent has a smaller index than its children
        if parent[v] == v:
            parent[v] = number
            number += 1
        else:
            parent[v] = parent[parent[v]]
    return number


@compiled
def unite(parent: IntArray, a: int, b: int) -> bool:
    """Join the union-find trees of two nodes; return whether the trees were different.

    The root with the larger index becomes a child of the other.
    """
    a, b = find_root(parent, a), find_root(parent, b)
    parent[max(a, b)] = min(a, b)
    return a != b
