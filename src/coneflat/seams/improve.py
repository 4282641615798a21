"""Shorter seams by local search: take some of them away, and tie together again what falls apart.

E. Uchoa and R. Werneck, "Fast local search for the Steiner problem in graphs", 2012, exchange key paths and key
vertices of trees. Here paths that meet are exchanged together for the best tree there is in their place, and on
surfaces with handles, too: taking a path out of a loop leaves two borders, one on each side, to be tied together.
"""

from __future__ import annotations

import itertools

import numpy as np

from .._arrays import IntArray
from .key_paths import Fixed, KeyPaths, find_key_paths
from .open_mesh import OpenMesh
from .reconnect import Reconnection

# Relative: what is gained must be more than rounding makes.
LEAST_GAIN = 1e-9
# Searches end when they have reached so many times the vertices of the mesh, and so many more.
EFFORT, SPARE_EFFORT = 4, 50_000


def shorten(work: OpenMesh, fixed: Fixed) -> None:
    """Replace seams by shorter ones, in place, until nothing is gained.

    Args:
        work: open, every piece of it a disk.
        fixed: what the seams hold on to.
    """
    work.measure_heights()
    rested: set[bytes] = set()
    enough = EFFORT * len(work.height) + SPARE_EFFORT
    gained = True
    while gained and work.effort < enough:
        seams = find_key_paths(work, fixed)
        loose = seams.loose()
        work.glue(seams.halfedges(loose))
        gained = len(loose) > 0
        changed: set[int] = set()
        for gone in () if loose else _exchanges(seams):
            name = _name(work, seams.halfedges(gone))
            if name in rested or not changed.isdisjoint(gone) or work.effort >= enough:
                continue
            rested.add(name)
            found, tried = _exchange(seams, gone)
            if tried:
                # What is best for several paths is for each of them.
                rested.update(_name(work, seams.paths[p].halfedges) for p in gone)
            if found is not None:
                rested.add(_name(work, found))
                changed |= seams.touched_by(gone, found)
                gained = True


def _name(work: OpenMesh, halfedges: IntArray) -> bytes:
    return np.sort(work.mesh.halfedge_edges[halfedges]).tobytes()


def _exchanges(seams: KeyPaths) -> list[frozenset[int]]:
    """Return sets of paths to exchange: what meets at a point, single ones, what meets at both ends of a path.

    Of each kind the longest come first.
    """
    single = [(p,) for p in range(len(seams.paths))]
    forks = {
        vertex for vertex, paths in seams.at.items() if len(set(paths)) == 3 and not seams.fixed.holds(vertex)
    }
    double = [
        (*seams.at[path.ends[0]], *seams.at[path.ends[1]])
        for path in seams.paths
        if path.ends[0] != path.ends[1] and forks.issuperset(path.ends)
    ]
    sets = {seams.with_loose_ends(set(gone)) for gone in itertools.chain(seams.neighbours, single, double)}
    return sorted(sets, key=lambda gone: (len(gone) > 3, len(gone) == 1, -seams.cost(gone), sorted(gone)))


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
