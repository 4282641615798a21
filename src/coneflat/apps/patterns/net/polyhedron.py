"""The plane faces of a polyhedron, and the hinges between them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .... import TriangleMesh
from ....base import BoolArray, FloatArray, IntArray
from ....geometry import dihedral_angles, double_areas, edge_lengths, face_normals, unit_vectors
from ....mesh import label_components, tie_key

# Largest angle between the normals of adjacent triangles of a face, radians: coordinates of single precision tilt
# triangles by less, except thin ones.
COPLANAR = 1e-5
# Largest relative change of length of an edge when a face is projected onto its plane.
MAX_PROJECTION_STRAIN = 1e-10
# Digits of the keys by which faces and hinges are ordered, and of the relative lengths of hinges; rounding errors are
# smaller.
DIGITS = 9


@dataclass(frozen=True, eq=False)
class Polyhedron:
    """The plane faces of a mesh of m triangles.

    Faces and hinges are numbered by the shape, whatever the numbers of vertices and triangles are.

    Attributes:
        mesh: the mesh.
        face: (m,) the face of each triangle.
        places: (m, 3, 2) the corners of the triangles in the frame of their face, counterclockwise seen from outside.
        hinges: (h,) an edge of the mesh between each two adjacent faces: the longest one.
        hinge_lengths: (h,) the length of all edges between the two.
    """

    mesh: TriangleMesh
    face: IntArray
    places: FloatArray
    hinges: IntArray
    hinge_lengths: FloatArray

    @classmethod
    def of(cls, mesh: TriangleMesh) -> Polyhedron:
        """Return the polyhedron of a mesh whose triangles have area."""
        is_joined = (np.abs(dihedral_angles(mesh)) <= COPLANAR) & ~mesh.is_boundary_edge
        count, label = label_components(len(mesh.faces), *mesh.edge_faces[is_joined].T)
        places = _projected(mesh, label, count)
        is_bent = np.bincount(label, _strains(mesh, places) > MAX_PROJECTION_STRAIN, count) > 0
        is_single = is_bent[label] | (np.bincount(label)[label] == 1)
        places[is_single] = _triangles_in_plane(mesh)[is_single]
        label = np.where(is_single, count + np.arange(len(label)), label)
        vertex_key = tie_key(mesh.vertices)
        face = _ranks(label, vertex_key[mesh.faces].sum(axis=1))
        return cls(mesh, face, places, *_hinges(mesh, face, vertex_key))

    @cached_property
    def hinge_faces(self) -> IntArray:
        """(h, 2) the faces at each hinge."""
        return self.face[self.mesh.edge_faces[self.hinges]]

    @cached_property
    def hinge_of_edge(self) -> IntArray:
        """(e,) the hinge between the faces of each edge; -1 on the boundary and inside faces."""
        if not len(self.hinges):
            return np.full(len(self.mesh.edges), -1)
        count = int(self.face.max()) + 1
        keys, hinge_keys = (
            np.sort(pairs, axis=1) @ [count, 1]
            for pairs in (self.face[self.mesh.edge_faces], self.hinge_faces)
        )
        hinge = np.minimum(np.searchsorted(hinge_keys, keys), len(hinge_keys) - 1)
        return np.where((hinge_keys[hinge] == keys) & ~self.mesh.is_boundary_edge, hinge, -1)

    @cached_property
    def hinge_ends(self) -> FloatArray:
        """(h, 2, 2, 2) the ends of each hinge in the frames of its two faces, in the same order."""
        return self._ends(self.hinges)

    @cached_property
    def division_gap(self) -> float:
        """The largest gap between the two sides of edges where faces are unfolded about their hinges.

        Two faces have several edges in common where triangles divide them. Their sides fit but for the rounding of the
        coordinates of the model.
        """
        edges = np.flatnonzero(self.hinge_of_edge >= 0)
        edges = edges[self.hinges[self.hinge_of_edge[edges]] != edges]
        if not len(edges):
            return 0.0
        hinge = self.hinge_of_edge[edges]
        ends = self._ends(edges)
        is_swapped = self.face[self.mesh.edge_faces[edges, 0]] != self.hinge_faces[hinge, 0]
        ends[is_swapped] = ends[is_swapped][:, ::-1]
        first, second = (ends @ [1, 1j]).transpose(1, 0, 2)
        (a, b), (c, d) = (self.hinge_ends[hinge] @ [1, 1j]).transpose(1, 2, 0)
        turn = (b - a) / (d - c)
        unfolded = (
            turn[:, None] / np.abs(turn)[:, None] * (second - (c + d)[:, None] / 2) + (a + b)[:, None] / 2
        )
        return float(np.abs(unfolded - first).max())

    def _ends(self, edges: IntArray) -> FloatArray:
        """Return (k, 2, 2, 2) the ends of edges (k,) in the frames of their two faces, in the same order."""
        triangle, corner = np.divmod(self.mesh.edge_halfedges[edges], 3)
        starts, ends = self.places[triangle, (corner + 1) % 3], self.places[triangle, (corner + 2) % 3]
        return np.stack(
            [np.stack([starts[:, 0], ends[:, 0]], axis=1), np.stack([ends[:, 1], starts[:, 1]], axis=1)],
            axis=1,
        )


def _projected(mesh: TriangleMesh, label: IntArray, count: int) -> FloatArray:
    """Return (m, 3, 2) the triangles projected onto the mean planes of their faces, centred."""
    normals = face_normals(mesh.vertices, mesh.faces)
    areas = np.linalg.norm(normals, axis=1)
    upward = unit_vectors(_sums(label, normals, count))
    corners = mesh.vertices[mesh.faces] - mesh.vertices.mean(axis=0)
    totals = np.bincount(label, areas, count)
    centres = _sums(label, areas[:, None] * corners.mean(axis=1), count) / totals[:, None]
    longest = np.lexsort([-edge_lengths(mesh.vertices, mesh.faces).max(axis=1), label])
    triangle = longest[np.searchsorted(label[longest], np.arange(count))]
    along = corners[triangle, 1] - corners[triangle, 0]
    right = unit_vectors(along - (along * upward).sum(axis=1)[:, None] * upward)
    frames = np.stack([right, np.cross(upward, right)], axis=1)
    return np.einsum("mci,mxi->mcx", corners - centres[label][:, None], frames[label])


def _sums(label: IntArray, vectors: FloatArray, count: int) -> FloatArray:
    """Return (count, k) the sums of the vectors (m, k) of each label."""
    return np.stack([np.bincount(label, column, count) for column in vectors.T], axis=1)


def _strains(mesh: TriangleMesh, places: FloatArray) -> FloatArray:
    """Return (m,) the largest relative change of length of the sides of each triangle."""
    sides = np.linalg.norm(places[:, [2, 0, 1]] - places[:, [1, 2, 0]], axis=2)
    return np.abs(sides / edge_lengths(mesh.vertices, mesh.faces) - 1).max(axis=1)


def _triangles_in_plane(mesh: TriangleMesh) -> FloatArray:
    """Return (m, 3, 2) each triangle in the plane, centred, from its lengths: exact also for needles."""
    lengths = edge_lengths(mesh.vertices, mesh.faces)
    first = lengths.argmax(axis=1)
    rows = np.arange(len(lengths))
    a, b, c = (lengths[rows, (first + i) % 3] for i in range(3))
    places = np.zeros((len(lengths), 3, 2))
    places[rows, (first + 2) % 3, 0] = a
    places[rows, first, 0] = (a + (c - b) * (c + b) / a) / 2
    places[rows, first, 1] = double_areas(lengths) / a
    return places - places.mean(axis=1, keepdims=True)


def _ranks(label: IntArray, key: FloatArray) -> IntArray:
    """Return (m,) the labels replaced by numbers from 0, by the mean key of their items."""
    _, inverse = np.unique(label, return_inverse=True)
    means = np.round(np.bincount(inverse, key) / np.bincount(inverse), DIGITS)
    rank = np.empty(len(means), dtype=np.int64)
    rank[np.argsort(means, kind="stable")] = np.arange(len(means))
    return rank[inverse]


def _hinges(mesh: TriangleMesh, face: IntArray, vertex_key: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the longest edge between each two adjacent faces, and the length of all edges between the two."""
    pairs = np.where(mesh.is_boundary_edge[:, None], 0, face[mesh.edge_faces])
    edges = np.flatnonzero(pairs[:, 0] != pairs[:, 1])
    pairs = np.sort(pairs[edges], axis=1)
    ends = mesh.vertices[mesh.edges[edges]]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    key = vertex_key[mesh.edges[edges]].sum(axis=1)
    size = lengths.max(initial=0.0)
    order = np.lexsort(
        [key, -np.round(lengths / max(size, np.finfo(float).tiny), DIGITS), pairs[:, 1], pairs[:, 0]]
    )
    is_first = _are_first(pairs[order])
    group = np.cumsum(is_first) - 1
    totals = np.bincount(group, lengths[order], int(is_first.sum())).astype(float)
    return edges[order[is_first]].astype(np.int64), totals


def _are_first(rows: IntArray) -> BoolArray:
    """Return (k,) whether each of sorted rows differs from the row before."""
    is_first = np.ones(len(rows), dtype=bool)
    is_first[1:] = (rows[1:] != rows[:-1]).any(axis=1)
    return is_first
