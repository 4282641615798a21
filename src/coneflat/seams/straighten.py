"""Straighter seams: of ways that are almost equally short, those that turn less."""

from __future__ import annotations

import numpy as np

from .._arrays import IntArray
from .key_paths import Fixed, KeyPaths, Parts, find_key_paths
from .open_mesh import OpenMesh

# What a zigzag that turns back by a right angle at every vertex adds to the length of a seam, so many times: a way
# without turns is preferred if it is longer by no more.
BENDING = 0.05


class Straightener:
    """The search for ways that turn little, with its arrays.

    Args:
        work: open, every piece of it a disk.
        bending: see BENDING.
    """

    def __init__(self, work: OpenMesh, bending: float) -> None:
        self.work, self.bending = work, bending
        sides, widest = len(work.tail), int(np.bincount(work.tail).max())
        self.value = np.full(sides, np.inf)
        self.before, self.reached = np.empty((2, sides), dtype=np.int64)
        self.spokes, self.angles = np.empty(widest + 1, dtype=np.int64), np.empty(widest + 2)

    def straighten(self, fixed: Fixed, enough: int) -> None:
        """Replace seams by straighter ones, each once, in place, up to an effort; the longest first."""
        seams = find_key_paths(self.work, fixed)
        changed: set[int] = set()
        for p in sorted(range(len(seams.paths)), key=lambda p: -seams.paths[p].cost):
            if self.work.effort < enough and p not in changed and len(seams.paths[p].halfedges) > 1:
                found = self._replace(seams, p)
                changed |= seams.touched_by([p], found)

    def _replace(self, seams: KeyPaths, p: int) -> IntArray:
        """Return the half-edges that are now cut in the place of a path."""
        path, gone = seams.paths[p], seams.with_loose_ends([p])
        parts = seams.take_away(gone) if len(gone) == 1 else None
        found = self._way(parts, path.cost * (1 + 2 * self.bending)) if parts is not None else path.halfedges
        found = found if len(found) else path.halfedges
        self.work.cut_along(found)
        return found

    def _way(self, parts: Parts, limit: float) -> IntArray:
        """Return the half-edges of the best way between two circles; none if that is not found within the limit."""
        from .straight_kernel import straightest

        work, circles = self.work, parts.circles
        near, far = parts.ends
        seeds = circles.leaving(near)
        rest = work.search(circles, seeds, np.zeros(len(seeds)), limit=limit)
        seeds = circles.leaving(far)
        last, count = straightest(
            *(
                work.mesh.vertices,
                work.twin,
                work.tail,
                work.cost,
                circles.number,
                seeds[~work.cut[seeds]],
                near,
            ),
            *(rest.distance, self.bending, self.value, self.before, self.reached, self.spokes, self.angles),
            *work.heap,
        )
        work.forget(circles, rest)
        self.value[self.reached[:count]] = np.inf
        way = []
        while last >= 0:
            way.append(last)
            last = int(self.before[last])
        return np.array(way, dtype=np.int64)
