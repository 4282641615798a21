"""Sharp edges of a surface, their chains, and mesh refinement for them."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from ..base import BoolArray, FloatArray, IntArray, mask_of
from ..geometry import dihedral_angles
from ..mesh import label_components, tie_key
from ..mesh.connectivity import TriangleMesh


def sharp_edges(mesh: TriangleMesh, angle: float) -> IntArray:
    """Return the inner edges with a dihedral angle above a bound, radians."""
    return np.flatnonzero(np.abs(dihedral_angles(mesh)) > angle)


def lengths_along(mesh: TriangleMesh, edges: IntArray) -> FloatArray:
    """Return (k,) the lengths of edges."""
    return np.linalg.norm(np.diff(mesh.vertices[mesh.edges[edges]], axis=1)[:, 0], axis=1)


def vertex_graph(mesh: TriangleMesh) -> csr_matrix:
    """Return (n, n) the lengths of edges."""
    tails, heads = mesh.edges.T
    ends = np.concatenate([tails, heads]), np.concatenate([heads, tails])
    lengths = lengths_along(mesh, np.arange(len(mesh.edges)))
    return csr_matrix((np.tile(lengths, 2), ends), shape=(len(mesh.vertices),) * 2)


def without_stubs(mesh: TriangleMesh, edges: IntArray, shortest: float) -> IntArray:
    """Return the indices of the edges (k,) that remain after stubs are removed.

    A stub is a chain with a free end and fewer than two edges, or shorter than `least`.
    """
    remaining = np.arange(len(edges))
    lengths = lengths_along(mesh, edges)
    while True:
        chain, ends = feature_chains(mesh, edges[remaining])
        count = int(chain.max(initial=-1)) + 1
        is_stub = mask_of(count, chain[(ends == 1).any(axis=1)])
        is_stub &= (np.bincount(chain, minlength=count) < 2) | (
            np.bincount(chain, lengths[remaining], count) < shortest
        )
        if not is_stub.any():
            return remaining
        remaining = remaining[~is_stub[chain]]


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


def split_chords(mesh: TriangleMesh, ends: IntArray | None = None) -> tuple[TriangleMesh, int]:
    """Return a mesh without inner edges between two boundary vertices, by splitting them, and their number.

    Straight sides of a boundary would degenerate the triangles at such edges. The same holds for features, given by
    their two vertices (k, 2).
    """
    mesh = without_pillows(mesh)
    is_fixed = mesh.is_boundary_edge.copy()
    if ends is not None:
        is_fixed[edge_indices(mesh, ends)] = True
    on = mask_of(len(mesh.vertices), mesh.edges[is_fixed])
    chords = on[mesh.edges].all(axis=1) & ~is_fixed
    return split_edges(mesh, chords)[0], int(chords.sum())


def split_around(mesh: TriangleMesh, vertices: IntArray) -> TriangleMesh:
    """Return a mesh with the edges of triangles at some vertices split at their midpoints."""
    mesh = without_pillows(mesh)
    is_around = mask_of(len(mesh.vertices), vertices)[mesh.faces].any(axis=1)
    return split_edges(mesh, mask_of(len(mesh.edges), mesh.halfedge_edges.reshape(-1, 3)[is_around]))[0]


def edge_indices(mesh: TriangleMesh, pairs: IntArray) -> IntArray:
    """Return (k,) the indices of the edges between pairs of vertices (k, 2)."""
    n = len(mesh.vertices)
    keys = mesh.edges[:, 0] * n + mesh.edges[:, 1]
    low, high = pairs.min(axis=1, initial=n), pairs.max(axis=1, initial=0)
    order = np.argsort(keys)
    return order[np.searchsorted(keys[order], low * n + high)]


def without_pillows(mesh: TriangleMesh) -> TriangleMesh:
    """Return a mesh in which faces with the same three vertices are split at their centroids.

    Splitting an edge of two such faces would join the new vertex and the third one by two edges.
    """
    vertices, faces = mesh.vertices, mesh.faces
    _, which, count = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True)
    paired = count[which.ravel()] > 1
    corners = faces[paired]
    middle = len(vertices) + np.arange(len(corners))
    fans = [np.column_stack([corners[:, [i, (i + 1) % 3]], middle]) for i in range(3)]
    points = np.concatenate([vertices, vertices[corners].mean(axis=1)])
    return TriangleMesh(points, np.concatenate([faces[~paired], *fans]))


def split_edges(mesh: TriangleMesh, marked: BoolArray) -> tuple[TriangleMesh, IntArray]:
    """Return a mesh with marked edges (e,) split at their midpoints, and (t,) the triangle here of each of its own.

    The choice among edges of equal length does not depend on the numbering.
    """
    lengths = lengths_along(mesh, np.arange(len(mesh.edges)))
    key = tie_key(mesh.vertices)[mesh.edges].sum(axis=1)
    rounded = np.round(lengths / lengths.max(initial=1e-300), 9)
    rank = np.argsort(np.lexsort((key, rounded)))
    return split_longest(mesh, marked, rank[mesh.halfedge_edges.reshape(-1, 3)])[:2]


def split_longest(
    mesh: TriangleMesh, marked: BoolArray, lengths: FloatArray | IntArray
) -> tuple[TriangleMesh, IntArray, IntArray]:
    """Return a mesh with marked edges (e,) split at their midpoints, the longest one of each triangle first.

    And (t,) the triangle of each piece into which triangles are divided, and (t, 3) its corners: 0 to 2 are those of
    the triangle, and 3 + i is the midpoint of the side opposite corner i.

    lengths: (m, 3) at least 0, the lengths of sides or their ranks.
    """
    middle = np.full(len(marked), -1)
    middle[marked] = len(mesh.vertices) + np.arange(int(marked.sum()))
    points = np.concatenate([mesh.vertices, mesh.vertices[mesh.edges[marked]].mean(axis=1)])
    sides = mesh.halfedge_edges.reshape(-1, 3)
    is_split = marked[sides]
    first = np.argmax(np.where(is_split, lengths, -1), axis=1)
    turn = (first[:, None] + np.arange(3)) % 3
    six = np.concatenate([turn, 3 + turn], axis=1)
    splits_first, splits_second, splits_third = np.take_along_axis(is_split, turn, axis=1).T
    pieces = (
        (~splits_first, (0, 1, 2)),
        (splits_first & ~splits_third, (0, 1, 3)),
        (splits_first & splits_third, (0, 5, 3)),
        (splits_first & splits_third, (5, 1, 3)),
        (splits_first & ~splits_second, (0, 3, 2)),
        (splits_first & splits_second, (0, 3, 4)),
        (splits_first & splits_second, (4, 3, 2)),
    )
    origin = np.concatenate([np.flatnonzero(chosen) for chosen, _ in pieces])
    piece = np.concatenate([six[chosen][:, corners] for chosen, corners in pieces])
    corners = np.concatenate([mesh.faces, middle[sides]], axis=1)[origin]
    return TriangleMesh(points, np.take_along_axis(corners, piece, axis=1)), origin, piece
