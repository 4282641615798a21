"""Sharp edges of a surface, the patches between them, and mesh refinement for them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ... import TriangleMesh
from ...base import BoolArray, FloatArray, IntArray
from ...geometry import corner_angles, dihedral_angles, face_normals
from ...mesh import CutMesh, label_components, label_faces, open_along, tie_key


def sharp_edges(mesh: TriangleMesh, angle: float) -> IntArray:
    """Return the inner edges with a dihedral angle above a bound, radians."""
    return np.flatnonzero(np.abs(dihedral_angles(mesh)) > angle)


def lengths_along(mesh: TriangleMesh, edges: IntArray) -> FloatArray:
    """Return (k,) the lengths of edges."""
    return np.linalg.norm(np.diff(mesh.vertices[mesh.edges[edges]], axis=1)[:, 0], axis=1)


def without_stubs(mesh: TriangleMesh, edges: IntArray, least: float) -> IntArray:
    """Return the indices of the edges (k,) that remain after stubs are removed.

    A stub is a chain with a free end and fewer than two edges, or shorter than `least`.
    """
    kept = np.arange(len(edges))
    lengths = lengths_along(mesh, edges)
    while True:
        chain, ends = feature_chains(mesh, edges[kept])
        count = int(chain.max(initial=-1)) + 1
        is_stub = np.zeros(count, dtype=bool)
        is_stub[chain[(ends == 1).any(axis=1)]] = True
        is_stub &= (np.bincount(chain, minlength=count) < 2) | (
            np.bincount(chain, lengths[kept], count) < least
        )
        if not is_stub.any():
            return kept
        kept = kept[~is_stub[chain]]


def patches_of(mesh: TriangleMesh, edges: IntArray) -> tuple[int, IntArray]:
    """Return the number of patches into which edges divide a mesh, and (m,) the patch of each triangle."""
    glued = ~mesh.is_boundary_edge
    glued[edges] = False
    pairs = mesh.edge_faces[glued]
    return label_components(len(mesh.faces), pairs[:, 0], pairs[:, 1])


def dangling(mesh: TriangleMesh, edges: IntArray) -> IntArray:
    """Return the indices of the edges (k,) that have the same patch on both sides."""
    _, patch = patches_of(mesh, edges)
    one, two = patch[mesh.edge_faces[edges]].T
    return np.flatnonzero(one == two)


def border_of(mesh: TriangleMesh, edges: IntArray, number: int) -> IntArray:
    """Return the indices of the edges (k,) on the longest chain between a patch and another patch.

    If there is no such chain, return the edges inside the patch; the result may be empty.
    """
    _, patch = patches_of(mesh, edges)
    one, two = patch[mesh.edge_faces[edges]].T
    adjacent = (one == number) | (two == number)
    border = np.flatnonzero(adjacent & (one != two))
    if not len(border):
        return np.flatnonzero(adjacent)
    chain, _ = feature_chains(mesh, edges)
    lengths = lengths_along(mesh, edges)
    longest = int(np.argmax(np.bincount(chain[border], lengths[border])))
    return border[chain[border] == longest]


def feature_chains(mesh: TriangleMesh, edges: IntArray) -> tuple[IntArray, IntArray]:
    """Return (k,) the chain of each edge, and (k, 2) the number of edges that meet at its ends.

    Chains end at vertices where the number of edges is not two. A boundary vertex counts as three further edges.
    """
    ends = mesh.edges[edges]
    degree = np.bincount(ends.ravel(), minlength=len(mesh.vertices)) + 3 * mesh.is_boundary_vertex
    inner = degree[ends.ravel()] == 2
    order = np.argsort(ends.ravel()[inner], kind="stable")
    pairs = np.arange(len(edges)).repeat(2)[inner][order].reshape(-1, 2)
    _, chain = label_components(len(edges), pairs[:, 0], pairs[:, 1])
    return chain, degree[ends]


@dataclass(frozen=True, eq=False)
class Opened:
    """A mesh cut open along its features.

    Attributes:
        mesh: the mesh.
        edges: (k,) the features, inner edges.
        cut: the mesh cut open along them, with the original vertex of each of its vertices.
        quarters: (c,) the target angle at each boundary vertex of the open mesh in quarter turns: at least one, two
            where it is straight; 0 inside.
    """

    mesh: TriangleMesh
    edges: IntArray
    cut: CutMesh
    quarters: IntArray

    @property
    def nodes(self) -> IntArray:
        """Vertices on features or the boundary that must lie on grid points: where these meet, end or turn."""
        border = np.flatnonzero(self.quarters > 0)
        turns = np.zeros(len(self.mesh.vertices), dtype=bool)
        turns[self.cut.origin[border[self.quarters[border] != 2]]] = True
        copies = np.bincount(self.cut.origin[border], minlength=len(turns))
        inside = ~self.mesh.is_boundary_vertex
        turns |= np.where(inside, (copies != 2) & (copies > 0), copies > 1)
        return np.flatnonzero(turns)

    @property
    def irregular(self) -> IntArray:
        """The inner nodes with an angle sum other than four quarter turns."""
        total = np.bincount(self.cut.origin, self.quarters, len(self.mesh.vertices)).astype(np.int64)
        return np.flatnonzero((total > 0) & (total != 4) & ~self.mesh.is_boundary_vertex)

    @property
    def is_feature(self) -> BoolArray:
        """(e,) whether each edge of the mesh is a feature."""
        mask = np.zeros(len(self.mesh.edges), dtype=bool)
        mask[self.edges] = True
        return mask


def opened(mesh: TriangleMesh, edges: IntArray, lengths: FloatArray) -> Opened:
    """Return a mesh cut open along edges (k,), with angles rounded to quarter turns; `lengths` has shape (m, 3)."""
    cut = open_along(mesh, edges)
    angles = corner_angles(lengths)
    sums = np.bincount(cut.mesh.faces.ravel(), angles.ravel(), len(cut.origin)) / (np.pi / 2)
    rounded = np.maximum(np.rint(sums), 1).astype(np.int64)
    # Corners of an octagon, with 1.5 quarter turns, count as straight independently of rounding errors.
    rounded[(rounded == 1) & (sums > 1.45)] = 2
    return Opened(mesh, edges, cut, np.where(cut.mesh.is_boundary_vertex, rounded, 0))


def split_for_features(
    vertices: FloatArray, faces: IntArray, features: IntArray, longest: float
) -> tuple[TriangleMesh, IntArray, IntArray]:
    """Return a finer mesh of the same surface, (f,) its feature edges, and (f,) the given feature that contains each.

    Edges are split until none is longer than `longest`, or than a quarter of the square root of the area of its patch,
    unless that takes far too many triangles.
    Edges that join two vertices on features or the boundary, without being such edges, are split too, because straight
    sides could degenerate their triangles. The longest edge of a triangle is always split first, so that angles do not
    become arbitrarily small.

    Args:
        vertices, faces: (n, 3), (m, 3) the mesh; its vertices remain the first ones.
        features: (k, 2) pairs of vertices.
        longest: largest edge length.

    References:
        M.-C. Rivara, "Algorithms for refining triangular grids suitable for adaptive and multigrid techniques", 1984.
    """
    mesh = TriangleMesh(*_without_pillows(vertices, faces))
    edges, origin = edge_indices(mesh, features), np.arange(len(features))
    for _ in range(30):  # each round halves edges
        marked = _too_long(mesh, edges, longest)
        # Needles become far more triangles than their area suggests, as they stay similar until the short sides are
        # short enough. A patch of two triangles needs about 100.
        if not marked.any() or len(mesh.faces) > 2**15 + 64 * len(faces):
            break
        mesh, edges, origin = _split(mesh, edges, origin, _with_longest_sides(mesh, marked))
    return _split(mesh, edges, origin, _chords(mesh, edges))


def split_faces(
    mesh: TriangleMesh, edges: IntArray, origin: IntArray, faces: IntArray
) -> tuple[TriangleMesh, IntArray, IntArray]:
    """Return a mesh with all sides of some faces split, its features (k,), and (k,) the origin of each."""
    marked = np.zeros(len(mesh.edges), dtype=bool)
    marked[mesh.halfedge_edges.reshape(-1, 3)[faces]] = True
    mesh, edges, origin = _split(mesh, edges, origin, _with_longest_sides(mesh, marked))
    return _split(mesh, edges, origin, _chords(mesh, edges))


def split_chords(mesh: TriangleMesh, ends: IntArray | None = None) -> tuple[TriangleMesh, int]:
    """Return a mesh without inner edges between two boundary vertices, by splitting them, and their number.

    Straight sides of a boundary would degenerate the triangles at such edges. The same holds for features, given by
    their two vertices (k, 2).
    """
    mesh, none = TriangleMesh(*_without_pillows(mesh.vertices, mesh.faces)), np.empty(0, dtype=np.int64)
    chords = _chords(mesh, none if ends is None else edge_indices(mesh, ends))
    return _split(mesh, none, none, chords)[0], int(chords.sum())


def split_all(mesh: TriangleMesh) -> tuple[TriangleMesh, int]:
    """Return a mesh with all edges split at their midpoints, and their number."""
    mesh, none = TriangleMesh(*_without_pillows(mesh.vertices, mesh.faces)), np.empty(0, dtype=np.int64)
    return _split(mesh, none, none, np.ones(len(mesh.edges), dtype=bool))[0], len(mesh.edges)


def split_small_components(mesh: TriangleMesh) -> tuple[TriangleMesh, int]:
    """Return a mesh with at least 60 triangles in each component, by splitting edges, and how many were smaller.

    On a sphere, a grid has at least eight cones.
    """
    mesh, none = TriangleMesh(*_without_pillows(mesh.vertices, mesh.faces)), np.empty(0, dtype=np.int64)
    small = 0
    while True:
        count, label = label_faces(mesh.faces, len(mesh.vertices))
        is_small = np.bincount(label, minlength=count) < 60
        small = small or int(is_small.sum())
        if not is_small.any():
            return mesh, small
        mesh, _, _ = _split(mesh, none, none, is_small[label[mesh.edge_faces[:, 0]]])


def edge_indices(mesh: TriangleMesh, pairs: IntArray) -> IntArray:
    """Return (k,) the indices of the edges between pairs of vertices (k, 2)."""
    n = len(mesh.vertices)
    keys = mesh.edges[:, 0] * n + mesh.edges[:, 1]
    low, high = pairs.min(axis=1, initial=n), pairs.max(axis=1, initial=0)
    order = np.argsort(keys)
    return order[np.searchsorted(keys[order], low * n + high)]


def _without_pillows(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Return a mesh in which faces with the same three vertices are split at their centroids.

    Splitting an edge of two such faces would join the new vertex and the third one by two edges.
    """
    _, which, count = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True)
    paired = count[which.ravel()] > 1
    corners = faces[paired]
    middle = len(vertices) + np.arange(len(corners))
    fans = [np.column_stack([corners[:, [i, (i + 1) % 3]], middle]) for i in range(3)]
    points = np.concatenate([vertices, vertices[corners].mean(axis=1)])
    return points, np.concatenate([faces[~paired], *fans])


