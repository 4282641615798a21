"""Triangles without area, replaced without a change of the surface: lengths in the plane could not be those on it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ... import TriangleMesh
from ...base import BoolArray, FloatArray, IntArray, plural
from ...errors import DegenerateFaceError
from ...geometry import double_areas, edge_lengths

# Smallest height of a triangle, relative to its longest side.
MIN_HEIGHT = 1e-9
# Passes in which triangles are replaced: fans of them need one for each.
PASSES = 30


@dataclass(frozen=True, eq=False)
class SoundMesh:
    """A mesh whose triangles have area.

    Attributes:
        mesh: the mesh.
        seams: (k, 2) the vertices of edges that must be cut; None for none.
        flipped: number of triangles that were replaced together with a neighbour.
        removed: number of triangles at the border that were left out.
    """

    mesh: TriangleMesh
    seams: IntArray | None
    flipped: int = 0
    removed: int = 0

    def notes(self) -> Iterator[str]:
        """Yield what was changed, one sentence each."""
        if self.flipped:
            yield (
                f"Replaced {plural(self.flipped, 'triangle')} without area by the other diagonal beside them."
            )
        if self.removed:
            yield f"Left out {plural(self.removed, 'triangle')} without area at the border."


def without_degenerate(mesh: TriangleMesh, seams: IntArray | None = None) -> SoundMesh:
    """Return a mesh without triangles of no area.

    The longest side of such a triangle is replaced by the other diagonal of the quad of both of its triangles; at the
    border of the mesh, the triangle is left out. A seam along the longest side continues along the other two.

    Args:
        mesh: the mesh.
        seams: (k, 2) the vertices of edges that must be cut; None for none.

    Raises:
        DegenerateFaceError: there are others.
    """
    sound = SoundMesh(mesh, seams)
    for _ in range(PASSES):
        is_flat = _is_degenerate(sound.mesh.vertices, sound.mesh.faces)
        if not is_flat.any():
            return _without_lone_vertices(sound) if sound.removed else sound
        if is_flat.all():
            raise DegenerateFaceError("the mesh has no area: all of its triangles are degenerate")
        sound = _with_replaced(sound, is_flat)
    raise DegenerateFaceError(
        f"{int(is_flat.sum()):,} triangles without area could not be replaced: merge vertices at the same places first"
    )


def _is_degenerate(vertices: FloatArray, faces: IntArray) -> BoolArray:
    lengths = edge_lengths(vertices, faces)
    return double_areas(lengths) <= MIN_HEIGHT * lengths.max(axis=1) ** 2


def _with_replaced(sound: SoundMesh, is_flat: BoolArray) -> SoundMesh:
    """Return a mesh with some of the given triangles replaced, none of which share a triangle."""
    mesh = sound.mesh
    faces, lengths = mesh.faces.copy(), edge_lengths(mesh.vertices, mesh.faces)
    seams = set() if sound.seams is None else set(map(tuple, np.sort(sound.seams, axis=1).tolist()))
    is_changed, stays = np.zeros(len(faces), dtype=bool), np.ones(len(faces), dtype=bool)
    flipped = 0
    for face in np.flatnonzero(is_flat).tolist():
        corner = int(lengths[face].argmax())
        first, second = mesh.edge_halfedges[mesh.halfedge_edges[3 * face + corner]].tolist()
        if is_changed[face]:
            continue
        if second < 0:
            stays[face], is_changed[face] = False, True
            continue
        twin = second if first == 3 * face + corner else first
        neighbour, opposite = divmod(twin, 3)
        if is_changed[neighbour]:
            continue
        tip, tail, head = (int(mesh.faces[face, (corner + k) % 3]) for k in range(3))
        apex = int(mesh.faces[neighbour, opposite])
        faces[face], faces[neighbour] = (tip, tail, apex), (tip, apex, head)
        is_changed[[face, neighbour]] = True
        flipped += 1
        longest = min(tail, head), max(tail, head)
        if longest in seams:
            seams.remove(longest)
            seams |= {(min(end, tip), max(end, tip)) for end in longest}
    removed = int((~stays).sum())
    return SoundMesh(
        TriangleMesh(mesh.vertices, faces[stays]),
        None if sound.seams is None else np.array(sorted(seams), dtype=np.int64).reshape(-1, 2),
        sound.flipped + flipped,
        sound.removed + removed,
    )


def _without_lone_vertices(sound: SoundMesh) -> SoundMesh:
    """Return a mesh without vertices and seams that no triangle has any more."""
    mesh, seams = sound.mesh, sound.seams
    members = np.unique(mesh.faces)
    number = np.full(len(mesh.vertices), -1)
    number[members] = np.arange(len(members))
    if seams is not None:
        seams = number[seams]
        seams = seams[(seams >= 0).all(axis=1)]
    return SoundMesh(
        TriangleMesh(mesh.vertices[members], number[mesh.faces]), seams, sound.flipped, sound.removed
    )
