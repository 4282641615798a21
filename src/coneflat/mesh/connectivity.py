"""Triangle meshes and their connectivity.

Half-edge `h = 3 * f + i` is the side of face `f` opposite its corner `i`. It runs from corner `i + 1` to
corner `i + 2` (mod 3). Every quantity of a side (length, cotangent, twin) therefore has the index of the
opposite corner.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_matrix

from ..base.arrays import BoolArray, FloatArray, IntArray, has_any, mask_of
from ..base.jit import compiled
from ..base.sets import edges_at_nodes, label_nodes
from .edge_kernels import label_fans, number_edges, order_pairs

NEXT = np.array([1, 2, 0])
PREVIOUS = np.array([2, 0, 1])
# Cached properties of a mesh that depend on its faces only.
CONNECTIVITY = ("_pairing", "tails", "heads", "is_boundary_edge", "is_boundary_vertex", "incident_edges")


def label_components(count: int, tails: IntArray, heads: IntArray) -> tuple[int, IntArray]:
    """Return the number of connected components of a graph, and (count,) the component of each node.

    Args:
        count: number of nodes.
        tails, heads: (e,) the nodes that each edge connects.
    """
    ends = (np.ascontiguousarray(nodes, dtype=np.int64) for nodes in (tails, heads))
    number, labels = label_nodes(count, *ends)
    return int(number), labels


def label_faces(faces: IntArray, count: int) -> tuple[int, IntArray]:
    """Return the number of connected components of triangles, and (m,) the component of each: the charts of UVs.

    Args:
        faces: (m, 3) indices of points.
        count: number of all points; each point without a triangle is a component of its own.
    """
    number, labels = label_components(count, faces[:, :2].reshape(-1), np.repeat(faces[:, 2], 2))
    return number, labels[faces[:, 0]]


def sort_by_counting(keys: IntArray, bound: int) -> IntArray:
    """Return the stable order (k,) of integers (k,) from 0 to bound - 1, in linear time."""
    # SciPy converts rows to columns by a counting sort.
    count = len(keys)
    rows = csr_matrix((np.empty(count, dtype=np.int8), keys, np.arange(count + 1)), shape=(count, bound))
    return rows.tocsc().indices


def sort_pairs(tails: IntArray, heads: IntArray, bound: int) -> tuple[IntArray, BoolArray]:
    """Return the stable order of unordered pairs by smaller, then larger index, and a mask of first occurrences.

    Args:
        tails, heads: (k,) the indices of each pair, from 0 to bound - 1.
        bound: number of indices.

    Returns:
        (k,) the order; (k,) True where a pair in this order differs from the one before.
    """
    tails, heads = (np.ascontiguousarray(nodes, dtype=np.int64) for nodes in (tails, heads))
    return order_pairs(tails, heads, bound)


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A manifold, consistently oriented triangle mesh without isolated vertices.

    The arrays are stored without a copy. Types, shapes and manifoldness are not checked; `coneflat.check_mesh` makes
    a mesh from arbitrary arrays, or raises an error that states why it cannot.

    Attributes:
        vertices: (n, 3) positions, float64, in model units.
        faces: (m, 3) vertex indices from 0, int64.

    Examples:
        >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]
        >>> mesh = coneflat.check_mesh(*square).mesh
        >>> mesh.edges.shape, int(mesh.is_boundary_edge.sum())
        ((5, 2), 4)
    """

    vertices: FloatArray
    faces: IntArray

    @cached_property
    def _pairing(self) -> tuple[IntArray, IntArray, IntArray]:
        """Edges as vertex pairs (e, 2), edge of each half-edge (3m,), half-edges of each edge (e, 2)."""
        tails, heads = (self.faces.take(corners, axis=1).ravel() for corners in (NEXT, PREVIOUS))
        return number_edges(tails, heads, *order_pairs(tails, heads, len(self.vertices)))

    def moved_to(self, vertices: FloatArray) -> TriangleMesh:
        """Return the mesh with other vertex positions (n, 3); cached connectivity is shared."""
        moved, cached = TriangleMesh(vertices, self.faces), self.__dict__
        moved.__dict__.update({name: cached[name] for name in CONNECTIVITY if name in cached})
        return moved

    @cached_property
    def tails(self) -> IntArray:
        """(3m,) start vertex of each half-edge."""
        return self.faces.take(NEXT, axis=1).ravel()

    @cached_property
    def heads(self) -> IntArray:
        """(3m,) end vertex of each half-edge."""
        return self.faces.take(PREVIOUS, axis=1).ravel()

    def ends_of(self, halfedges: IntArray) -> tuple[IntArray, IntArray]:
        """Return the start and end vertices of given half-edges, without computing those of all half-edges.

        Args:
            halfedges: (k,) half-edges 3 f + i, opposite corner i of face f.
        """
        flat = self.faces.ravel()
        start, end = end_corners(halfedges)
        return flat[start], flat[end]

    @property
    def edges(self) -> IntArray:
        """(e, 2) vertex pairs, the smaller index first."""
        return self._pairing[0]

    @property
    def halfedge_edges(self) -> IntArray:
        """(3m,) edge of each half-edge."""
        return self._pairing[1]

    @property
    def edge_halfedges(self) -> IntArray:
        """(e, 2) the half-edges of each edge; the second is -1 on the boundary."""
        return self._pairing[2]

    @cached_property
    def edge_faces(self) -> IntArray:
        """(e, 2) the faces of each edge; the second is -1 on the boundary."""
        return self.edge_halfedges // 3  # -1 stays -1

    @cached_property
    def is_boundary_edge(self) -> BoolArray:
        """(e,) True for edges with one face."""
        return self.edge_halfedges[:, 1] < 0

    @cached_property
    def is_boundary_vertex(self) -> BoolArray:
        """(n,) True for vertices on a boundary loop."""
        return mask_of(len(self.vertices), self.edges[self.is_boundary_edge])

    @cached_property
    def incident_edges(self) -> tuple[IntArray, IntArray]:
        """Incident edges of the vertices: where those of each vertex start, (n + 1,), and the edges, (2e,)."""
        return edges_at_nodes(self.edges, len(self.vertices))

    @cached_property
    def face_pairs(self) -> tuple[IntArray, tuple[IntArray, IntArray]]:
        """Pairs of faces that share an edge (k, 2), by edge, and those of each face, as in `incident_edges`."""
        pairs = self.edge_faces[~self.is_boundary_edge]
        return pairs, edges_at_nodes(pairs, len(self.faces))

    @cached_property
    def boundary_loops(self) -> tuple[int, IntArray]:
        """The number of boundary loops, and (n,) the loop of each vertex; -1 at inner vertices."""
        on_boundary = np.flatnonzero(self.is_boundary_vertex)
        local = np.full(len(self.vertices), -1, dtype=np.int64)
        local[on_boundary] = np.arange(len(on_boundary))
        sides = local[self.edges[self.is_boundary_edge]]
        count, labels = label_components(len(on_boundary), sides[:, 0], sides[:, 1])
        local[on_boundary] = labels
        return count, local

    def boundary_walks(self) -> list[IntArray]:
        """Return for each boundary loop (b,) its half-edges in order, the mesh on the left; loops share no vertex."""
        sides, walks = self.edge_halfedges[self.is_boundary_edge, 0], list[list[int]]()
        ends = np.stack([*self.ends_of(sides), sides], axis=1).tolist()
        leaving = {tail: (head, side) for tail, head, side in ends}
        for vertex in list(leaving):
            walks.append([])
            while vertex in leaving:
                vertex, side = leaving.pop(vertex)
                walks[-1].append(side)
        return [np.array(walk) for walk in walks if walk]

    @cached_property
    def components(self) -> tuple[int, IntArray]:
        """The number of connected components, and (n,) the component of each vertex."""
        return label_components(len(self.vertices), self.edges[:, 0], self.edges[:, 1])

    @property
    def euler_characteristic(self) -> int:
        """Vertices minus edges plus faces."""
        return len(self.vertices) - len(self.edges) + len(self.faces)

    def genus(self) -> int:
        """The number of handles of a connected mesh."""
        return (2 - self.euler_characteristic - self.boundary_loops[0]) // 2

    def split_components(self) -> list[tuple[TriangleMesh, IntArray, IntArray]]:
        """Return each component as a separate mesh, with its vertex and face indices in this mesh."""
        count, labels = self.components
        if count == 1:
            return [(self, np.arange(len(self.vertices)), np.arange(len(self.faces)))]
        of_vertex, of_face, of_edge = labels, labels[self.faces[:, 0]], labels[self.edges[:, 0]]
        vertices, faces, edges = (_Sorted.by(of, count) for of in (of_vertex, of_face, of_edge))
        positions = self.vertices[vertices.order]
        corners = vertices.number[self.faces[faces.order]]
        pairs = vertices.number[self.edges[edges.order]]
        edge_of = edges.number[self.halfedge_edges.reshape(-1, 3)[faces.order]]
        sides = self.edge_halfedges[edges.order]
        sides = np.where(sides < 0, -1, 3 * faces.number[sides // 3] + sides % 3)
        on_boundary, is_outer = self.is_boundary_vertex[vertices.order], self.is_boundary_edge[edges.order]
        parts = []
        for v, f, e in zip(vertices.slices(), faces.slices(), edges.slices(), strict=True):
            part = TriangleMesh(positions[v], corners[f])
            # Computed once for all parts, this takes a tenth of the time with small ones.
            part.__dict__.update(
                _pairing=(pairs[e], edge_of[f].reshape(-1), sides[e]),
                is_boundary_edge=is_outer[e],
                is_boundary_vertex=on_boundary[v],
            )
            parts.append((part, vertices.order[v], faces.order[f]))
        return parts


@dataclass(frozen=True, eq=False)
class _Sorted:
    """Items sorted by the component that they are in.

    Attributes:
        order: (k,) the items, ascending within each component.
        number: (k,) the place of each item in its component.
        starts: (c + 1,) the first place of each component in the order.
    """

    order: IntArray
    number: IntArray
    starts: IntArray

    @classmethod
    def by(cls, component: IntArray, count: int) -> _Sorted:
        order = np.argsort(component, kind="stable")
        sizes = np.bincount(component, minlength=count)
        starts = np.concatenate([[0], np.cumsum(sizes)])
        number = np.empty(len(order), dtype=np.int64)
        number[order] = np.arange(len(order)) - np.repeat(starts[:-1], sizes)
        return cls(order, number, starts)

    def slices(self) -> list[slice]:
        """Return the places of each component in the order."""
        starts = self.starts.tolist()
        return [slice(begin, end) for begin, end in pairwise(starts)]


def joined_meshes(meshes: Sequence[TriangleMesh]) -> TriangleMesh:
    """Return the union of meshes, with vertices and faces in their order; a single mesh is returned itself."""
    if len(meshes) == 1:
        return meshes[0]
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return TriangleMesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def are_among(pairs: IntArray, edges: IntArray) -> BoolArray:
    """Return (k,) whether unordered pairs of vertices (k, 2), such as edges, are among edges (j, 2)."""
    unit = 1 + max(int(pairs.max(initial=0)), int(edges.max(initial=0)))
    keys, edge_keys = (np.sort(ends, axis=1) @ [unit, 1] for ends in (pairs, edges))
    return np.isin(keys, edge_keys)


def nearby(faces: IntArray, seeds: BoolArray, rings: int) -> BoolArray:
    """Return (n,) True for the vertices of seed triangles (m,) and of `rings` rings of triangles around them."""
    inside = mask_of(int(faces.max()) + 1, faces[seeds])
    for _ in range(rings):
        inside[faces[has_any(inside, faces)]] = True
    return inside


def corner_fans(faces: IntArray, halfedges: IntArray, partners: IntArray) -> tuple[int, IntArray]:
    """Return the number of fans, and (m, 3) the fan of each corner; corners joined across half-edges share a fan.

    Args:
        faces: (m, 3) vertex indices.
        halfedges, partners: (k,) half-edges glued to each other, on the same pair of vertices.

    Returns:
        The number of fans (classes of joined corners) and the fan of each corner (m, 3). If all interior edges are
        glued, a vertex of a manifold has one fan. If seams are not glued, the fans are the vertices of the cut mesh.
    """
    count, labels = label_fans(faces.ravel(), *map(np.ascontiguousarray, (halfedges, partners)))
    return int(count), labels.reshape(faces.shape)


def split_vertices(
    faces: IntArray, count: int, halfedges: IntArray, partners: IntArray
) -> tuple[IntArray, IntArray]:
    """Return the vertex of each fan, ascending, and (m, 3) the fan of each corner.

    The fans of a vertex are in the order of their first corners.

    Args:
        faces: (m, 3) vertex indices.
        count: number of vertices.
        halfedges, partners: (k,) half-edges glued to each other, on the same pair of vertices.
    """
    fans, fan = corner_fans(faces, halfedges, partners)
    origin = np.empty(fans, dtype=np.int64)
    origin[fan] = faces
    order = sort_by_counting(origin, count)
    rank = np.empty(fans, dtype=np.int64)
    rank[order] = np.arange(fans)
    return origin[order], rank[fan]


def end_corners(halfedges: IntArray) -> tuple[IntArray, IntArray]:
    """Return the start and end corners of half-edges, as indices into `faces.ravel()`.

    Args:
        halfedges: (k,) half-edges 3 f + i, opposite corner i of face f.
    """
    corner = halfedges % 3
    base = halfedges - corner
    return base + NEXT[corner], base + PREVIOUS[corner]


@compiled
def measure_sides(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return (m, 3) side lengths, each opposite a corner; both sides of an edge get the same bits."""
    lengths = np.empty(faces.shape)
    for f in range(len(faces)):
        for i in range(3):
            tail, head = faces[f, (i + 1) % 3], faces[f, (i + 2) % 3]
            square = 0.0
            for x in range(vertices.shape[1]):
                side = vertices[head, x] - vertices[tail, x]
                square += side * side
            lengths[f, i] = math.sqrt(square)
    return lengths
