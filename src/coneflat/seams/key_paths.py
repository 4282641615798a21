"""Seams as a graph: key paths between cones, borders and the points where seams branch."""

from __future__ import annotations

import itertools
import operator
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from functools import reduce

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from ..compiled import compiled
from .open_mesh import NOTHING, OpenMesh, Terminals


@dataclass(frozen=True, eq=False)
class Fixed:
    """Where seams may end.

    Attributes:
        sides: (3m,) half-edges of the border that is there without them: boundaries, and edges that must be cut.
        vertices: (n,) on that border.
        cones: (n,) off that border.
    """

    sides: BoolArray
    vertices: BoolArray
    cones: BoolArray


@dataclass(frozen=True, eq=False)
class KeyPath:
    """A seam that does not branch.

    Attributes:
        halfedges: one side of each of its edges, in order.
        ends: the vertices that it leads from and to.
        sides: the half-edges along it that leave these.
        cost: the sum over its edges.
        name: of its edges, whichever way they are gone along; see `name_edges`.
    """

    halfedges: IntArray
    ends: tuple[int, int]
    sides: tuple[int, int]
    cost: float
    name: int


@dataclass(frozen=True, eq=False)
class Parts:
    """What falls apart when paths are taken away.

    Attributes:
        terminals: of the border that is left.
        ends: those that the paths had connected, the longest last.
        arms: (len(ends),) the cost of the path to each, 0 where several meet.
    """

    terminals: Terminals
    ends: IntArray
    arms: FloatArray


@dataclass(frozen=True, eq=False)
class KeyPaths:
    """All seams, and how they follow one another along the border.

    Attributes:
        work: the mesh that they open.
        cones: the key vertices that are cones off the border that is there without them.
        held: those at which seams may end, cones and others.
        paths: the key paths.
        at: the paths that end at each vertex; loops twice.
        curves: for each border curve the paths along it, in order; most are there twice, with both sides.
    """

    work: OpenMesh
    cones: set[int]
    held: set[int]
    paths: list[KeyPath]
    at: dict[int, list[int]]
    curves: list[list[int]]

    def cost(self, some: Iterable[int]) -> float:
        """Return what some of the paths cost."""
        return sum(self.paths[p].cost for p in some)

    def name(self, some: Iterable[int]) -> int:
        """Return the name of the edges of some of the paths."""
        return reduce(operator.xor, (self.paths[p].name for p in some))

    def halfedges(self, some: Iterable[int]) -> IntArray:
        """Return the half-edges of some of the paths, one for each edge."""
        return np.concatenate([NOTHING, *(self.paths[p].halfedges for p in some)])

    def with_loose_ends(self, gone: Collection[int]) -> frozenset[int]:
        """Return paths to take away, with those that would then end nowhere."""
        removed, waiting = set(gone), list(gone)
        while waiting:
            for vertex in self.paths[waiting.pop()].ends:
                if vertex not in self.held:
                    left = [p for p in self.at[vertex] if p not in removed]
                    if len(left) == 1:
                        removed.add(left[0])
                        waiting.append(left[0])
        return frozenset(removed)

    def loose(self) -> frozenset[int]:
        """Return the paths that end nowhere."""
        ends = [paths[0] for vertex, paths in self.at.items() if len(paths) == 1 and vertex not in self.held]
        return self.with_loose_ends(ends)

    def touched_by(self, gone: Iterable[int], found: IntArray) -> set[int]:
        """Return the paths that are others now that half-edges were found in the place of some of them."""
        work = self.work
        touched = np.zeros(len(work.height), dtype=bool)
        touched[work.tail[found]] = touched[work.mesh.heads[found]] = True
        touched[[vertex for p in gone for vertex in self.paths[p].ends]] = True
        return {
            p
            for p, path in enumerate(self.paths)
            if touched[path.ends[1]] or touched[work.tail[path.halfedges]].any()
        }

    def take_away(self, gone: frozenset[int]) -> Parts | None:
        """Glue paths, and return what is to be connected again; None if that does not open it to disks."""
        work = self.work
        work.glue(self.halfedges(gone))
        ends = {vertex for p in gone for vertex in self.paths[p].ends}
        cones = sorted(ends & self.cones)
        terminals = work.label_terminals(np.array(cones, dtype=np.int64))
        arms: dict[int, float] = {}
        inner = set()
        for p in gone:
            path = self.paths[p]
            for h, vertex in zip(path.sides, path.ends, strict=True):
                terminal = int(terminals.number[h])
                if terminal < 0:
                    inner.add(vertex)
                else:
                    arms[terminal] = 0.0 if terminal in arms else path.cost
        # Euler's formula: what is not a disk now has a handle if there are fewer terminals; to connect these does not
        # open it.
        if len(arms) < 2 or len(arms) != 1 + len(gone) - len(inner):
            return None
        order = sorted(arms, key=lambda terminal: (len(terminals.leaving(terminal)), terminal))
        return Parts(terminals, np.array(order), np.array([arms[terminal] for terminal in order]))


