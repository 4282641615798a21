"""A mesh that is being cut open: its border, and the cheapest paths between parts of it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .._arrays import BoolArray, FloatArray, Int32Array, IntArray
from ..geometry.intrinsic import halfedge_twins
from ..kept import kept_with
from ..mesh import TriangleMesh

NOTHING = np.empty(0, dtype=np.int64)
NO_COSTS = np.empty(0)
# What searches go through without end is kept in half of the memory, which is what they wait for.
INDEX = np.int32
# What a search takes for the distance of vertices on the border.
ON_BORDER = -1.0


@dataclass(frozen=True, eq=False)
class Terminals:
    """What seams are to connect, as in the Steiner tree problem: border curves of an open mesh, and single points.

    Attributes:
        count: how many there are.
        number: (3m,) the terminal that each half-edge leaves, -1 off the border.
        around: the half-edges that leave a terminal, one terminal after the other, in order.
        starts: (count + 1,) where each begins in `around`.
    """

    count: int
    number: IntArray
    around: IntArray
    starts: IntArray

    def leaving(self, terminal: int) -> IntArray:
        """Return the half-edges that leave a terminal, those of the border among them."""
        return self.around[self.starts[terminal] : self.starts[terminal + 1]]


@dataclass(eq=False)
class Reach:
    """What a search found; its arrays are used again.

    Attributes:
        distance: (n,) what the path to each vertex costs, infinite where the search did not get, -1 on the border.
        before: (n,) the slot by which each was reached, -1 where the search began.
        origin: (n,) the terminal it was reached from, -1 if from a vertex off the border.
        reached: (n,) the vertices reached come first.
        count: how many were.
        arrival: (count of terminals,) what the path to each terminal costs.
        last: (count of terminals,) the last slot of that path, -1 if there is none.
    """

    distance: FloatArray
    before: Int32Array
    origin: Int32Array
    reached: Int32Array
    count: int = 0
    arrival: FloatArray = field(default_factory=lambda: NO_COSTS)
    last: IntArray = field(default_factory=lambda: NOTHING)

    @property
    def vertices(self) -> Int32Array:
        """The vertices reached off the border."""
        return self.reached[: self.count]


@dataclass(frozen=True, eq=False)
class Slots:
    """The half-edges of a mesh that have a twin, sorted by the vertex that they leave.

    Attributes:
        twin: (3m,) the half-edge on the other side, -1 on the boundary.
        starts: (n + 1,) where the slots of each vertex begin.
        halfedges, heads: the half-edge of each slot, and the vertex that it leads to.
        of_halfedges: (3m,) the slot of each half-edge that has one.
        leaving: (n,) a half-edge that leaves each vertex.
    """

    twin: IntArray
    starts: IntArray
    halfedges: IntArray
    heads: Int32Array
    of_halfedges: IntArray
    leaving: IntArray

    @classmethod
    def of(cls, mesh: TriangleMesh) -> Slots:
        """Return the slots of a mesh, which are not sorted again."""
        return kept_with(mesh, "_slots", lambda: cls._sorted(mesh))

    @classmethod
    def _sorted(cls, mesh: TriangleMesh) -> Slots:
        from .shortest_paths import sort_slots

        n, sides = len(mesh.vertices), 3 * len(mesh.faces)
        twin, tail = halfedge_twins(mesh), mesh.tails
        starts, count = np.zeros(n + 1, dtype=np.int64), int(np.count_nonzero(twin >= 0))
        slots, slot_of = np.empty(count, dtype=np.int64), np.empty(sides, dtype=np.int64)
        sort_slots(twin, tail, starts, slots, slot_of)
        leaving = np.empty(n, dtype=np.int64)
        leaving[tail] = np.arange(sides)
        return cls(twin, starts, slots, mesh.heads[slots].astype(INDEX), slot_of, leaving)


class OpenMesh:
    """A mesh and what has been cut of it so far.

    Attributes:
        mesh: the mesh.
        twin: (3m,) the half-edge on the other side, also of those that are cut; -1 on the boundary of the mesh.
        tail: (3m,) the vertex that each half-edge leaves.
        cost: (3m,) what each half-edge costs as part of a seam.
        cut: (3m,) True for half-edges of the border.
        height: (n,) lower bounds of what the path from each vertex to the border costs.
        slots: the half-edge of each slot.
        effort: what has been done so far, in vertices reached by searches; four half-edges of a border count as one.
    """

    def __init__(self, mesh: TriangleMesh, edge_costs: FloatArray, is_border: BoolArray) -> None:
        n, sides, slots = len(mesh.vertices), 3 * len(mesh.faces), Slots.of(mesh)
        self.mesh, self.twin, self.tail = mesh, slots.twin, mesh.tails
        self.cost, self.cut = edge_costs[mesh.halfedge_edges], is_border[mesh.halfedge_edges]
        self.height = np.zeros(n)
        self.effort = 0
        self.slots, self._slot_of, count = slots.halfedges, slots.of_halfedges, len(slots.halfedges)
        self._enters = np.empty(count, dtype=INDEX)
        self._graph = slots.starts, slots.heads, self.cost[self.slots], self._enters
        self._leaving = slots.leaving
        self._number, self._around = np.full(sides, -1, dtype=np.int64), np.empty(sides, dtype=np.int64)
        self._labelled = NOTHING
        # A slot is put on the heap twice at most: as a seed, and for the vertex it leads to.
        self.heap = np.empty(2 * count + n), np.empty(2 * count + n, dtype=INDEX)
        self._spare: list[Reach] = []

    def label_terminals(self, points: IntArray) -> Terminals:
        """Return the curves of the border, and the points that are not on it; those returned before are void."""
        from .shortest_paths import label_terminals

        self._number[self._labelled] = -1
        sides = np.flatnonzero(self.cut)
        starts = np.empty(len(sides) + len(points) + 1, dtype=np.int64)
        labels = self._number, self._around, starts
        count = label_terminals(self.twin, self._leaving, self.cut, sides, points, *labels)
        self._labelled = self._around[: starts[count]]
        self.effort += len(self._labelled) // 4
        across = self.twin[self._labelled]
        glued = across >= 0
        self._enters[self._slot_of[across[glued]]] = self._number[self._labelled[glued]]
        return Terminals(count, self._number, self._labelled, starts[: count + 1])

    def search(
        self,
        terminals: Terminals,
        seeds: IntArray,
        seed_costs: FloatArray,
        inner: IntArray = NOTHING,
        inner_costs: FloatArray = NO_COSTS,
        *,
        target: int = -1,
        limit: float = np.inf,
        farthest: float = np.inf,
    ) -> Reach:
        """Search along half-edges that leave terminals, and from vertices off the border; see the kernel."""
        reach = self._spare.pop() if self._spare else self._new_reach()
        reach.arrival, reach.last = (
            np.full(terminals.count, np.inf),
            np.full(terminals.count, -1, dtype=np.int64),
        )
        reach.distance[self.tail[terminals.around]] = ON_BORDER
        free = ~self.cut[seeds]
        begin = (
            self._slot_of[seeds[free]],
            seed_costs[free],
            terminals.number[seeds[free]],
            inner,
            inner_costs,
        )
        self._run(begin, self.height, (target, limit, farthest), reach)
        self.effort += reach.count
        return reach

    def _new_reach(self) -> Reach:
        n = len(self.height)
        return Reach(np.full(n, np.inf), *np.empty((3, n), dtype=INDEX))

    def _run(
        self,
        begin: tuple[IntArray, FloatArray, IntArray, IntArray, FloatArray],
        height: FloatArray,
        ends: tuple[int, float, float],
        reach: Reach,
    ) -> None:
        from .shortest_paths import search

        starts, heads, costs, enters = self._graph
        seeds, seed_costs, origins, inner, inner_costs = begin
        target, limit, farthest = ends
        keys, items = self.heap
        reach.count = search(
            starts,
            heads,
            costs,
            enters,
            seeds,
            seed_costs,
            origins,
            inner,
            inner_costs,
            height,
            target,
            limit,
            farthest,
            reach.distance,
            reach.before,
            reach.origin,
            reach.reached,
            reach.arrival,
            reach.last,
            keys,
            items,
        )

    def forget(self, terminals: Terminals, reach: Reach) -> None:
        """Take back the arrays of a search that is no longer needed."""
        reach.distance[reach.vertices] = np.inf
        reach.distance[self.tail[terminals.around]] = np.inf
        self._spare.append(reach)

    def path_over(self, reach: Reach, halfedge: int) -> list[int]:
        """Return the half-edges of a path found, from the one over which it goes last back to the terminal."""
        return self.path(reach, int(self._slot_of[halfedge]))[0]

    def path(self, reach: Reach, slot: int) -> tuple[list[int], int]:
        """Return the half-edges of a path found, from its last slot back, and the vertex it begins at.

        The vertex is -1 if the path begins at a terminal.
        """
        path, v = [], -1
        while slot >= 0:
            h = int(self.slots[slot])
            path.append(h)
            v = int(self.tail[h])
            if reach.distance[v] == ON_BORDER:
                return path, -1
            slot = int(reach.before[v])
        return path, v

    def cut_along(self, halfedges: IntArray) -> None:
        """Cut edges, given by either half."""
        self.cut[halfedges] = self.cut[self.twin[halfedges]] = True

    def glue(self, halfedges: IntArray) -> None:
        """Undo the cut of edges, given by either half."""
        self.cut[halfedges] = self.cut[self.twin[halfedges]] = False

    def measure_heights(self) -> None:
        """Set the heights to the distance from the border."""
        self.height = np.full(len(self.height), np.inf)
        self.lower_heights(np.flatnonzero(self.cut))

    def lower_heights(self, halfedges: IntArray) -> None:
        """Lower the heights to the distance from half-edges that became part of the border."""
        ends = np.unique([self.tail[halfedges], self.mesh.heads[halfedges]])
        begin = NOTHING, NO_COSTS, NOTHING, ends, np.zeros(len(ends))
        fresh = self._new_reach()
        reach = Reach(self.height, fresh.before, fresh.origin, fresh.reached)
        self._run(begin, np.zeros(len(self.height)), (-1, np.inf, np.inf), reach)
