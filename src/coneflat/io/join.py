"""Closing a mesh along sides that its file has twice.

Programs write a vertex once for each of its normals, materials or UVs, so that a surface that is closed for the eye
falls apart in the file. Where the two borders of such a gap coincide bit for bit, and run opposite ways, they are
taken for one. Numbers of vertices stay as they are: of those that become one, the first is used.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..base.arrays import BoolArray, IntArray
from ..base.text import plural
from ..errors import OptionError
from ..geometry.triangulate import triangulate
from ..mesh.check import is_left_out, left_out
from ..mesh.check import weld as number_places
from ..mesh.connectivity import label_components, sort_pairs
from .mesh_file import MeshFile


@dataclass(frozen=True, eq=False)
class Joined:
    """A mesh as it was read, closed where the file has both sides of an edge.

    Attributes:
        mesh: the mesh, with as many vertices as the file.
        used: (n,) the vertex that is used for each vertex of the file.
        edges: how many edges were closed.
        left: how many open edges coincide with others and stay open.
    """

    mesh: MeshFile
    used: IntArray
    edges: int = 0
    left: int = 0

    @property
    def merged(self) -> int:
        """How many vertices another one is used for."""
        return int(np.count_nonzero(self.used != np.arange(len(self.used))))

    def notes(self) -> tuple[str, ...]:
        """Return what was merged on reading, one sentence each."""
        notes = []
        if self.edges:
            notes.append(
                f"Closed {plural(self.edges, 'edge')} that the file has twice, at the same places "
                f"({plural(self.merged, 'vertex', 'vertices')} merged); --no-weld leaves them open."
            )
        elif self.mesh.welded:
            notes.append(f"Merged {self.mesh.welded:,} vertices at the same positions.")
        if self.left:
            notes.append(
                f"{plural(self.left, 'open edge')} at the same places as others, left open; --weld merges all vertices "
                "at the same positions."
            )
        return tuple(notes)

    def notes_of(self, notes: Sequence[str]) -> tuple[str, ...]:
        """Return these notes and those on a result; vertices that another is used for are not left out."""
        kept = [note for note in notes if not (self.merged and is_left_out(note))]
        lone = len(self.used) - len(np.unique(self.mesh.corners)) - self.merged if self.merged else 0
        return (*self.notes(), *kept, *[left_out(lone)] * (lone > 0))

    def renamed(self, options: Mapping[str, Any]) -> dict[str, Any]:
        """Return arguments of `coneflat.flatten` with the vertices that are used for those that they name.

        Raises:
            OptionError: two of them name one vertex.
        """
        if not self.merged:
            return dict(options)
        found = dict(options)
        for name in ("cones", "boundary"):
            given = found.get(name)
            if isinstance(given, Mapping):
                seen: dict[int, int] = {}
                for vertex in given:
                    other = seen.setdefault(self._used(vertex), vertex)
                    if other != vertex:
                        raise OptionError(
                            f"vertices {other} and {vertex} lie at the same place and have become one: name one of "
                            "them, or add --no-weld"
                        )
                found[name] = dict(zip(seen, given.values(), strict=True))
        for name in ("required_cones", "forbidden_cones"):
            if found.get(name) is not None:
                found[name] = tuple(dict.fromkeys(self._used(v) for v in found[name]))
        if isinstance(found.get("weights"), Mapping):
            found["weights"] = {self._used(v): weight for v, weight in found["weights"].items()}
        for name in ("seams", "no_seams"):
            given = found.get(name)
            if isinstance(given, tuple) and len(given) == 2 and isinstance(given[0], str):
                found[name] = (given[0], self._used_pairs(np.asarray(given[1])))
            elif isinstance(given, np.ndarray):
                found[name] = self._used_pairs(given)
        return found

    def _used_pairs(self, pairs: IntArray) -> IntArray:
        return np.array([self._used(v) for v in pairs.ravel().tolist()], dtype=np.int64).reshape(pairs.shape)

    def _used(self, vertex: int) -> int:
        """Return the vertex that is used for one; numbers of none stay, for others to refuse."""
        return int(self.used[vertex]) if 0 <= vertex < len(self.used) else vertex


def join_borders(mesh: MeshFile) -> Joined:
    """Return a mesh with borders joined where two sides, and no more, have the same places and run opposite ways.

    What was manifold and consistently oriented stays so: sides whose joining would give an edge a third face, or a
    face one vertex twice, stay open, and so do those of components that are oriented inconsistently to begin with.
    """
    faces, _ = triangulate(mesh.vertices, mesh.corners, mesh.offsets)
    # Those with one vertex twice are not part of the surface.
    faces = faces[(faces != faces[:, [1, 2, 0]]).all(axis=1)]
    tails, heads = faces.reshape(-1), faces[:, [1, 2, 0]].reshape(-1)
    every = np.arange(len(mesh.vertices))
    order, first = sort_pairs(tails, heads, len(every))
    # Half-edges of edges that have no other.
    border = np.sort(order[first & np.append(first[1:], True)])
    if not len(border):
        return Joined(mesh, every)
    place = number_places(mesh.vertices)[1]
    one, two, coinciding = _opposite(border, place[tails], place[heads], len(every))
    bad = _inconsistent(tails, heads, len(every))
    # Two sheets back to back, as of a leaf, are no gap: there the triangles on both sides are one and the same.
    apexes = place[faces[:, [2, 0, 1]].reshape(-1)]
    folded = apexes[one] == apexes[two]
    fits = ~(bad[tails[one]] | bad[tails[two]] | folded)
    coinciding -= 2 * int(np.count_nonzero(folded))
    one, two = one[fits], two[fits]
    used = every
    while len(one):
        used = _merged(tails, heads, one, two, len(every))
        spoilt = _spoilt(used[tails], used[heads], bad, len(every))
        keep = ~(spoilt[used[tails[one]]] | spoilt[used[heads[one]]])
        if keep.all():
            break
        one, two, used = one[keep], two[keep], every
    left = coinciding - 2 * len(one)
    if not len(one):
        return Joined(mesh, every, left=left)
    joined = replace(
        mesh, corners=used[mesh.corners], unwelded=mesh.corners, welded=int(np.count_nonzero(used != every))
    )
    return Joined(joined, used, len(one), left)


def _opposite(
    border: IntArray, tails: IntArray, heads: IntArray, count: int
) -> tuple[IntArray, IntArray, int]:
    """Return the half-edges (k,), (k,) that run between the same places, opposite ways, and are the only two there.

    Also how many half-edges run between the same places as others.

    Args:
        border: (b,) half-edges.
        tails, heads: (3m,) numbers of the places where half-edges begin and end, below `count`.
    """
    border = border[tails[border] != heads[border]]
    order, first = sort_pairs(tails[border], heads[border], count)
    starts = np.flatnonzero(first)
    sizes = np.diff(np.append(starts, len(order)))
    pairs = starts[sizes == 2]
    one, two = border[order[pairs]], border[order[pairs + 1]]
    opposed = tails[one] == heads[two]
    return one[opposed], two[opposed], int(sizes[sizes > 1].sum())


def _inconsistent(tails: IntArray, heads: IntArray, count: int) -> BoolArray:
    """Return (n,) the vertices of components in which two half-edges run the same way."""
    again = _repeated(tails, heads, count)
    if not again.any():
        return np.zeros(count, dtype=bool)
    _, component = label_components(count, tails, heads)
    return np.isin(component, component[tails[again]])


def _repeated(tails: IntArray, heads: IntArray, count: int) -> BoolArray:
    """Return (3m,) half-edges whose tail and head are those of another one, too."""
    _, number, counts = np.unique(tails * count + heads, return_inverse=True, return_counts=True)
    return np.asarray(counts[number.reshape(-1)] > 1)


def _merged(tails: IntArray, heads: IntArray, one: IntArray, two: IntArray, count: int) -> IntArray:
    """Return (n,) for each vertex the first of those that become one by joining half-edges."""
    _, label = label_components(
        count, np.concatenate([tails[one], heads[one]]), np.concatenate([heads[two], tails[two]])
    )
    return np.asarray(np.unique(label, return_index=True)[1][label])


def _spoilt(tails: IntArray, heads: IntArray, bad: BoolArray, count: int) -> BoolArray:
    """Return (n,) the vertices at which the joining does harm, beside components that were bad before."""
    # Of three corners one side is enough to tell that two are the same.
    harm = (_repeated(tails, heads, count) | (tails == heads)) & ~bad[tails]
    spoilt = np.zeros(count, dtype=bool)
    spoilt[tails[harm]] = spoilt[heads[harm]] = True
    return spoilt
