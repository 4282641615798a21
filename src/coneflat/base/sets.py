"""Graphs: the edges at each node, and sets of connected nodes, by union and find."""

from __future__ import annotations

import numpy as np

from .arrays import BoolArray, IntArray
from .compiled import compiled


def edges_at_nodes(ends: IntArray, nodes: int) -> tuple[IntArray, IntArray]:
    """Return where the edges at each node begin, (n + 1,), and these edges, (2e,), each at both of its ends."""
    flat = ends.reshape(-1)
    starts = np.concatenate([[0], np.cumsum(np.bincount(flat, minlength=nodes))])
    return starts, np.argsort(flat, kind="stable") // 2


@compiled
def grow_forest(ends: IntArray, nodes: int) -> BoolArray:
    """Return (e,) the edges, in their order, that join what those before them did not (J. B. Kruskal 1956)."""
    parent, in_tree = np.arange(nodes), np.zeros(len(ends), np.bool_)
    for e in range(len(ends)):
        in_tree[e] = unite(parent, ends[e, 0], ends[e, 1])
    return in_tree


@compiled
def label_nodes(count: int, tails: IntArray, heads: IntArray) -> tuple[int, IntArray]:
    """Return the number of connected components of a graph and the component of each node, in the order of nodes."""
    parent = np.arange(count)
    for e in range(len(tails)):
        unite(parent, tails[e], heads[e])
    number = 0
    for v in range(count):  # a parent comes before its children
        if parent[v] == v:
            parent[v] = number
            number += 1
        else:
            parent[v] = parent[parent[v]]
    return number, parent


@compiled
def unite(parent: IntArray, one: int, two: int) -> bool:
    """Join the trees of two nodes, and return whether they were two.

    The root of larger index goes under the other; paths to roots are halved.
    """
    while parent[one] != one:
        parent[one] = parent[parent[one]]
        one = parent[one]
    while parent[two] != two:
        parent[two] = parent[parent[two]]
        two = parent[two]
    if one < two:
        parent[two] = one
    else:
        parent[one] = two
    return one != two


@compiled
def find_root(parent: IntArray, node: int) -> int:
    """Return the root of a node's tree."""
    while parent[node] != node:
        node = parent[node]
    return node


@compiled
def number_sets(parent: IntArray) -> int:
    """Write the number of its tree, in the order of nodes, over the parent of each; return how many there are."""
    number = 0
    for v in range(len(parent)):  # a parent comes before its children
        if parent[v] == v:
            parent[v] = number
            number += 1
        else:
            parent[v] = parent[parent[v]]
    return number
