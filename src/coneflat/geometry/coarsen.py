"""Simplification of meshes: edges collapse to one of their ends."""

from __future__ import annotations

import heapq
import math
from typing import NamedTuple

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray, dots
from ..base.jit import compiled
from ..mesh.connectivity import TriangleMesh
from ..mesh.ties import tie_key

# Cosine of the largest rotation of a triangle by a collapse; the double area of a triangle, relative to half the sum of
# its squared sides, below which it must not get thinner, and to whose fourth power its normal is considered; and the
# weight of the length of an edge in its cost: lengths decide where the surface is flat.
MAX_ROTATION, MIN_SHAPE, LENGTH_WEIGHT = 0.2, 0.1, 0.1


def coarse_mesh(mesh: TriangleMesh, count: int) -> tuple[TriangleMesh, IntArray, IntArray]:
    """Return a mesh of the same topology with about `count` triangles, and its vertices (k,) and triangles here.

    References:
        M. Garland, P. Heckbert, "Surface simplification using quadric error metrics", 1997.
    """
    faces = mesh.faces.astype(np.int64, order="C")
    points, key = mesh.vertices - mesh.vertices.mean(axis=0), tie_key(mesh.vertices)
    first, last, seen = np.full((3, len(points)), -1)
    links = first, last, np.full(faces.size, -1), np.full(len(points), np.inf)
    quadrics = _quadrics(mesh, points)
    collapse_edges(
        Collapses(points, quadrics, key, mesh.is_boundary_vertex, faces.reshape(-1), *links), seen, count
    )
    remains = faces[:, 0] >= 0
    vertices, corners = np.unique(faces[remains], return_inverse=True)
    return TriangleMesh(mesh.vertices[vertices], corners.reshape(-1, 3)), vertices, np.flatnonzero(remains)


