"""The seams of a layout as chains of edges; a rigid motion per chain maps one side onto the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from ..errors import SeamError
from ..mesh.charts import both_sides, point_seams
from ..mesh.connectivity import TriangleMesh, label_components
from .constraints import CheckedConstraints

# Largest change, in radians, of the rotation of a seam at a vertex that is not a cone. Cones have curvatures of at
# least 1e-4; the shortest edge lengths in the plane are accurate to 1e-9.
ROTATION_TOLERANCE = 1e-5
# Largest difference of the two lengths of a seam edge, relative to its length.
RIGID_TOLERANCE = 1e-4


@dataclass(frozen=True, eq=False)
class SeamChains:
    """The seams of a layout, as k edges in c chains.

    Attributes:
        edges: (k,) edge indices in the mesh.
        vertices: (k, 2) the two end vertices of each edge.
        left, right: (k, 2) the points at its ends on the left and on the right side.
        halfedges: (k, 2) the half-edges of the triangles on the left and on the right side.
        chain: (k,) the chain of each edge.
        rotation: (c,) unit complex numbers that rotate the left side of a chain parallel to the right side.
        is_node: (n,) True for vertices where chains end: cones, branch points, boundary vertices, and requested nodes.
    """

    edges: IntArray
    vertices: IntArray
    left: IntArray
    right: IntArray
    halfedges: IntArray
    chain: IntArray
    rotation: ComplexArray
    is_node: BoolArray


def find_chains(
    mesh: TriangleMesh,
    corners: IntArray,
    points: ComplexArray,
    nodes: IntArray,
) -> SeamChains:
    """Return the chains of the edges whose sides have different points.

    Args:
        mesh: the mesh.
        corners: (m, 3) the point at each triangle corner.
        points: (u,) positions in the plane as complex numbers.
        nodes: additional vertices at which chains end.

    Raises:
        SeamError: the sides of a seam are not rigid copies of each other.
    """
    edges = point_seams(mesh, corners)
    h, t = mesh.edge_halfedges[edges].T
    vertices = np.stack(mesh.ends_of(h), axis=1)
    sides = np.stack(both_sides(mesh, edges, corners))
    first_vectors, second_vectors = (points[side[:, 1]] - points[side[:, 0]] for side in sides)
    _check_rigid(edges, vertices, first_vectors, second_vectors)
    turns = second_vectors * np.conj(first_vectors)
    turns /= np.abs(turns)
    is_node = np.bincount(vertices.ravel(), minlength=len(mesh.vertices)) != 2
    is_node |= mesh.is_boundary_vertex
    is_node[nodes] = True
    is_node[_rotating(vertices, sides, turns, is_node)] = True
    first, second = _strands(vertices, sides, is_node)
    swapped = second < first
    left = np.where(swapped[:, None], sides[1], sides[0])
    right = np.where(swapped[:, None], sides[0], sides[1])
    halfedges = np.where(swapped[:, None], np.stack([t, h], axis=1), np.stack([h, t], axis=1))
    _, chain = np.unique(np.minimum(first, second), return_inverse=True)
    chain = chain.ravel()
    total = np.zeros(int(chain.max(initial=-1)) + 1, dtype=np.complex128)
    np.add.at(
        total,
        chain,
        np.where(swapped, second_vectors * np.conj(first_vectors), 0).conj()
        + np.where(swapped, 0, second_vectors * np.conj(first_vectors)),
    )
    return SeamChains(edges, vertices, left, right, halfedges, chain, total / np.abs(total), is_node)


def constrained_chains(
    mesh: TriangleMesh, corners: IntArray, points: ComplexArray, vertex: IntArray, c: CheckedConstraints
) -> SeamChains:
    """Return the seams, with nodes at constrained points.

    A point on a single line needs no node if it is a left point within a seam.
    """
    if not len(c.on_line):
        return find_chains(mesh, corners, points, vertex[c.pinned])
    on, times = np.unique(c.on_line, return_counts=True)
    nodes = np.concatenate([vertex[c.pinned], vertex[on[times > 1]]])
    chains = find_chains(mesh, corners, points, nodes)
    inside = ~chains.is_node[chains.vertices]
    if not np.isin(on, chains.right[inside]).any():
        return chains
    return find_chains(mesh, corners, points, np.concatenate([nodes, vertex[on]]))


def _strands(vertices: IntArray, sides: IntArray, is_node: BoolArray) -> tuple[IntArray, IntArray]:
    """Return (k,), (k,) the strands of each edge's first and second side: sides connected at vertices without node."""
    count = len(vertices)
    # First sides are numbered from 0, second sides from `count`.
    point = sides.reshape(-1, 2).ravel()
    side = np.arange(2 * count).repeat(2)
    regular = ~is_node[np.concatenate([vertices, vertices]).ravel()]
    point, side = point[regular], side[regular]
    order = np.argsort(point, kind="stable")
    point, side = point[order], side[order]
    meet = np.flatnonzero(point[1:] == point[:-1])
    _, label = label_components(2 * count, side[meet], side[meet + 1])
    return label[:count], label[count:]


def _rotating(vertices: IntArray, sides: IntArray, turns: ComplexArray, is_node: BoolArray) -> IntArray:
    """Return the vertices between two seam edges at which the rotation changes."""
    ends = vertices.ravel()
    edge = np.arange(len(vertices)).repeat(2)
    is_inner = ~is_node[ends]
    ends, edge, point = ends[is_inner], edge[is_inner], sides[0].ravel()[is_inner]
    order = np.argsort(ends, kind="stable").reshape(-1, 2)
    edge, point = edge[order], point[order]
    # The first sides of both edges are on the same side of the seam if they share a point.
    next_turns = np.where(point[:, 0] == point[:, 1], turns[edge[:, 1]], np.conj(turns[edge[:, 1]]))
    return ends[order[np.abs(next_turns - turns[edge[:, 0]]) > ROTATION_TOLERANCE, 0]]


def _check_rigid(
    edges: IntArray, vertices: IntArray, first_vectors: ComplexArray, second_vectors: ComplexArray
) -> None:
    lengths: FloatArray = np.abs(first_vectors)
    if not (lengths > 0).all():
        raise SeamError(f"{int((~(lengths > 0)).sum())} seam edges have no length in the plane")
    off = np.abs(np.abs(second_vectors) / lengths - 1)
    if (off > RIGID_TOLERANCE).any():
        worst = int(off.argmax())
        pair = "-".join(str(v) for v in vertices[worst].tolist())
        raise SeamError(
            f"the sides of {int((off > RIGID_TOLERANCE).sum())} of {len(edges)} seam edges are not copies of each "
            f"other: those of edge {pair} differ by {off[worst]:.2g} of their length"
        )
