"""Triangle meshes and their connectivity.

Half-edge `h = 3 * f + i` is the side of face `f` opposite its corner `i`: it runs from corner `i + 1` to
corner `i + 2` (mod 3). So everything that belongs to a side (length, cotangent, twin) has the index of
the corner it lies opposite to.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.compiled import compiled
from ..base.sets import edges_at_nodes, label_nodes

NEXT = np.array([1, 2, 0])
PREVIOUS = np.array([2, 0, 1])
# What is kept with a mesh and depends on its faces alone.
CONNECTIVITY = ("_pairing", "tails", "heads", "is_boundary_edge", "is_boundary_vertex", "edges_beside")


def label_components(count: int, tails: IntArray, heads: IntArray) -> tuple[int, IntArray]:
    """Return the number of connected components of a graph and the component of each of its nodes."""
    number, labels = label_nodes(
        count, *(np.ascontiguousarray(ends, dtype=np.int64) for ends in (tails, heads))
    )
    return int(number), labels


def label_faces(faces: IntArray, count: int) -> tuple[int, IntArray]:
    """Return how many sets of points hang together, and (m,) the set of each triangle: the charts, in the plane.

    Args:
        faces: (m, 3) indices of points.
        count: of all points; those of no triangle are sets of their own.
    """
    number, labels = label_components(count, faces[:, :2].reshape(-1), np.repeat(faces[:, 2], 2))
    return number, labels[faces[:, 0]]


def sort_by_counting(keys: IntArray, bound: int) -> IntArray:
    """Return the stable order of integers from 0 up to a bound, in linear time."""
    # To turn rows into columns, SciPy counts.
    count = len(keys)
    rows = csr_matrix((np.empty(count, dtype=np.int8), keys, np.arange(count + 1)), shape=(count, bound))
    order: IntArray = rows.tocsc().indices
    return order


def sort_pairs(one: IntArray, two: IntArray, bound: int) -> tuple[IntArray, BoolArray]:
    """Return the stable order of unordered pairs, by the smaller index first, and where in it each pair comes first."""
    low, high = np.minimum(one, two), np.maximum(one, two)
    order: IntArray = np.argsort(low * np.int64(bound) + high, kind="stable")
    first = np.ones(len(order), dtype=bool)
    first[1:] = (np.diff(low[order]) != 0) | (np.diff(high[order]) != 0)
    return order, first


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A manifold, consistently oriented triangle mesh without isolated vertices.

    The arrays are kept as they are, without a copy, and nothing is checked: neither their types and shapes nor that
    the mesh is a manifold. `coneflat.check_mesh` makes one out of arbitrary arrays, or says why it cannot.

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
        pairs, edge_of, sides, _ = pair_sides(self.faces, len(self.vertices))
        return pairs, edge_of, sides

    def moved_to(self, vertices: FloatArray) -> TriangleMesh:
        """Return the mesh with its vertices elsewhere, (n, 3); edges that have been found need not be found again."""
        moved, known = TriangleMesh(vertices, self.faces), self.__dict__
        moved.__dict__.update({name: known[name] for name in CONNECTIVITY if name in known})
        return moved

    @cached_property
    def tails(self) -> IntArray:
        """(3m,) vertex that each half-edge starts from."""
        return _permuted(self.faces, NEXT)

    @cached_property
    def heads(self) -> IntArray:
        """(3m,) vertex that each half-edge ends at."""
        return _permuted(self.faces, PREVIOUS)

    def ends_of(self, halfedges: IntArray) -> tuple[IntArray, IntArray]:
        """Return the vertices that some half-edges start from and end at; those of all need not be listed for it."""
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
        """(e, 2) the faces beside each edge; the second is -1 on the boundary."""
        return self.edge_halfedges // 3  # -1 stays -1

    @cached_property
    def is_boundary_edge(self) -> BoolArray:
        """(e,) True for edges with one face."""
        return self.edge_halfedges[:, 1] < 0

    @cached_property
    def is_boundary_vertex(self) -> BoolArray:
        """(n,) True for vertices on a boundary loop."""
        mask = np.zeros(len(self.vertices), dtype=bool)
        mask[self.edges[self.is_boundary_edge]] = True
        return mask

    @cached_property
    def edges_beside(self) -> tuple[IntArray, IntArray]:
        """Where the edges at each vertex begin, (n + 1,), and these edges, (2e,)."""
        return edges_at_nodes(self.edges, len(self.vertices))

    @cached_property
    def boundary_loops(self) -> tuple[int, IntArray]:
        """The number of boundary loops, and the loop of each vertex (n,), -1 inside."""
        on_boundary = np.flatnonzero(self.is_boundary_vertex)
        local = np.full(len(self.vertices), -1, dtype=np.int64)
        local[on_boundary] = np.arange(len(on_boundary))
        sides = local[self.edges[self.is_boundary_edge]]
        count, labels = label_components(len(on_boundary), sides[:, 0], sides[:, 1])
        local[on_boundary] = labels
        return count, local

    def boundary_walk(self) -> IntArray:
        """Return (b,) the half-edges of the one boundary loop in order, with the mesh to the left."""
        sides = self.edge_halfedges[self.is_boundary_edge, 0]
        leaving = np.empty(len(self.vertices), dtype=np.int64)
        tails, heads = self.ends_of(sides)
        leaving[tails] = np.arange(len(sides))
        after = leaving[heads].tolist()
        order = [0]
        while (following := after[order[-1]]) != 0:
            order.append(following)
        return sides[order]

    @cached_property
    def components(self) -> tuple[int, IntArray]:
        """The number of connected components, and the component of each vertex (n,)."""
        return label_components(len(self.vertices), self.edges[:, 0], self.edges[:, 1])

    @property
    def euler_characteristic(self) -> int:
        """Vertices minus edges plus faces."""
        return len(self.vertices) - len(self.edges) + len(self.faces)

    def genus(self) -> int:
        """The number of handles of a connected mesh."""
        return (2 - self.euler_characteristic - self.boundary_loops[0]) // 2

    def split_components(self) -> list[tuple[TriangleMesh, IntArray, IntArray]]:
        """Return each component as a mesh of its own, with its vertex and face indices in this mesh."""
        count, labels = self.components
        if count == 1:
            return [(self, np.arange(len(self.vertices)), np.arange(len(self.faces)))]
        face_order = np.argsort(labels[self.faces[:, 0]], kind="stable")
        vertex_order = np.argsort(labels, kind="stable")
        face_cuts = np.cumsum(np.bincount(labels[self.faces[:, 0]], minlength=count))[:-1]
        vertex_cuts = np.cumsum(np.bincount(labels, minlength=count))[:-1]
        local = np.empty(len(labels), dtype=np.int64)
        parts = []
        for vertices, faces in zip(
            np.split(vertex_order, vertex_cuts), np.split(face_order, face_cuts), strict=True
        ):
            local[vertices] = np.arange(len(vertices))
            parts.append((TriangleMesh(self.vertices[vertices], local[self.faces[faces]]), vertices, faces))
        return parts


def _permuted(faces: IntArray, columns: IntArray) -> IntArray:
    """Return (3m,) other columns (3,) of faces (m, 3), one by one: NumPy is slow at picking several."""
    permuted = np.empty(faces.shape, dtype=np.int64)
    for i, column in enumerate(columns):
        permuted[:, i] = faces[:, column]
    return permuted.ravel()


def corner_fans(faces: IntArray, one: IntArray, two: IntArray) -> tuple[int, IntArray]:
    """Join the corners that meet across pairs of half-edges.

    Args:
        faces: (m, 3) vertex indices.
        one, two: (k,) half-edges glued to each other, on the same pair of vertices.

    Returns:
        The number of fans (classes of joined corners) and the fan of each corner (m, 3). Gluing along all
        interior edges, a vertex of a manifold has one fan; leaving seams unglued, the fans are the
        vertices of the cut mesh.
    """
    flat = faces.ravel()
    # A half-edge's end corners, ordered so that both sides name the same vertex first.
    start_one, end_one = end_corners(one)
    start_two, end_two = end_corners(two)
    opposed = flat[start_one] == flat[end_two]
    start_two, end_two = np.where(opposed, end_two, start_two), np.where(opposed, start_two, end_two)
    count, labels = label_components(
        faces.size, np.concatenate([start_one, end_one]), np.concatenate([start_two, end_two])
    )
    return count, labels.reshape(faces.shape)


def end_corners(halfedges: IntArray) -> tuple[IntArray, IntArray]:
    """Return the corners, numbered along `faces.ravel()`, that half-edges start from and end at."""
    corner = halfedges % 3
    base = halfedges - corner
    return base + NEXT[corner], base + PREVIOUS[corner]


# Sides of so many edges from one vertex are sorted by insertion, more by merging: quicksort takes n^2 around a hub.
MAX_INSERTION_SORT = 64


@compiled
def pair_sides(faces: IntArray, count: int) -> tuple[IntArray, IntArray, IntArray, bool]:
    """Return the edges between `count` vertices, in the order of their ends, and the half-edges of each.

    Returns:
        (e, 2) the ends, the smaller index first; (3m,) the edge of each half-edge; (e, 2) the half-edges of each edge,
        the second -1 if there is one alone; and whether all edges have one half-edge, or two that run opposite ways.
    """
    size, bits = 3 * len(faces), 1
    while 2**bits < size:
        bits += 1
    starts = np.zeros(count + 1, dtype=np.int64)
    for f in range(len(faces)):
        for i in range(3):
            starts[min(faces[f, i], faces[f, (i + 1) % 3]) + 1] += 1
    for v in range(count):
        starts[v + 1] += starts[v]
    place = starts[:-1].copy()
    # Of each half-edge from or to a vertex of larger index: that, and the half-edge itself.
    keys = np.empty(size, dtype=np.int64)
    for f in range(len(faces)):
        for i in range(3):
            tail, head = faces[f, (i + 1) % 3], faces[f, (i + 2) % 3]
            low = min(tail, head)
            keys[place[low]] = (max(tail, head) << bits) | (3 * f + i)
            place[low] += 1
    edges = 0
    for v in range(count):
        sort_keys(keys[starts[v] : starts[v + 1]])
        last = -1
        for at in range(starts[v], starts[v + 1]):
            edges += keys[at] >> bits != last
            last = keys[at] >> bits
    pairs, sides = np.empty((edges, 2), dtype=np.int64), np.empty((edges, 2), dtype=np.int64)
    edge_of, is_plain, edge = np.empty(size, dtype=np.int64), True, -1
    for v in range(count):
        last = -1
        for at in range(starts[v], starts[v + 1]):
            high, h = keys[at] >> bits, keys[at] & (2**bits - 1)
            if high != last:
                edge, last = edge + 1, high
                pairs[edge, 0], pairs[edge, 1] = v, high
                sides[edge, 0], sides[edge, 1] = h, -1
            else:
                first = sides[edge, 0]
                is_opposed = faces[first // 3, (first + 1) % 3] != faces[h // 3, (h + 1) % 3]
                is_plain = is_plain and is_opposed and sides[edge, 1] < 0
                sides[edge, 1] = h
            edge_of[h] = edge
    return pairs, edge_of, sides, is_plain


@compiled
def sort_keys(keys: IntArray) -> None:
    """Sort different numbers, mostly few, in place."""
    if len(keys) > MAX_INSERTION_SORT:
        keys[:] = keys[np.argsort(keys, kind="mergesort")]
        return
    for at in range(1, len(keys)):
        key, before = keys[at], at - 1
        while before >= 0 and keys[before] > key:
            keys[before + 1] = keys[before]
            before -= 1
        keys[before + 1] = key


@compiled
def has_one_fan_each(faces: IntArray, count: int, edge_of: IntArray, sides: IntArray) -> bool:
    """Return whether the faces at each of `count` vertices follow one another across edges, and there are some.

    Args:
        faces: (m, 3), oriented alike.
        count: number of vertices.
        edge_of, sides: (3m,) the edge of each half-edge, and (e, 2) the half-edges of each edge, one or two.
    """
    valence, corner = np.zeros(count, dtype=np.int64), np.full(count, -1)
    for c in range(3 * len(faces)):
        vertex = faces[c // 3, c % 3]
        valence[vertex] += 1
        corner[vertex] = c
    for vertex in range(count):
        if corner[vertex] < 0:
            return False
        seen = 0
        # Around it one way, and from where that ends at a border, the other way.
        for turn in (1, 2):
            here = corner[vertex]
            while here >= 0:
                seen += 1
                h = here - here % 3 + (here % 3 + turn) % 3
                pair = sides[edge_of[h]]
                other = pair[1] if pair[0] == h else pair[0]
                here = -1 if other < 0 else other - other % 3 + (other % 3 + turn) % 3
                if here == corner[vertex]:
                    break
            if here == corner[vertex]:
                break
            seen -= turn == 1  # the corner begun at counts once
        if seen != valence[vertex]:
            return False
    return True


@compiled
def measure_sides(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return (m, 3) the lengths of sides, each opposite a corner; the same bits from both ends."""
    lengths = np.empty(faces.shape)
    for f in range(len(faces)):
        for i in range(3):
            one, two = faces[f, (i + 1) % 3], faces[f, (i + 2) % 3]
            square = 0.0
            for x in range(vertices.shape[1]):
                side = vertices[two, x] - vertices[one, x]
                square += side * side
            lengths[f, i] = math.sqrt(square)
    return lengths