def _too_long(mesh: TriangleMesh, edges: IntArray, longest: float) -> BoolArray:
    """Return (e,) whether each edge is longer than its patches allow."""
    count, patch = patches_of(mesh, edges)
    areas = np.linalg.norm(face_normals(mesh.vertices, mesh.faces), axis=1) / 2
    allowed = np.minimum(longest, np.sqrt(np.bincount(patch, areas, count)) / 4)[patch]
    lengths = lengths_along(mesh, np.arange(len(mesh.edges)))
    one, two = mesh.edge_faces.T
    return lengths > np.minimum(allowed[one], np.where(two < 0, np.inf, allowed[two]))


def _chords(mesh: TriangleMesh, edges: IntArray) -> BoolArray:
    """Return (e,) whether each edge joins two vertices on features or the boundary without being such an edge."""
    is_fixed = mesh.is_boundary_edge.copy()
    is_fixed[edges] = True
    on = np.zeros(len(mesh.vertices), dtype=bool)
    on[mesh.edges[is_fixed]] = True
    return on[mesh.edges].all(axis=1) & ~is_fixed


def _with_longest_sides(mesh: TriangleMesh, marked: BoolArray) -> BoolArray:
    """Return (e,) marks extended by the longest side of every triangle that has a marked side."""
    marked, longest = marked.copy(), _longest_sides(mesh, np.ones(len(marked), dtype=bool))
    sides = mesh.halfedge_edges.reshape(-1, 3)
    while True:
        more = longest[marked[sides].any(axis=1)]
        more = more[~marked[more]]
        if not len(more):
            return marked
        marked[more] = True


