"""Joining of duplicated edges of a mesh file.

Many programs write a vertex once for each of its normals, materials or UVs, so that a surface that looks closed is
disconnected in the file. Where two border edges coincide bit for bit and have opposite directions, they are joined.
Vertex indices do not change: of merged vertices, the first is used.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..base.arrays import BoolArray, IntArray, mask_of
from ..base.text import plural
from ..errors import OptionError
from ..geometry.triangulate import triangulate
from ..mesh.check import is_left_out, left_out
from ..mesh.check import weld as number_places
from ..mesh.connectivity import label_components, sort_pairs
from .attributes import list_names
from .mesh_file import MeshFile, differing_properties


@dataclass(frozen=True, eq=False)
class Joined:
    """A mesh read from a file, with duplicated border edges joined.

    Attributes:
        mesh: the mesh, with the same number of vertices as the file.
        used: (n,) the vertex that is used for each vertex of the file.
        edges: number of edges that were joined.
        left: number of open edges that coincide with others and stay open.
    """

    mesh: MeshFile
    used: IntArray
    edges: int = 0
    left: int = 0

    @property
    def merged(self) -> int:
        """Return the number of vertices that are replaced by another one."""
        return int(np.count_nonzero(self.used != np.arange(len(self.used))))

    def notes(self) -> tuple[str, ...]:
        """Return notes on what was merged on reading, one sentence each."""
        notes = []
        if self.edges:
            notes.append(
                f"Closed {plural(self.edges, 'edge')} that the file has twice, at the same positions "
                f"({plural(self.merged, 'vertex', 'vertices')} merged); --no-weld leaves them open."
            )
        elif self.mesh.welded:
            notes.append(f"Merged {self.mesh.welded:,} vertices at the same positions.")
        if self.mesh.merged_properties:
            names = list_names(self.mesh.merged_properties)
            notes.append(
                f"Merged vertices differ in {names}: the values of the first of them are used; --no-weld keeps all."
            )
        if self.left:
            notes.append(
                f"{plural(self.left, 'open edge')} at the same positions as others, left open; --weld merges all "
                "vertices at the same positions."
            )
        return tuple(notes)

    def all_notes(self, notes: Sequence[str]) -> tuple[str, ...]:
        """Return these notes and those of a result; replaced vertices are not counted as left out."""
        kept = [note for note in notes if not (self.merged and is_left_out(note))]
        lone = len(self.used) - len(np.unique(self.mesh.corners)) - self.merged if self.merged else 0
        return (*self.notes(), *kept, *[left_out(lone)] * (lone > 0))

    def map_options(self, options: Mapping[str, Any]) -> dict[str, Any]:
        """Return arguments of `coneflat.flatten` with vertices replaced by those that are used for them.

        Raises:
            OptionError: two given vertices are replaced by the same vertex.
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
                            f"vertices {other} and {vertex} have the same position and were merged: use one of "
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
        """Return the vertex that is used for another; invalid indices are returned unchanged and rejected later."""
        return int(self.used[vertex]) if 0 <= vertex < len(self.used) else vertex


def join_borders(mesh: MeshFile) -> Joined:
    """Return a mesh with border edges joined where exactly two have the same positions and opposite directions.

    A manifold, consistently oriented mesh stays so: edges are not joined if an edge would get a third face or a face
    would get the same vertex twice, nor in components that are inconsistently oriented.
    """
    faces, _ = triangulate(mesh.vertices, mesh.corners, mesh.offsets)
    # Triangles with a repeated vertex are not part of the surface.
    faces = faces[(faces != faces[:, [1, 2, 0]]).all(axis=1)]
    tails, heads = faces.reshape(-1), faces[:, [1, 2, 0]].reshape(-1)
    every = np.arange(len(mesh.vertices))
    order, first = sort_pairs(tails, heads, len(every))
    # Half-edges without a twin.
    border = np.sort(order[first & np.append(first[1:], True)])
    if not len(border):
        return Joined(mesh, every)
    place = number_places(mesh.vertices)[1]
    one, two, coinciding = _opposite(border, place[tails], place[heads], len(every))
    bad = _inconsistent(tails, heads, len(every))
    # Two sheets back to back, as of a leaf, are not a gap: the triangles on both sides have the same positions.
    apexes = place[faces[:, [2, 0, 1]].reshape(-1)]
    folded = apexes[one] == apexes[two]
    fits = ~(bad[tails[one]] | bad[tails[two]] | folded)
    coinciding -= 2 * int(np.count_nonzero(folded))
    one, two = one[fits], two[fits]
    used = every
    while len(one):
        used = _merged(tails, heads, one, two, len(every))
        invalid = _invalid(used[tails], used[heads], bad, len(every))
        keep = ~(invalid[used[tails[one]]] | invalid[used[heads[one]]])
        if keep.all():
            break
        one, two, used = one[keep], two[keep], every
    left = coinciding - 2 * len(one)
    if not len(one):
        return Joined(mesh, every, left=left)
    joined = replace(
        mesh,
        corners=used[mesh.corners],
        unwelded=mesh.corners,
        welded=int(np.count_nonzero(used != every)),
        merged_properties=differing_properties(mesh, used),
    )
    return Joined(joined, used, len(one), left)


def _opposite(
    border: IntArray, tails: IntArray, heads: IntArray, count: int
) -> tuple[IntArray, IntArray, int]:
    """Return (k,), (k,) half-edges that are the only two between their positions and have opposite directions.

    Also return the number of half-edges that coincide with others.

    Args:
        border: (b,) half-edges.
        tails, heads: (3m,) position index of the start and end of each half-edge, below `count`.
        count: number of positions.
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
    """Return (n,) True for the vertices of components with two half-edges of the same tail and head."""
    _, component = label_components(count, tails, heads)
    return np.isin(component, component[tails[_repeated(tails, heads, count)]])


def _repeated(tails: IntArray, heads: IntArray, count: int) -> BoolArray:
    """Return (3m,) True for half-edges with the same tail and head as another one."""
    _, number, counts = np.unique(tails * count + heads, return_inverse=True, return_counts=True)
    return np.asarray(counts[number.reshape(-1)] > 1)


def _merged(tails: IntArray, heads: IntArray, one: IntArray, two: IntArray, count: int) -> IntArray:
    """Return (n,) for each vertex the first of the vertices that are merged with it by joining half-edges."""
    _, label = label_components(
        count, np.concatenate([tails[one], heads[one]]), np.concatenate([heads[two], tails[two]])
    )
    return np.asarray(np.unique(label, return_index=True)[1][label])


def _invalid(tails: IntArray, heads: IntArray, bad: BoolArray, count: int) -> BoolArray:
    """Return (n,) True for vertices at which joining makes invalid triangles or edges, outside bad components."""
    # If two corners of a triangle are equal, the half-edge between them has equal ends.
    is_invalid = (_repeated(tails, heads, count) | (tails == heads)) & ~bad[tails]
    return mask_of(count, np.append(tails[is_invalid], heads[is_invalid]))