def find_key_paths(work: OpenMesh, fixed: Fixed) -> KeyPaths:
    """Return the seams of an open mesh as a graph."""
    terminals = work.label_terminals(NOTHING)
    halfedges, starts, costs, names, numbers, curves = list_key_paths(
        *(terminals.around, terminals.starts, work.cut, work.twin, work.tail, work.cost),
        *(work.mesh.halfedge_edges, fixed.sides, fixed.cones, fixed.vertices),
    )
    sides = halfedges[starts[:-1]], work.twin[halfedges[starts[1:] - 1]]
    ends = list(zip(*(work.tail[side].tolist() for side in sides), strict=True))
    of_paths = ends, zip(*(side.tolist() for side in sides), strict=True), costs.tolist(), names.tolist()
    bounds = itertools.pairwise(starts.tolist())
    paths = [
        KeyPath(halfedges[start:stop], *rest) for (start, stop), *rest in zip(bounds, *of_paths, strict=True)
    ]
    at: dict[int, list[int]] = {}
    for number, both in enumerate(ends):
        for vertex in both:
            at.setdefault(vertex, []).append(number)
    along, cuts = numbers.tolist(), curves.tolist()
    around = [along[start:stop] for start, stop in itertools.pairwise(cuts)]
    keys = np.fromiter(at, dtype=np.int64, count=len(at))
    cones = set(keys[fixed.cones[keys]].tolist())
    return KeyPaths(work, cones, cones.union(keys[fixed.vertices[keys]].tolist()), paths, at, around)


@compiled
def list_key_paths(
    around: IntArray,
    bounds: IntArray,
    cut: BoolArray,
    twin: IntArray,
    tail: IntArray,
    cost: FloatArray,
    edge_of: IntArray,
    is_fixed: BoolArray,
    is_cone: BoolArray,
    on_fixed: BoolArray,
) -> tuple[IntArray, IntArray, FloatArray, IntArray, IntArray, IntArray]:
    """Return the paths between key vertices along border curves, each once, and how they follow one another.

    Args:
        around, bounds: the half-edges that leave border curves, in order, and where those of each curve begin.
        cut, twin, tail, cost, edge_of: (3m,) of the half-edges.
        is_fixed: (3m,) half-edges of the border that are no seams.
        is_cone, on_fixed: (n,) cones, and vertices of that border.

    Returns:
        The half-edges of the paths, where those of each begin, what each costs and is called, the paths along the
        curves, and where those of each curve begin.
    """
    degree = np.zeros(len(is_cone), np.int64)
    sides, starts = np.empty(len(around), np.int64), np.zeros(len(bounds), np.int64)
    size = 0
    for c in range(len(bounds) - 1):
        for h in around[bounds[c] : bounds[c + 1]]:
            if cut[h]:
                sides[size] = h
                degree[tail[h]] += not is_fixed[h]
                size += 1
        starts[c + 1] = size
    halfedges, path_starts, costs = np.empty(size, np.int64), np.zeros(size + 1, np.int64), np.zeros(size)
    numbers, curves = np.empty(size, np.int64), np.zeros(len(bounds), np.int64)
    # The path that begins on the way back with each half-edge.
    by_first = {np.int64(-1): np.int64(-1)}
    paths = listed = filled = 0
    for c in range(len(bounds) - 1):
        curve = sides[starts[c] : starts[c + 1]]
        keys = np.empty(len(curve) + 1, np.int64)
        found = 0
        for i in range(len(curve)):
            v = tail[curve[i]]
            if degree[v] != 2 or is_cone[v] or on_fixed[v]:
                keys[found] = i
                found += 1
        keys[found] = keys[0] + len(curve)
        for k in range(found):
            first, last = curve[keys[k]], curve[(keys[k + 1] - 1) % len(curve)]
            if is_fixed[first]:
                continue
            if first in by_first:
                numbers[listed] = by_first[first]
            else:
                numbers[listed] = paths
                by_first[twin[last]] = np.int64(paths)
                for i in range(keys[k], keys[k + 1]):
                    h = curve[i % len(curve)]
                    halfedges[filled] = h
                    costs[paths] += cost[h]
                    filled += 1
                paths += 1
                path_starts[paths] = filled
            listed += 1
        curves[c + 1] = listed
    names = np.empty(paths, np.int64)
    for p in range(paths):
        names[p] = name_edges(halfedges[path_starts[p] : path_starts[p + 1]], edge_of)
    return halfedges[:filled], path_starts[: paths + 1], costs[:paths], names, numbers[:listed], curves


@compiled
def name_edges(halfedges: IntArray, edge_of: IntArray) -> int:
    """Return a number by which the edges of half-edges are known again; that of two sets is the exclusive or of theirs.

    Numbers are mixed as by SplitMix64 (G. Steele, D. Lea, C. Flood, "Fast splittable pseudorandom number generators",
    2014), so that among millions of sets two have the same one with a probability below 1e-6.
    """
    name = np.uint64(0)
    for h in halfedges:
        mixed = np.uint64(edge_of[h] + 1) * np.uint64(0x9E3779B97F4A7C15)
        mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        name ^= mixed ^ (mixed >> np.uint64(31))
    return np.int64(name)
