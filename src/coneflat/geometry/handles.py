"""Loops along the handles and around the holes of a connected mesh, and the holonomy along them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix

from ..base.arrays import FloatArray, IntArray, mask_of
from ..linalg.shortest_paths import MultiGraph, Paths
from ..mesh.connectivity import TriangleMesh
from ..mesh.ties import tie_key
from .intrinsic import halfedge_twins
from .straight import FlatTriangles
from .triangles import cotangents


def handle_loops(mesh: TriangleMesh, holes: bool = False) -> list[IntArray]:
    """Return 2 genus closed strips of triangles that generate the loops along the handles of a mesh.

    Each strip is given by the half-edges that it crosses, in order: it leaves the triangle of a half-edge and enters
    the triangle of its twin, which is that of the next half-edge. A tree of shortest paths between triangles and a
    tree of edges that these do not cross leave 2 genus edges (tree-cotree, D. Eppstein 2003); each closes a loop.

    Args:
        mesh: connected.
        holes: add loops around all boundary loops but one, so that every closed strip is a sum of these loops and of
            loops around inner vertices.

    Returns:
        For each loop, (k,) the half-edges that it crosses.
    """
    if not mesh.genus() and not (holes and mesh.boundary_loops[0] > 1):
        return []
    inside = np.flatnonzero(~mesh.is_boundary_edge)
    across = mesh.edge_halfedges[inside]
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    pairs = across // 3
    steps = middles[pairs[:, 0]] - middles[pairs[:, 1]]
    dual = MultiGraph(len(mesh.faces), pairs, np.linalg.norm(steps, axis=1))
    root = int(np.argmax(tie_key(mesh.vertices)[mesh.faces].sum(axis=1)))
    paths = dual.shortest_paths(np.array([root]))
    in_tree = mask_of(len(inside), paths.edge[paths.edge >= 0])

    node_of = _contract_loops(mesh, holes)
    left = np.flatnonzero(~in_tree)
    primal = MultiGraph(len(node_of), node_of[mesh.edges[inside[left]]], np.ones(len(left)))
    closes = ~mask_of(len(left), primal.minimum_spanning_tree())
    return [_loop(paths, across, edge) for edge in left[closes]]


def _contract_loops(mesh: TriangleMesh, together: bool) -> IntArray:
    """Return (n,) a node for each vertex: on a boundary loop its first vertex, or that of all if `together`."""
    count, loop = mesh.boundary_loops
    if together:
        loop = np.minimum(loop, 0)
    node_of = np.arange(len(mesh.vertices))
    on_loop = np.flatnonzero(loop >= 0)
    representative = np.full(count, len(mesh.vertices))
    np.minimum.at(representative, loop[on_loop], on_loop)
    node_of[on_loop] = representative[loop[on_loop]]
    return node_of


def _loop(paths: Paths, across: IntArray, edge: int) -> IntArray:
    """Return (k,) the half-edges crossed by the loop that goes over an edge and returns through the tree."""
    outward, homeward = (
        [*paths.nodes_to(face), paths.source[face[0]]] for face in across[edge][:, None] // 3
    )
    # The common part of both paths to the root is removed.
    while len(outward) > 1 and len(homeward) > 1 and outward[-2] == homeward[-2]:
        outward.pop(), homeward.pop()
    out, home = np.array(outward[::-1]), np.array(homeward)
    pairs = across[np.concatenate([paths.edge[out[1:]], [edge], paths.edge[home[:-1]]])]
    faces = np.concatenate([out, home[:-1]])
    return np.where(pairs[:, 0] // 3 == faces, pairs[:, 0], pairs[:, 1])


def corner_signs(loop: IntArray, twin: IntArray) -> tuple[IntArray, FloatArray]:
    """Return (k,) the corner that a loop passes in each triangle, and (k,) +1 if it is on the left, -1 on the right.

    The rotation along a loop is the sum of the angles at these corners, with these signs.

    Args:
        loop: (k,) half-edges that the loop crosses.
        twin: (3m,) the half-edge on the other side of each half-edge.
    """
    entry, leave = twin[np.roll(loop, 1)] % 3, loop % 3
    return loop - leave + (3 - entry - leave), np.where(entry == (leave + 1) % 3, 1.0, -1.0)


def difference_from_multiple(angles: FloatArray, quantum: float) -> FloatArray:
    """Return the signed difference of angles from the nearest multiple of a quantum, radians."""
    return angles - quantum * np.round(angles / quantum)


@dataclass(frozen=True, eq=False)
class Holonomy:
    """The holonomy of loops along the handles of a connected mesh, and around its holes: the rotation along each loop.

    Attributes:
        mesh: the mesh.
        loops: the half-edges that each of the l loops crosses: two loops for each handle, and one for each hole.
        signs: (l, 3m) signs of the corner angles in the sum.
    """

    mesh: TriangleMesh
    loops: list[IntArray]
    signs: csr_matrix

    def of_flat(self, flat: FlatTriangles) -> FloatArray:
        """Return (l,) the rotation angles in a flat metric, radians, up to full turns."""
        return np.array([np.angle(np.prod(flat.turns[loop])) for loop in self.loops])

    def by_log_lengths(self, lengths: FloatArray) -> csr_matrix:
        """Return (l, e) the derivative of the angles by the logs of edge lengths, at side lengths (m, 3)."""
        return csr_matrix(self.signs @ _angles_by_log_lengths(self.mesh, lengths))

    def by_log_scale(self, lengths: FloatArray) -> FloatArray:
        """Return (l, n) the derivative of the angles by the log conformal factors, at side lengths (m, 3)."""
        return np.asarray((self.by_log_lengths(lengths) @ edge_means(self.mesh)).todense())


def loop_holonomy(mesh: TriangleMesh, holes: bool = False) -> Holonomy:
    """Return the holonomy of the loops along the handles of a mesh, and around its holes if `holes`."""
    loops = handle_loops(mesh, holes)
    twin = halfedge_twins(mesh)
    parts = [corner_signs(loop, twin) for loop in loops]
    rows = np.repeat(np.arange(len(loops)), [len(loop) for loop in loops])
    columns = np.concatenate([part[0] for part in parts] or [np.empty(0, dtype=np.int64)])
    values = np.concatenate([part[1] for part in parts] or [np.empty(0)])
    return Holonomy(mesh, loops, csr_matrix((values, (rows, columns)), shape=(len(loops), len(twin))))


def edge_means(mesh: TriangleMesh) -> csr_matrix:
    """Return (e, n) the matrix of the means of the two end values of edges: from log conformal factor to log length."""
    count = len(mesh.edges)
    rows = np.repeat(np.arange(count), 2)
    return csr_matrix(
        (np.full(2 * count, 0.5), (rows, mesh.edges.ravel())), shape=(count, len(mesh.vertices))
    )


def curvature_by_log_lengths(mesh: TriangleMesh, lengths: FloatArray) -> csr_matrix:
    """Return (n, e) the derivative of the angle defects by the logs of edge lengths, at side lengths (m, 3)."""
    corners = np.arange(3 * len(mesh.faces))
    at = csr_matrix(
        (np.full(len(corners), -1.0), (mesh.faces.ravel(), corners)), (len(mesh.vertices), len(corners))
    )
    return csr_matrix(at @ _angles_by_log_lengths(mesh, lengths))


def _angles_by_log_lengths(mesh: TriangleMesh, lengths: FloatArray) -> csc_matrix:
    """Return (3m, e) the derivative of corner angles by the logs of edge lengths.

    It is cot b + cot c for the opposite side, and minus a cotangent for each of the other sides.
    """
    cots = np.clip(cotangents(lengths), -1e150, 1e150)  # finite also for triangles without area
    edges = mesh.halfedge_edges.reshape(-1, 3)
    corners = np.arange(3 * len(mesh.faces)).reshape(-1, 3)
    rows, columns, values = [], [], []
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        rows += [corners[:, i]] * 3
        columns += [edges[:, i], edges[:, j], edges[:, k]]
        values += [cots[:, j] + cots[:, k], -cots[:, k], -cots[:, j]]
    shape = (3 * len(mesh.faces), len(mesh.edges))
    return csc_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape)