def _quadrics(mesh: TriangleMesh, points: FloatArray) -> FloatArray:
    """Return (n, 10) for each vertex the squared distances to the planes of its triangles, multiplied by areas.

    They are symmetric matrices of four by four, the lower triangles by rows. Planes through boundary edges,
    perpendicular to the triangles, keep the shape of the boundary.
    """
    corner_a, corner_b, corner_c = points[mesh.faces].transpose(1, 0, 2)
    normals = np.cross(corner_b - corner_a, corner_c - corner_a)
    sides = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
    (tails, heads), side_normals = mesh.ends_of(sides), normals[sides // 3]
    along = points[heads] - points[tails]
    size = np.sqrt(dots(along, along) / np.maximum(dots(side_normals, side_normals), 1e-300))
    across = np.cross(along, side_normals) * size[:, None]
    quadrics, (row, column) = np.zeros((len(points), 10)), np.tril_indices(4)
    planes = (normals, corner_a, mesh.faces.T), (across, points[tails], np.stack([tails, heads]))
    for normal, place, vertices in planes:
        # Multiplied by the root of the area.
        plane = np.column_stack([normal, -dots(normal, place)])
        plane /= np.maximum(dots(normal, normal), 1e-300)[:, None] ** 0.25
        for i in range(10):
            for vertex in vertices:
                quadrics[:, i] += np.bincount(vertex, plane[:, row[i]] * plane[:, column[i]], len(points))
    return quadrics


class Collapses(NamedTuple):
    """A mesh whose edges collapse.

    Attributes:
        points: (n, 3) vertices.
        quadrics: (n, 10) of the vertices; a vertex gets those of the vertices that collapse to it.
        key: (n,) keys that break ties, see `tie_key`.
        is_boundary: (n,) the vertices of the boundary, which collapse only along it.
        corners: (3m,) vertices of the triangles, -1 in those that are removed.
        first, last: (n,) the first and the last corner at each vertex, -1 for none.
        after: (3m,) the next corner at the vertex of each.
        cost: (n,) cost of the cheapest edge from each vertex.
    """

    points: FloatArray
    quadrics: FloatArray
    key: FloatArray
    is_boundary: BoolArray
    corners: IntArray
    first: IntArray
    last: IntArray
    after: IntArray
    cost: FloatArray


@compiled
def edge_cost(points: FloatArray, quadrics: FloatArray, tail: int, head: int) -> float:
    """Return the cost of the collapse of a vertex to another one."""
    cost, square, k = 0.0, 0.0, 0
    for i in range(4):
        x = 1.0 if i == 3 else points[head, i]
        square += 0.0 if i == 3 else (x - points[tail, i]) ** 2
        for j in range(i + 1):
            y = 1.0 if j == 3 else points[head, j]
            cost += (1.0 if i == j else 2.0) * x * y * (quadrics[tail, k] + quadrics[head, k])
            k += 1
    return cost + LENGTH_WEIGHT * square**2


@compiled
def cheapest_edge(mesh: Collapses, tail: int, passed: float, last_head: int) -> tuple[float, float, int, int]:
    """Return the cheapest edge from a vertex that comes after one with a given cost and head: cost, key, ends."""
    lowest_cost, to, corner = np.inf, tail, mesh.first[tail]
    while corner >= 0:
        # Around an inner vertex, the next corners are all its neighbours.
        for step in range(1, 3 if mesh.is_boundary[tail] else 2):
            head = mesh.corners[corner - corner % 3 + (corner + step) % 3]
            cost = edge_cost(mesh.points, mesh.quadrics, tail, head) if head >= 0 else np.inf
            if (passed, mesh.key[last_head]) < (cost, mesh.key[head]) < (lowest_cost, mesh.key[to]):
                lowest_cost, to = cost, head
        corner = mesh.after[corner]
    mesh.cost[tail] = lowest_cost
    return lowest_cost, mesh.key[tail], tail, to


@compiled
def normal_and_shape(
    points: FloatArray, a_vertex: int, b_vertex: int, c_vertex: int
) -> tuple[float, float, float, float, float]:
    """Return the normal of a triangle, its length, and that relative to half the sum of the squared sides."""
    x, y, z = points[a_vertex, 0], points[a_vertex, 1], points[a_vertex, 2]
    a, b, c = points[b_vertex, 0] - x, points[b_vertex, 1] - y, points[b_vertex, 2] - z
    d, e, f = points[c_vertex, 0] - x, points[c_vertex, 1] - y, points[c_vertex, 2] - z
    g, h, i = b * f - c * e, c * d - a * f, a * e - b * d
    size = math.sqrt(g * g + h * h + i * i)
    sides = a * a + b * b + c * c + d * d + e * e + f * f - (a * d + b * e + c * f)
    return g, h, i, size, size / sides


@compiled
def can_collapse(mesh: Collapses, seen: IntArray, stamp: int, tail: int, head: int) -> bool:
    """Return whether an edge can collapse: topology and boundary stay, and no triangle turns or gets thin.

    seen: (n,) marks of vertices; those that are equal to `stamp` are in use.
    """
    corner, shared, common = mesh.first[tail], 0, 0
    while corner >= 0:
        face = corner - corner % 3
        following, preceding = mesh.corners[face + (corner + 1) % 3], mesh.corners[face + (corner + 2) % 3]
        if following >= 0:
            seen[following] = seen[preceding] = stamp
        if head in (following, preceding):
            shared += 1
        elif following >= 0:
            a, b, c, size, shape = normal_and_shape(mesh.points, tail, following, preceding)
            d, e, f, new_size, new_shape = normal_and_shape(mesh.points, head, following, preceding)
            if not new_shape > min(shape, MIN_SHAPE):
                return False
            if shape > MIN_SHAPE**4 and a * d + b * e + c * f < MAX_ROTATION * size * new_size:
                return False
        corner = mesh.after[corner]
    corner = mesh.first[head]
    while corner >= 0:
        face = corner - corner % 3
        for step in range(1, 3):
            vertex = mesh.corners[face + (corner + step) % 3]
            if vertex >= 0 and seen[vertex] == stamp:
                common += 1
                seen[vertex] = -1
        corner = mesh.after[corner]
    # The topology stays if the ends have no common neighbours but those in their common triangles.
    return common == shared and not (mesh.is_boundary[tail] and shared != 1)


@compiled
def link_corner(mesh: Collapses, corner: int, vertex: int) -> None:
    """Add a corner to the list of a vertex."""
    if mesh.first[vertex] < 0:
        mesh.last[vertex] = corner
    mesh.after[corner] = mesh.first[vertex]
    mesh.first[vertex] = corner


@compiled
def collapse_edges(mesh: Collapses, seen: IntArray, count: int) -> None:
    """Collapse edges, the cheapest first, until at most `count` triangles are left.

    Args:
        mesh: the mesh, modified; `first` is -1 on entry.
        seen: (n,) -1 on entry, a work array.
        count: the number of triangles.
    """
    points, quadrics, corners, first, after = mesh.points, mesh.quadrics, mesh.corners, mesh.first, mesh.after
    left, before, stamp = len(corners) // 3, len(corners), 0
    for corner in range(len(corners)):
        link_corner(mesh, corner, corners[corner])
    # Edges that could not collapse are tried again after the others, unless these were few.
    while count < left < 0.9 * before:
        before = left
        heap = [cheapest_edge(mesh, tail, -np.inf, tail) for tail in range(len(points)) if first[tail] >= 0]
        heapq.heapify(heap)
        while left > count and len(heap):
            cost, _, tail, head = heapq.heappop(heap)
            # The entry of a vertex that was pushed last counts.
            if first[tail] < 0 or cost == np.inf or cost != mesh.cost[tail]:
                continue
            # Costs only rise, as vertices do not move.
            if first[head] < 0 or edge_cost(points, quadrics, tail, head) > cost:
                heapq.heappush(heap, cheapest_edge(mesh, tail, -np.inf, tail))
                continue
            stamp += 1
            if not can_collapse(mesh, seen, stamp, tail, head):
                heapq.heappush(heap, cheapest_edge(mesh, tail, cost, head))
                continue
            after[mesh.last[tail]], chain = first[head], first[tail]
            first[tail] = first[head] = -1
            for k in range(10):
                quadrics[head, k] += quadrics[tail, k]
            while chain >= 0:
                corner, chain = chain, after[chain]
                face = corner - corner % 3
                following, preceding = corners[face + (corner + 1) % 3], corners[face + (corner + 2) % 3]
                if corners[corner] == tail and head in (following, preceding):
                    for k in range(face, face + 3):
                        corners[k] = -1
                    left -= 1
                elif corners[corner] >= 0:
                    corners[corner] = head
                    link_corner(mesh, corner, head)
                    for vertex in (following, preceding):
                        if edge_cost(points, quadrics, vertex, head) < mesh.cost[vertex]:
                            heapq.heappush(heap, cheapest_edge(mesh, vertex, -np.inf, vertex))
            heapq.heappush(heap, cheapest_edge(mesh, head, -np.inf, head))