def _longest_sides(mesh: TriangleMesh, among: BoolArray) -> IntArray:
    """Return (m,) the longest edge of each triangle among the given edges (e,), if it has any.

    The choice among equal edges does not depend on the numbering.
    """
    lengths = lengths_along(mesh, np.arange(len(mesh.edges)))
    key = tie_key(mesh.vertices)[mesh.edges].sum(axis=1)
    rounded = np.round(lengths / lengths.max(initial=1e-300), 9)
    rank = np.empty(len(lengths), dtype=np.int64)
    rank[np.lexsort((key, rounded))] = np.arange(len(lengths))
    rank[~among] = -1
    sides = mesh.halfedge_edges.reshape(-1, 3)
    return sides[np.arange(len(sides)), np.argmax(rank[sides], axis=1)]


def _split(
    mesh: TriangleMesh, edges: IntArray, origin: IntArray, marked: BoolArray
) -> tuple[TriangleMesh, IntArray, IntArray]:
    """Return a mesh with marked edges split at their midpoints, its features (k,), and (k,) the origin of each."""
    n = len(mesh.vertices)
    middle = np.full(len(marked), -1)
    middle[marked] = n + np.arange(int(marked.sum()))
    points = np.concatenate([mesh.vertices, mesh.vertices[mesh.edges[marked]].mean(axis=1)])
    sides = mesh.halfedge_edges.reshape(-1, 3)
    first = np.argmax(sides == _longest_sides(mesh, marked)[:, None], axis=1)
    origin_face, corners = split_pieces(marked[sides], first)
    six = np.concatenate([mesh.faces, middle[sides]], axis=1)[origin_face]
    finer = TriangleMesh(points, np.take_along_axis(six, corners, axis=1))
    pairs, at = mesh.edges[edges], middle[edges]
    is_cut = at >= 0
    halves = [np.stack([pairs[is_cut, end], at[is_cut]], axis=1) for end in range(2)]
    features = edge_indices(finer, np.concatenate([pairs[~is_cut], *halves]))
    return finer, features, np.concatenate([origin[~is_cut], origin[is_cut], origin[is_cut]])


def split_pieces(is_split: BoolArray, first: IntArray) -> tuple[IntArray, IntArray]:
    """Return (t,) the triangle of each piece into which triangles are divided, and (t, 3) its corners.

    Corners 0 to 2 are those of the triangle, and 3 + i is the midpoint of the side opposite corner i.

    Args:
        is_split: (m, 3) whether each side is split.
        first: (m,) the side that is split first, if any is.
    """
    turn = (first[:, None] + np.arange(3)) % 3
    six = np.concatenate([turn, 3 + turn], axis=1)
    one, two, three = np.take_along_axis(is_split, turn, axis=1).T
    pieces = (
        (~one, (0, 1, 2)), (one & ~three, (0, 1, 3)), (one & three, (0, 5, 3)), (one & three, (5, 1, 3)),
        (one & ~two, (0, 3, 2)), (one & two, (0, 3, 4)), (one & two, (4, 3, 2)),
    )  # fmt: skip
    origin = np.concatenate([np.flatnonzero(chosen) for chosen, _ in pieces])
    return origin, np.concatenate([six[chosen][:, corners] for chosen, corners in pieces])
