"""Shorter seams by local search: take some of them away, and connect again what falls apart.

E. Uchoa and R. Werneck, "Fast local search for the Steiner problem in graphs", 2012, exchange key paths and key
vertices of trees. Here paths that meet are exchanged together for the best tree there is in their place, and on
surfaces with handles, too: taking a path out of a loop leaves two borders, one on each side, to be connected.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from .._arrays import FloatArray, IntArray
from ..progress import go_on
from .key_paths import Fixed, KeyPaths, Parts, find_key_paths
from .open_mesh import NO_COSTS, NOTHING, OpenMesh, Reach

# Relative: what is gained must be more than rounding makes.
LEAST_GAIN = 1e-9
# How many paths that follow one another are exchanged together, in the order in which that is tried. Where three fork
# from a point, two take the third along.
WINDOWS = 2, 1, 3


def shorten(work: OpenMesh, fixed: Fixed, enough: int) -> None:
    """Replace seams by shorter ones, in place, until nothing is gained.

    Args:
        work: open, every piece of it a disk.
        fixed: where seams may end.
        enough: the effort after which to stop.
    """
    work.measure_heights()
    rested: set[bytes] = set()
    # Pairs first, as they gain most; again and again, until nothing is gained. Then others.
    waiting = [*WINDOWS]
    while waiting and work.effort < enough:
        seams = find_key_paths(work, fixed)
        loose = seams.loose()
        work.glue(seams.halfedges(loose))
        changed: set[int] = set()
        for gone in () if loose else _exchanges(seams, waiting[0]):
            go_on()
            if work.effort >= enough:
                break
            name = _name(work, seams.halfedges(gone))
            if name in rested or not changed.isdisjoint(gone):
                continue
            rested.add(name)
            found, tried = _exchange(seams, gone)
            if tried:
                # What is best for several paths is for each of them.
                rested.update(_name(work, seams.paths[p].halfedges) for p in gone)
            if found is not None:
                rested.add(_name(work, found))
                changed |= seams.touched_by(gone, found)
        if changed or loose:
            waiting = [*WINDOWS]
        else:
            waiting.pop(0)


def _name(work: OpenMesh, halfedges: IntArray) -> bytes:
    return np.sort(work.mesh.halfedge_edges[halfedges]).tobytes()


def _exchanges(seams: KeyPaths, count: int) -> list[frozenset[int]]:
    """Return sets of so many paths that follow one another along the border, the longest first."""
    windows = [
        {curve[(i + k) % len(curve)] for k in range(count)}
        for curve in seams.curves
        for i in range(len(curve))
    ]
    sets = {seams.with_loose_ends(window) for window in windows if len(window) == count}
    return sorted(sets, key=lambda gone: (-seams.cost(gone), sorted(gone)))


def _exchange(seams: KeyPaths, gone: frozenset[int]) -> tuple[IntArray | None, bool]:
    """Replace paths by a shorter tree. Return its half-edges, None if there is none, and whether one was sought."""
    work = seams.work
    parts = seams.take_away(gone)
    found = None
    if parts is not None:
        found = Reconnection(work, parts, seams.cost(gone) * (1 - LEAST_GAIN)).solve()
    if found is None:
        work.cut_along(seams.halfedges(gone))
    else:
        work.cut_along(found)
        work.lower_heights(found)
    return found, parts is not None


@dataclass(frozen=True, eq=False)
class _Branch:
    """Shortest trees that connect some terminals with a place.

    Attributes:
        splits: the pairs of sets of terminals to which a tree may fall apart at the place.
        reach: where the place is off the border.
        value: (count of terminals,) what a tree costs where the place is a terminal.
        merged: (count of terminals,) the same for trees that fall apart at the terminal.
    """

    splits: list[tuple[int, int]]
    reach: Reach
    value: FloatArray
    merged: FloatArray


class Reconnection:
    """The shortest tree that connects terminals and costs less than a limit.

    S. Dreyfus and R. Wagner, "The Steiner problem in graphs", 1971. A set of terminals is a binary number; the last of
    the terminals is in none: it is what the tree of all others is led to.
    """

    def __init__(self, work: OpenMesh, parts: Parts, limit: float) -> None:
        self.work, self.terminals, self.ends, self.limit = work, parts.terminals, parts.ends, limit
        # No seam is shorter if replaced alone, or nearly so. So these are apart at least as far as their arms are long.
        self.apart = np.maximum(parts.arms[:, None], parts.arms)
        self.branches: dict[int, _Branch] = {}

    def solve(self) -> IntArray | None:
        """Return the half-edges of the tree, None if there is none that costs less."""
        all_others = 2 ** (len(self.ends) - 1) - 1
        for some in range(1, all_others + 1):
            self.branches[some] = self._branch(some, some == all_others)
        found = self.branches[all_others].value[self.ends[-1]] < self.limit
        tree = np.unique(self._to_terminal(all_others, self.ends[-1])) if found else None
        for branch in self.branches.values():
            self.work.forget(self.terminals, branch.reach)
        return tree

    def _branch(self, some: int, is_last: bool) -> _Branch:
        """Return the shortest trees that connect some terminals with every place."""
        splits = [(part, some ^ part) for part in range(1, some) if part & ~some == 0 and part < some ^ part]
        merged = np.full(self.terminals.count, np.inf)
        if not splits:
            merged[self.ends[some.bit_length() - 1]] = 0.0
        inner, costs = [NOTHING], [NO_COSTS]
        for one, two in splits:
            first, second = self.branches[one], self.branches[two]
            merged = np.minimum(merged, first.value + second.value)
            both = first.reach.vertices
            both = both[np.isfinite(second.reach.distance[both])]
            inner.append(both.astype(np.int64))
            costs.append(first.reach.distance[both] + second.reach.distance[both])
        begin = [end for end in self.ends[:-1] if merged[end] < self.limit]
        seeds = [self.terminals.leaving(end) for end in begin]
        target, limit, farthest = -1, *self._bounds(some)
        if is_last:
            target, limit, farthest = self.ends[-1], min(self.limit, merged[self.ends[-1]]), np.inf
        reach = self.work.search(
            self.terminals,
            np.concatenate([NOTHING, *seeds]),
            np.repeat(merged[begin], [len(one) for one in seeds]),
            np.concatenate(inner),
            np.concatenate(costs),
            target=target,
            limit=limit,
            farthest=farthest,
        )
        return _Branch(splits, reach, np.minimum(merged, reach.arrival), merged)

    def _bounds(self, some: int) -> tuple[float, float]:
        """Return limits of the distance and height, and of the distance: what the other terminals leave of the whole.

        A tree costs at least half of a path around it. One around a vertex and the others is made up of paths between
        some of these and two more, neither of which costs less than the height.
        """
        others = [i for i in range(len(self.ends)) if not some >> i & 1]
        between = sorted(self.apart[i, j] for i, j in itertools.combinations(others, 2))
        around = sum(between) / 2 if len(others) == 3 else 0.0
        return (
            self.limit - sum(between[: len(others) - 1]) / 2,
            self.limit - max([around, *between]),
        )

    def _to_terminal(self, some: int, terminal: int) -> list[int]:
        """Return the half-edges of the tree that connects some terminals with another, or one of them."""
        branch = self.branches[some]
        if branch.reach.arrival[terminal] < branch.merged[terminal]:
            return self._along(some, int(branch.reach.last[terminal]))
        return self._at_terminal(some, terminal)

    def _at_terminal(self, some: int, terminal: int) -> list[int]:
        """Return the half-edges of the tree of some terminals that falls apart at a terminal."""
        splits = self.branches[some].splits
        if not splits:
            return []
        costs = [
            self.branches[one].value[terminal] + self.branches[two].value[terminal] for one, two in splits
        ]
        one, two = splits[int(np.argmin(costs))]
        return self._to_terminal(one, terminal) + self._to_terminal(two, terminal)

    def _to_vertex(self, some: int, vertex: int) -> list[int]:
        """Return the half-edges of the tree that connects some terminals with a vertex off the border."""
        branch = self.branches[some]
        slot = int(branch.reach.before[vertex])
        if slot >= 0:
            return self._along(some, slot)
        pairs = [(self.branches[one].reach, self.branches[two].reach) for one, two in branch.splits]
        costs = [one.distance[vertex] + two.distance[vertex] for one, two in pairs]
        first, second = branch.splits[int(np.argmin(costs))]
        return self._to_vertex(first, vertex) + self._to_vertex(second, vertex)

    def _along(self, some: int, slot: int) -> list[int]:
        """Return the half-edges of a path that was found from some terminals, and of the tree at which it begins."""
        path, vertex = self.work.path(self.branches[some].reach, slot)
        if vertex >= 0:
            return path + self._to_vertex(some, vertex)
        return path + self._at_terminal(some, int(self.terminals.number[path[-1]]))
