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
        representative: (n,) the vertex that is used for each vertex of the file.
        edges: number of edges that were joined.
        left: number of open edges that coincide with others and stay open.
    """

    mesh: MeshFile
    representative: IntArray
    edges: int = 0
    left: int = 0

    @property
    def merged(self) -> int:
        """Return the number of vertices that are replaced by another one."""
        return int(np.count_nonzero(self.representative != np.arange(len(self.representative))))

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
        others_notes = [note for note in notes if not (self.merged and is_left_out(note))]
        lone = (
            len(self.representative) - len(np.unique(self.mesh.corners)) - self.merged if self.merged else 0
        )
        return (*self.notes(), *others_notes, *[left_out(lone)] * (lone > 0))

    def map_options(self, options: Mapping[str, Any]) -> dict[str, Any]:
        """Return arguments of `coneflat.flatten` with vertices replaced by those that are used for them.

        Raises:
            OptionError: two given vertices are replaced by the same vertex.
        """
        if not self.merged:
            return dict(options)
        replaced = dict(options)
        for name in ("cones", "boundary"):
            if isinstance(curvatures := replaced.get(name), Mapping):
                replaced[name] = self._replaced_keys(curvatures)
        for name in ("required_cones", "forbidden_cones"):
            if replaced.get(name) is not None:
                replaced[name] = tuple(dict.fromkeys(self._replaced(v) for v in replaced[name]))
        if isinstance(replaced.get("weights"), Mapping):
            replaced["weights"] = {self._replaced(v): weight for v, weight in replaced["weights"].items()}
        for name in ("seams", "no_seams"):
            edges = replaced.get(name)
            if isinstance(edges, tuple) and len(edges) == 2 and isinstance(edges[0], str):
                replaced[name] = (edges[0], self._replaced_pairs(np.asarray(edges[1])))
            elif isinstance(edges, np.ndarray):
                replaced[name] = self._replaced_pairs(edges)
        return replaced

    def _replaced_keys(self, curvatures: Mapping[int, Any]) -> dict[int, Any]:
        """Return a map from vertices with the vertices replaced; raise OptionError if two become the same."""
        vertex_of: dict[int, int] = {}
        for vertex in curvatures:
            first_vertex = vertex_of.setdefault(self._replaced(vertex), vertex)
            if first_vertex != vertex:
                raise OptionError(
                    f"vertices {first_vertex} and {vertex} have the same position and were merged: use one of "
                    "them, or add --no-weld"
                )
        return dict(zip(vertex_of, curvatures.values(), strict=True))

    def _replaced_pairs(self, pairs: IntArray) -> IntArray:
        return np.array([self._replaced(v) for v in pairs.ravel().tolist()], dtype=np.int64).reshape(
            pairs.shape
        )

    def _replaced(self, vertex: int) -> int:
        """Return the vertex that is used for another; invalid indices are returned unchanged and rejected later."""
        return int(self.representative[vertex]) if 0 <= vertex < len(self.representative) else vertex


def join_borders(mesh: MeshFile) -> Joined:
    """Return a mesh with border edges joined where exactly two have the same positions and opposite directions.

    A manifold, consistently oriented mesh stays so: edges are not joined if an edge would get a third face or a face
    would get the same vertex twice, nor in components that are inconsistently oriented.
    """
    faces, _ = triangulate(mesh.vertices, mesh.corners, mesh.offsets)
    # Triangles with a repeated vertex are not part of the surface.
    faces = faces[(faces != faces[:, [1, 2, 0]]).all(axis=1)]
    tails, heads = faces.reshape(-1), faces[:, [1, 2, 0]].reshape(-1)
    vertices = np.arange(len(mesh.vertices))
    order, first = sort_pairs(tails, heads, len(vertices))
    # Half-edges without a twin.
    border = np.sort(order[first & np.append(first[1:], True)])
    if not len(border):
        return Joined(mesh, vertices)
    place = number_places(mesh.vertices)[1]
    first_side, second_side, coinciding = _opposite(border, place[tails], place[heads], len(vertices))
    bad = _inconsistent(tails, heads, len(vertices))
    # Two sheets back to back, as of a leaf, are not a gap: the triangles on both sides have the same positions.
    apexes = place[faces[:, [2, 0, 1]].reshape(-1)]
    folded = apexes[first_side] == apexes[second_side]
    fits = ~(bad[tails[first_side]] | bad[tails[second_side]] | folded)
    coinciding -= 2 * int(np.count_nonzero(folded))
    first_side, second_side = first_side[fits], second_side[fits]
    representative = vertices
    while len(first_side):
        representative = _merged(tails, heads, first_side, second_side, len(vertices))
        invalid = _invalid(representative[tails], representative[heads], bad, len(vertices))
        keep = ~(invalid[representative[tails[first_side]]] | invalid[representative[heads[first_side]]])
        if keep.all():
            break
        first_side, second_side, representative = first_side[keep], second_side[keep], vertices
    left = coinciding - 2 * len(first_side)
    if not len(first_side):
        return Joined(mesh, vertices, left=left)
    joined = replace(
        mesh,
        corners=representative[mesh.corners],
        unwelded=mesh.corners,
        welded=int(np.count_nonzero(representative != vertices)),
        merged_properties=differing_properties(mesh, representative),
    )
    return Joined(joined, representative, len(first_side), left)


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
    first_side, second_side = border[order[pairs]], border[order[pairs + 1]]
    opposed = tails[first_side] == heads[second_side]
    return first_side[opposed], second_side[opposed], int(sizes[sizes > 1].sum())


def _inconsistent(tails: IntArray, heads: IntArray, count: int) -> BoolArray:
    """Return (n,) True for the vertices of components with two half-edges of the same tail and head."""
    _, component = label_components(count, tails, heads)
    return np.isin(component, component[tails[_repeated(tails, heads, count)]])


def _repeated(tails: IntArray, heads: IntArray, count: int) -> BoolArray:
    """Return (3m,) True for half-edges with the same tail and head as another one."""
    _, number, counts = np.unique(tails * count + heads, return_inverse=True, return_counts=True)
    return np.asarray(counts[number.reshape(-1)] > 1)


def _merged(
    tails: IntArray, heads: IntArray, first_side: IntArray, second_side: IntArray, count: int
) -> IntArray:
    """Return (n,) for each vertex the first of the vertices that are merged with it by joining half-edges."""
    _, label = label_components(
        count,
        np.concatenate([tails[first_side], heads[first_side]]),
        np.concatenate([heads[second_side], tails[second_side]]),
    )
    return np.asarray(np.unique(label, return_index=True)[1][label])


def _invalid(tails: IntArray, heads: IntArray, bad: BoolArray, count: int) -> BoolArray:
    """Return (n,) True for vertices at which joining makes invalid triangles or edges, outside bad components."""
    # If two corners of a triangle are equal, the half-edge between them has equal ends.
    is_invalid = (_repeated(tails, heads, count) | (tails == heads)) & ~bad[tails]
    return mask_of(count, np.append(tails[is_invalid], heads[is_invalid]))
