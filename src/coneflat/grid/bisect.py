"""Triangles split at the middles of sides, the longest first, until edges are short and no patch is a chain of ears."""

from __future__ import annotations

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from ..geometry.ties import tie_key
from ..mesh import TriangleMesh
from .features import lengths_along, patches_of

# Rounds at most: each halves edges.
ROUNDS = 30
# Edges across a patch, about.
ACROSS = 4


def split_for_features(
    vertices: FloatArray, faces: IntArray, features: IntArray, longest: float
) -> tuple[TriangleMesh, IntArray, IntArray]:
    """Return a finer mesh of the same surface, its features as edges, and the one of those given that each is part of.

    Edges are split until none is longer than wanted, nor than a part of the patch between features that it lies in; and
    those that join vertices on features or the boundary without being such, so that straight sides leave every triangle
    room. Of triangles whose edges are too long the longest is always split before others (M.-C. Rivara, "Algorithms for
    refining triangular grids suitable for adaptive and multigrid techniques", 1984), so that angles do not become ever
    smaller.

    Args:
        vertices, faces: (n, 3), (m, 3) the mesh; its vertices remain the first ones.
        features: (k, 2) pairs of vertices.
        longest: what no edge is to exceed.
    """
    mesh = TriangleMesh(vertices, faces)
    edges, origin = edge_indices(mesh, features), np.arange(len(features))
    for _ in range(ROUNDS):
        marked = _too_long(mesh, edges, longest)
        if not marked.any():
            break
        mesh, edges, origin = _split(mesh, edges, origin, _closed(mesh, marked))
    return _split(mesh, edges, origin, _chords(mesh, edges))


def split_faces(
    mesh: TriangleMesh, edges: IntArray, origin: IntArray, faces: IntArray
) -> tuple[TriangleMesh, IntArray, IntArray]:
    """Return a mesh in which all sides of some faces are split, its features (k,) and the origin of each of these."""
    marked = np.zeros(len(mesh.edges), dtype=bool)
    marked[mesh.halfedge_edges.reshape(-1, 3)[faces]] = True
    mesh, edges, origin = _split(mesh, edges, origin, _closed(mesh, marked))
    return _split(mesh, edges, origin, _chords(mesh, edges))


def edge_indices(mesh: TriangleMesh, pairs: IntArray) -> IntArray:
    """Return (k,) the edges of pairs of vertices (k, 2)."""
    n = len(mesh.vertices)
    keys = mesh.edges[:, 0] * n + mesh.edges[:, 1]
    low, high = pairs.min(axis=1, initial=n), pairs.max(axis=1, initial=0)
    order = np.argsort(keys)
    found: IntArray = order[np.searchsorted(keys[order], low * n + high)]
    return found


def _too_long(mesh: TriangleMesh, edges: IntArray, longest: float) -> BoolArray:
    """Return (e,) the edges longer than what their patches allow."""
    count, patch = patches_of(mesh, edges)
    corners = mesh.vertices[mesh.faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    allowed = np.minimum(longest, np.sqrt(np.bincount(patch, areas, count)) / ACROSS)[patch]
    lengths = lengths_along(mesh, np.arange(len(mesh.edges)))
    one, two = mesh.edge_faces.T
    too_long: BoolArray = lengths > np.minimum(allowed[one], np.where(two < 0, np.inf, allowed[two]))
    return too_long


def _chords(mesh: TriangleMesh, edges: IntArray) -> BoolArray:
    """Return (e,) the edges that join vertices on features or the boundary and are none themselves."""
    is_fixed = mesh.is_boundary_edge.copy()
    is_fixed[edges] = True
    on = np.zeros(len(mesh.vertices), dtype=bool)
    on[mesh.edges[is_fixed]] = True
    return on[mesh.edges].all(axis=1) & ~is_fixed


def _closed(mesh: TriangleMesh, marked: BoolArray) -> BoolArray:
    """Return marks with the longest side of every triangle that has one."""
    marked, longest = marked.copy(), _longest_sides(mesh, np.ones(len(marked), dtype=bool))
    sides = mesh.halfedge_edges.reshape(-1, 3)
    while True:
        more = longest[marked[sides].any(axis=1)]
        more = more[~marked[more]]
        if not len(more):
            return marked
        marked[more] = True


def _longest_sides(mesh: TriangleMesh, among: BoolArray) -> IntArray:
    """Return (m,) the longest edge of each triangle among some (e,), if it has any.

    Of equal ones it is the same, whatever the numbering.
    """
    lengths = lengths_along(mesh, np.arange(len(mesh.edges)))
    key = tie_key(mesh.vertices)[mesh.edges].sum(axis=1)
    rounded = np.round(lengths / lengths.max(initial=1e-300), 9)
    rank = np.empty(len(lengths), dtype=np.int64)
    rank[np.lexsort((key, rounded))] = np.arange(len(lengths))
    rank[~among] = -1
    sides = mesh.halfedge_edges.reshape(-1, 3)
    longest: IntArray = sides[np.arange(len(sides)), np.argmax(rank[sides], axis=1)]
    return longest


def _split(
    mesh: TriangleMesh, edges: IntArray, origin: IntArray, marked: BoolArray
) -> tuple[TriangleMesh, IntArray, IntArray]:
    """Return a mesh with marked edges split in the middle, its features (k,) and the origin of each of these."""
    n = len(mesh.vertices)
    middle = np.full(len(marked), -1)
    middle[marked] = n + np.arange(int(marked.sum()))
    points = np.concatenate([mesh.vertices, mesh.vertices[mesh.edges[marked]].mean(axis=1)])
    sides = mesh.halfedge_edges.reshape(-1, 3)
    first = np.argmax(sides == _longest_sides(mesh, marked)[:, None], axis=1)
    turn = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(mesh.faces, turn, axis=1).T
    bc, ca, ab = middle[np.take_along_axis(sides, turn, axis=1)].T
    whole, on_ab, on_ca = bc < 0, ab >= 0, ca >= 0
    halved = ~whole

    def triangles(chosen: BoolArray, *corners: IntArray) -> IntArray:
        return np.stack([corner[chosen] for corner in corners], axis=1)

    parts = [
        triangles(whole, a, b, c),
        triangles(halved & ~on_ab, a, b, bc),
        triangles(halved & on_ab, a, ab, bc),
        triangles(halved & on_ab, ab, b, bc),
        triangles(halved & ~on_ca, a, bc, c),
        triangles(halved & on_ca, a, bc, ca),
        triangles(halved & on_ca, ca, bc, c),
    ]
    finer = TriangleMesh(points, np.concatenate(parts))
    pairs, at = mesh.edges[edges], middle[edges]
    is_cut = at >= 0
    halves = [np.stack([pairs[is_cut, end], at[is_cut]], axis=1) for end in range(2)]
    features = edge_indices(finer, np.concatenate([pairs[~is_cut], *halves]))
    return finer, features, np.concatenate([origin[~is_cut], origin[is_cut], origin[is_cut]])
