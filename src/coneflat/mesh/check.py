"""Checks that a mesh is valid, with errors that state what is wrong and where, and its repair."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import BoolArray, FloatArray, IntArray, as_faces, as_floats, require_finite
from ..base.sets import grow_forest
from ..base.text import list_some, plural
from ..errors import (
    ArrayShapeError,
    DegenerateFaceError,
    EmptyMeshError,
    NonManifoldError,
    NonOrientableError,
)
from .connectivity import NEXT, PREVIOUS, TriangleMesh, label_components, split_vertices
from .doubled import EdgeGroups, glue_layers

REPAIR_ADVICE = "pass repair=True (on the command line: leave out --strict)"


LEFT_OUT, FACELESS = "Left out ", " without a face."


@dataclass(frozen=True, eq=False)
class CheckedMesh:
    """A mesh that can be flattened, with its relation to the input.

    Attributes:
        mesh: manifold, consistently oriented, without isolated vertices.
        vertex_origin: (n,) the input vertex of each vertex of the mesh.
        face_origin: (m,) the input face of each face of the mesh.
        is_flipped: (m,) True for faces whose orientation was reversed (corners 1 and 2 exchanged).
        notes: the changes that were made, one sentence each.
        exponent: the mesh has been scaled by two to the power of this number.
    """

    mesh: TriangleMesh
    vertex_origin: IntArray
    face_origin: IntArray
    is_flipped: BoolArray
    notes: tuple[str, ...]
    exponent: int = 0


def check_mesh(vertices: ArrayLike, faces: ArrayLike, *, repair: bool = False) -> CheckedMesh:
    """Return the mesh as a checked manifold with consistent orientation; raise an error if that is impossible.

    Faces are oriented consistently and isolated vertices are left out; notes report both.

    Args:
        vertices: (n, 3) positions.
        faces: (m, 3) vertex indices, from 0.
        repair: drop faces that use a vertex twice, split non-manifold edges and vertices, and cut non-orientable
            surfaces, instead of raising an error. The two sides of a sheet, on the same vertices, become two layers.
            A mesh that raises no error is not changed.

    Returns:
        The mesh, and how its vertices and faces correspond to the input.

    Raises:
        EmptyMeshError, ArrayShapeError, NonFiniteError, FaceIndexError: the arrays are not a mesh.
        DegenerateFaceError: a face uses a vertex twice.
        NonManifoldError: an edge has more than two faces, or a vertex more than one fan.
        NonOrientableError: the faces cannot be oriented consistently.

    Examples:
        >>> vertices = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
        >>> checked = coneflat.check_mesh(vertices, [[0, 1, 2], [0, 3, 2]])
        >>> checked.is_flipped  # the second face ran the other way
        array([False,  True])
        >>> checked.mesh.faces
        array([[0, 1, 2],
               [0, 2, 3]])
    """
    points = _as_vertices(vertices)
    triangles = as_faces(faces, len(points))
    require_finite(points, triangles)
    try:
        return _Check(points, triangles, False).run()
    except (DegenerateFaceError, NonManifoldError, NonOrientableError):
        if not repair:
            raise
    return _Check(points, triangles, True).run()


def left_out(count: int) -> str:
    """Return the note that vertices without a face were left out."""
    return f"{LEFT_OUT}{plural(count, 'vertex', 'vertices')}{FACELESS}"


def short_faces_note(count: int) -> str:
    """Return the note that faces with fewer than three corners were dropped."""
    return f"Dropped {plural(count, 'face')} with fewer than three corners."


def is_left_out(note: str) -> bool:
    """Return whether a note was made by `left_out`."""
    return note.startswith(LEFT_OUT) and note.endswith(FACELESS)


def _as_vertices(vertices: ArrayLike) -> FloatArray:
    points = as_floats("vertices", vertices)
    if points.size == 0:
        raise EmptyMeshError("the mesh has no vertices")
    if points.ndim != 2 or points.shape[1] != 3:
        raise ArrayShapeError(f"vertices must have the shape (n, 3), got {points.shape}")
    return points


class _Check:
    """The state of a mesh during the check, with a record of the changes.

    The steps depend on one another and run in the order of the methods.
    """

    def __init__(self, vertices: FloatArray, faces: IntArray, repair: bool) -> None:
        self.vertices = vertices
        self.faces = faces
        self.repair = repair
        self.face_origin = np.arange(len(faces))
        self.is_flipped = np.zeros(len(faces), dtype=bool)
        self.pairs = np.empty((0, 2), dtype=np.int64)
        self.notes: list[str] = []

    def run(self) -> CheckedMesh:
        """Run all steps and return the checked mesh."""
        self.drop_degenerate_faces()
        self.pair_halfedges()
        self.orient()
        self.split_fans()
        mesh = TriangleMesh(self.vertices[self.vertex_origin], self.faces)
        return CheckedMesh(mesh, self.vertex_origin, self.face_origin, self.is_flipped, tuple(self.notes))

    def _keep(self, keep: BoolArray) -> None:
        self.faces = self.faces[keep]
        self.face_origin = self.face_origin[keep]
        self.is_flipped = self.is_flipped[keep]
        if not len(self.faces):
            raise EmptyMeshError("the mesh has no faces left once degenerate ones are dropped")

    def drop_degenerate_faces(self) -> None:
        """Drop faces that use a vertex twice, if the mesh is repaired.

        Raises:
            DegenerateFaceError: a face uses a vertex twice and the mesh is not repaired.
        """
        a, b, c = self.faces.T
        repeats_vertex = (a == b) | (b == c) | (c == a)
        if repeats_vertex.any():
            degenerate = np.flatnonzero(repeats_vertex)
            if not self.repair:
                raise DegenerateFaceError(
                    f"{plural(len(degenerate), 'face')} with the same vertex twice: {list_some(degenerate)}; "
                    f"{REPAIR_ADVICE} to drop them"
                )
            self._keep(~repeats_vertex)
            self.notes.append(f"Dropped {plural(len(degenerate), 'face')} with the same vertex twice.")

    def pair_halfedges(self) -> None:
        """Find the pairs (k, 2) of half-edges that are glued; at edges with three or more faces, only layers are.

        Raises:
            NonManifoldError: an edge has more than two faces and the mesh is not repaired.
        """
        groups = EdgeGroups.of(self.faces, len(self.vertices))
        self.pairs, crowded = groups.pairs, groups.crowded
        if not len(crowded):
            return
        if not self.repair:
            edges = [self._edge_name(h) for h in crowded[:5]]
            raise NonManifoldError(
                f"{plural(len(crowded), 'edge')} with more than two faces "
                f"(vertex pairs {list_some(edges, len(crowded))}); {REPAIR_ADVICE} to separate the faces there"
            )
        glued = glue_layers(self.vertices, self.faces, groups)
        self.pairs = glued.pairs
        if glued.stacked:
            stacked_faces = plural(glued.stacked, "face")
            self.notes.append(
                f"Put {stacked_faces} on the same three vertices as others into separate layers."
            )
        if glued.separated:
            self.notes.append(f"Separated the faces at {plural(glued.separated, 'edge')} with more than two.")

    def orient(self) -> None:
        """Flip faces so that neighbours have the same orientation; in each component, the smaller set is flipped.

        Raises:
            NonOrientableError: the surface is not orientable and the mesh is not repaired.
        """
        count = len(self.faces)
        tails = self.faces[:, NEXT].ravel()
        same_way = tails[self.pairs[:, 0]] == tails[self.pairs[:, 1]]
        if not same_way.any():
            return
        pairs = self.pairs // 3
        first_face, second_face = pairs.T
        tree = np.flatnonzero(grow_forest(pairs, count))
        # There are two copies of each face, one per orientation; a spanning tree joins them to two mirrored halves.
        crossing = same_way[tree] * count
        tree_first, tree_second = first_face[tree], second_face[tree]
        _, half = label_components(
            2 * count,
            np.concatenate([tree_first, tree_first + count]),
            np.concatenate([tree_second + crossing, tree_second + count - crossing]),
        )
        flip = half[:count] > half[count:]
        conflict = same_way ^ flip[first_face] ^ flip[second_face]
        if conflict.any():
            if not self.repair:
                raise NonOrientableError(
                    "the surface is not orientable, like a Moebius strip: its faces cannot be oriented "
                    f"consistently (edge {self._edge_name(self.pairs[conflict][0, 0])}); "
                    f"{REPAIR_ADVICE} to cut it open"
                )
            self.pairs = self.pairs[~conflict]
            self.notes.append(f"Cut the non-orientable surface at {plural(int(conflict.sum()), 'edge')}.")
        components, component = label_components(count, first_face[tree], second_face[tree])
        sizes = np.bincount(component, minlength=components)
        flipped = np.bincount(component, weights=flip, minlength=components)
        flip ^= (flipped > sizes / 2)[component]
        self._flip(flip)

    def _edge_name(self, h: np.int64) -> str:
        return "{}-{}".format(
            *sorted(self.faces.ravel()[[h - h % 3 + NEXT[h % 3], h - h % 3 + PREVIOUS[h % 3]]])
        )

    def _flip(self, flip: BoolArray) -> None:
        self.faces = np.where(flip[:, None], self.faces[:, [0, 2, 1]], self.faces)
        self.is_flipped ^= flip
        corner = self.pairs % 3
        exchanged = np.where(corner == 0, 0, 3 - corner)
        self.pairs = np.where(flip[self.pairs // 3], self.pairs - corner + exchanged, self.pairs)
        if flip.any():
            self.notes.append(f"Flipped {plural(int(flip.sum()), 'face')} for a consistent orientation.")

    def split_fans(self) -> None:
        """Split vertices with more than one fan of faces if the mesh is repaired; leave out isolated vertices.

        Raises:
            NonManifoldError: a vertex has more than one fan and the mesh is not repaired.
        """
        # Vertices are numbered in the order of the input; the copies of a split vertex follow one another.
        count = len(self.vertices)
        self.vertex_origin, self.faces = split_vertices(self.faces, count, *self.pairs.T)
        fans_at = np.bincount(self.vertex_origin, minlength=count)
        isolated = int((fans_at == 0).sum())
        split = np.flatnonzero(fans_at > 1)
        if len(split):
            if not self.repair:
                raise NonManifoldError(
                    f"{plural(len(split), 'vertex', 'vertices')} where surfaces touch in a single point: "
                    f"{list_some(split)}; {REPAIR_ADVICE} to split them"
                )
            self.notes.append(f"Split {plural(len(split), 'non-manifold vertex', 'non-manifold vertices')}.")
        if isolated:
            self.notes.append(left_out(isolated))


def weld(vertices: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the vertices that remain after vertices of equal position are merged, and the new index of each vertex.

    Two vertices are merged if their coordinates are equal bit for bit, except that -0.0 equals 0.0.

    Args:
        vertices: (n, k) positions.

    Returns:
        (p,) the first vertex at each position, ascending; (n,) the index of every vertex into these.
    """
    rows = np.ascontiguousarray(vertices, dtype=np.float64) + 0.0
    # Rows that are viewed as one value of bytes are sorted several times faster than by columns.
    rows_as_bytes = rows.view(f"V{rows.itemsize * rows.shape[1]}").reshape(-1)
    _, first, number = np.unique(rows_as_bytes, return_index=True, return_inverse=True)
    order = np.argsort(first)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    return first[order], place[number.reshape(-1)]
