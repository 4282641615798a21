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
        origin: (n,) the terminal it was reached from.
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
        self._graph = slots.starts, slots.heads, self.cost[self.slots], np.empty(count, dtype=INDEX)
        self._leaving = slots.leaving
        self._number, self._around = np.full(sides, -1, dtype=np.int64), np.empty(sides, dtype=np.int64)
        self._labelled = NOTHING
        # A slot is put on the heap twice at most: as a seed, and for the vertex it leads to.
        self.heap = np.empty(2 * count + n), np.empty(2 * count + n, dtype=INDEX)
        # What searches fill, a row for each at the same time; all distances are infinite.
        self._rows = self._new_rows(1)

    def label_terminals(self, points: IntArray) -> Terminals:
        """Return the curves of the border, and the points that are not on it; those returned before are void."""
        from .shortest_paths import label_terminals

        enters = self._graph[-1]
        labels = self._number, self._around, len(self._labelled), enters
        starts = label_terminals(self.twin, self._leaving, self.cut, points, self._slot_of, *labels)
        self._labelled = self._around[: starts[-1]]
        self.effort += len(self._labelled) // 4
        return Terminals(len(starts) - 1, self._number, self._labelled, starts)

    def search(
        self,
        terminals: Terminals,
        seeds: IntArray,
        seed_costs: FloatArray,
        *,
        target: int = -1,
        limit: float = np.inf,
        farthest: float = np.inf,
    ) -> Reach:
        """Search along half-edges that leave terminals; see the kernel."""
        reach = Reach(*(array[0] for array in self._rows))
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
            NOTHING,
            NO_COSTS,
        )
        self._run(begin, self.height, (target, limit, farthest), reach)
        self.effort += reach.count
        return reach

    def shortest_tree(
        self, terminals: Terminals, ends: IntArray, arms: FloatArray, limit: float
    ) -> IntArray | None:
        """Return the half-edges of the shortest tree that connects ends; None if it costs no less than the limit."""
        from .reconnect import shortest_tree

        sets = 2 ** (len(ends) - 1) - 1
        if len(self._rows[0]) < sets:
            self._rows = self._new_rows(sets)
        graph = *self._graph, self.slots, self._slot_of, self.tail, self.cut
        places = terminals.number, terminals.around, terminals.starts, ends, arms, limit, self.height
        tree, reached = shortest_tree(*graph, *places, *self._rows, *self.heap)
        self.effort += reached
        return tree if len(tree) else None

    def _new_rows(self, count: int) -> tuple[FloatArray, Int32Array, Int32Array, Int32Array]:
        shape = count, len(self.height)
        before, origin, reached = (np.empty(shape, dtype=INDEX) for _ in range(3))
        return np.full(shape, np.inf), before, origin, reached

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
        """Take back the arrays of a search that is no longer needed, as it must be before the next."""
        reach.distance[reach.vertices] = np.inf
        reach.distance[self.tail[terminals.around]] = np.inf

    def path_over(self, reach: Reach, halfedge: int) -> list[int]:
        """Return the half-edges of a path found, from the one over which it goes last back to the terminal."""
        path, slot = [], int(self._slot_of[halfedge])
        while slot >= 0:
            h = int(self.slots[slot])
            path.append(h)
            v = int(self.tail[h])
            if reach.distance[v] == ON_BORDER:
                break
            slot = int(reach.before[v])
        return path

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
        reach = Reach(self.height, *(array[0] for array in self._rows[1:]))
        self._run(begin, np.zeros(len(self.height)), (-1, np.inf, np.inf), reach)
