"""Shorter seams by local search: take some of them away, and connect again what falls apart.

E. Uchoa and R. Werneck, "Fast local search for the Steiner problem in graphs", 2012, exchange key paths and key
vertices of trees. Here paths that meet are exchanged together for the best tree there is in their place, and on
surfaces with handles, too: taking a path out of a loop leaves two borders, one on each side, to be connected.
"""

from __future__ import annotations

from .._arrays import IntArray
from ..progress import go_on
from .key_paths import Fixed, KeyPaths, find_key_paths, name_edges
from .open_mesh import OpenMesh

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
    rested: set[int] = set()
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
            name = seams.name(gone)
            if name in rested or not changed.isdisjoint(gone):
                continue
            rested.add(name)
            found, tried = _exchange(seams, gone)
            if tried:
                # What is best for several paths is for each of them.
                rested.update(seams.paths[p].name for p in gone)
            if found is not None:
                rested.add(name_edges(found, work.mesh.halfedge_edges))
                changed |= seams.touched_by(gone, found)
        if changed or loose:
            waiting = [*WINDOWS]
        else:
            waiting.pop(0)


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
        found = work.shortest_tree(
            parts.terminals, parts.ends, parts.arms, seams.cost(gone) * (1 - LEAST_GAIN)
        )
    if found is None:
        work.cut_along(seams.halfedges(gone))
    else:
        work.cut_along(found)
        work.lower_heights(found)
    return found, parts is not None
