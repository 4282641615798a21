"""Seams as a graph: key paths between cones, borders and the points where seams branch."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable
from dataclasses import dataclass

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
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

    def holds(self, vertex: int) -> bool:
        """Return whether a seam may end at a vertex."""
        return bool(self.vertices[vertex] or self.cones[vertex])


@dataclass(frozen=True, eq=False)
class KeyPath:
    """A seam that does not branch.

    Attributes:
        halfedges: one side of each of its edges, in order.
        ends: the vertices that it leads from and to.
        cost: the sum over its edges.
    """

    halfedges: IntArray
    ends: tuple[int, int]
    cost: float


@dataclass(frozen=True, eq=False)
class Parts:
    """What falls apart when paths are taken away.

    Attributes:
        terminals: of the border that is left.
        ends: those that the paths had connected, the longest last.
        arms: (len(ends),) the cost of the path to each, 0 where several meet.
    """

    terminals: Terminals
    ends: list[int]
    arms: FloatArray


@dataclass(frozen=True, eq=False)
class KeyPaths:
    """All seams, and how they follow one another along the border.

    Attributes:
        work: the mesh that they open.
        fixed: where they may end.
        paths: the key paths.
        at: the paths that end at each vertex; loops twice.
        curves: for each border curve the paths along it, in order; most are there twice, with both sides.
    """

    work: OpenMesh
    fixed: Fixed
    paths: list[KeyPath]
    at: dict[int, list[int]]
    curves: list[list[int]]

    def cost(self, some: Iterable[int]) -> float:
        """Return what some of the paths cost."""
        return sum(self.paths[p].cost for p in some)

    def halfedges(self, some: Iterable[int]) -> IntArray:
        """Return the half-edges of some of the paths, one for each edge."""
        return np.concatenate([NOTHING, *(self.paths[p].halfedges for p in some)])

    def with_loose_ends(self, gone: Collection[int]) -> frozenset[int]:
        """Return paths to take away, with those that would then end nowhere."""
        removed, waiting = set(gone), list(gone)
        while waiting:
            for vertex in self.paths[waiting.pop()].ends:
                if not self.fixed.holds(vertex):
                    left = [p for p in self.at[vertex] if p not in removed]
                    if len(left) == 1:
                        removed.add(left[0])
                        waiting.append(left[0])
        return frozenset(removed)

    def loose(self) -> frozenset[int]:
        """Return the paths that end nowhere."""
        ends = [
            paths[0] for vertex, paths in self.at.items() if len(paths) == 1 and not self.fixed.holds(vertex)
        ]
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
        cones = sorted(vertex for vertex in ends if self.fixed.cones[vertex])
        terminals = work.label_terminals(np.array(cones, dtype=np.int64))
        arms: dict[int, float] = {}
        inner = set()
        for p in gone:
            path = self.paths[p]
            for h, vertex in zip((path.halfedges[0], work.twin[path.halfedges[-1]]), path.ends, strict=True):
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
        return Parts(terminals, order, np.array([arms[terminal] for terminal in order]))


def find_key_paths(work: OpenMesh, fixed: Fixed) -> KeyPaths:
    """Return the seams of an open mesh as a graph."""
    terminals = work.label_terminals(NOTHING)
    on_border = work.cut[terminals.around]
    sides = terminals.around[on_border]
    bounds = np.concatenate([[0], np.cumsum(on_border)])[terminals.starts].tolist()
    tails = work.tail[sides]
    degree = np.bincount(tails[~fixed.sides[sides]], minlength=len(work.height))
    is_key = (degree[tails] != 2) | fixed.cones[tails] | fixed.vertices[tails]
    paths: list[KeyPath] = []
    at: dict[int, list[int]] = {}
    curves: list[list[int]] = []
    by_first: dict[int, int] = {}
    for start, stop in itertools.pairwise(bounds):
        keys = np.flatnonzero(is_key[start:stop])
        curve = np.roll(sides[start:stop], -keys[0])
        around = []
        for i, j in itertools.pairwise([*(keys - keys[0]).tolist(), stop - start]):
            first, back = int(curve[i]), int(work.twin[curve[j - 1]])
            if fixed.sides[first]:
                continue
            number = by_first.get(first, len(paths))
            around.append(number)
            if number == len(paths):
                by_first[back] = number
                path = KeyPath(
                    curve[i:j],
                    (int(work.tail[first]), int(work.tail[back])),
                    float(work.cost[curve[i:j]].sum()),
                )
                paths.append(path)
                for vertex in path.ends:
                    at.setdefault(vertex, []).append(number)
        curves.append(around)
    return KeyPaths(work, fixed, paths, at, curves)
