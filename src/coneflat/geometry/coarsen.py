"""Simplification of meshes: edges collapse to one of their ends."""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray, dots, mask_of
from ..base.jit import compiled
from ..mesh.connectivity import TriangleMesh
from ..mesh.ties import mesh_tie_key

# Cosine of the largest rotation of a triangle by a collapse; the double area of a triangle, relative to half the sum of
# its squared sides, below which it must not get thinner, and to whose fourth power its normal is considered; and the
# weight of the length of an edge in its cost: lengths decide where the surface is flat.
MAX_ROTATION, MIN_SHAPE, LENGTH_WEIGHT = 0.2, 0.1, 0.1
# Number of triangles, relative to the requested number, above which edges collapse in rounds. This takes a third of the
# time of a queue of all edges, and hardly matters where most vertices are removed anyway.
ROUNDS_ABOVE = 8
# Rounds end if one leaves more than this fraction of the triangles.
MIN_PROGRESS = 0.95
# Adding this multiple of a number and subtracting it again rounds the number to ten binary digits, so that rounding
# errors do not decide between edges of equal cost on symmetric meshes.
TEN_DIGITS = 2.0**43


@dataclass(frozen=True, eq=False)
class CoarseMesh:
    """A mesh with fewer triangles.

    Attributes:
        mesh: the mesh; each of its vertices and triangles comes from one of the original mesh.
        vertices: (k,) the original vertices.
        faces: (l,) the original triangles.
        clusters: (n,) the vertex of `mesh` to which each original vertex collapsed.
    """

    mesh: TriangleMesh
    vertices: IntArray
    faces: IntArray
    clusters: IntArray


def coarse_mesh(mesh: TriangleMesh, count: int, anchors: IntArray | None = None) -> CoarseMesh:
    """Return a mesh of the same topology with about `count` triangles.

    Args:
        mesh: the mesh; edges collapse to one of their ends.
        count: the number of triangles.
        anchors: (a,) vertices that remain; None for none.

    References:
        M. Garland, P. Heckbert, "Surface simplification using quadric error metrics", 1997.
    """
    faces = mesh.faces.astype(np.int64, order="C")
    points = mesh.vertices - mesh.vertices.mean(axis=0)
    points /= math.sqrt(max(float(dots(points, points).max()), np.finfo(float).tiny))
    is_anchor = np.zeros(len(points), dtype=bool) if anchors is None else mask_of(len(points), anchors)
    first, last, target, seen = np.full((4, len(points)), -1)
    collapses = Collapses(
        points, np.zeros((len(points), 10)), mesh_tie_key(mesh), mesh.is_boundary_vertex, is_anchor,
        faces.reshape(-1), first, last, np.full(faces.size, -1), target, np.full(len(points), np.inf),
    )  # fmt: skip
    add_quadrics(collapses, mesh.edge_halfedges[mesh.is_boundary_edge, 0])
    link_corners(collapses)
    left = collapse_in_rounds(collapses, seen, len(faces), ROUNDS_ABOVE * count)
    collapse_cheapest(collapses, seen, left, count)
    remains = faces[:, 0] >= 0
    vertices, corners = np.unique(faces[remains], return_inverse=True)
    number = np.full(len(points), -1)
    number[vertices] = np.arange(len(vertices))
    return CoarseMesh(
        TriangleMesh(mesh.vertices[vertices], corners.reshape(-1, 3)),
        vertices,
        np.flatnonzero(remains),
        number[_ends(target)],
    )


def _ends(target: IntArray) -> IntArray:
    """Return (n,) the vertex that each vertex ends at, given the one that it collapsed to, or -1."""
    ends = np.where(target < 0, np.arange(len(target)), target)
    while not np.array_equal(ends, further := ends[ends]):
        ends = further
    return ends


class Collapses(NamedTuple):
    """A mesh whose edges collapse.

    Attributes:
        points: (n, 3) vertices.
        quadrics: (n, 10) of the vertices; a vertex gets those of the vertices that collapse to it.
        key: (n,) keys that break ties, see `tie_key`.
        is_boundary: (n,) the vertices of the boundary, which collapse only along it.
        is_anchor: (n,) the vertices that do not collapse.
        corners: (3m,) vertices of the triangles, -1 in those that are removed.
        first, last: (n,) the first and the last corner at each vertex, -1 for none.
        after: (3m,) the next corner at the vertex of each.
        target: (n,) the vertex that each one has collapsed to, -1 for none.
        cost: (n,) cost of the cheapest edge from each vertex.
    """

    points: FloatArray
    quadrics: FloatArray
    key: FloatArray
    is_boundary: BoolArray
    is_anchor: BoolArray
    corners: IntArray
    first: IntArray
    last: IntArray
    after: IntArray
    target: IntArray
    cost: FloatArray


@compiled
def add_plane(mesh: Collapses, vertex: int, normal: FloatArray, offset: float, weight: float) -> None:
    """Add the squared distance to a plane, multiplied by a weight, to the quadric of a vertex."""
    k = 0
    for i in range(4):
        x = offset if i == 3 else normal[i]
        for j in range(i + 1):
            mesh.quadrics[vertex, k] += weight * x * (offset if j == 3 else normal[j])
            k += 1


@compiled
def add_quadrics(mesh: Collapses, borders: IntArray) -> None:
    """Add to the quadric of each vertex the squared distances to the planes of its triangles, multiplied by areas.

    Quadrics are symmetric matrices of four by four, the lower triangles by rows. Planes through boundary edges,
    perpendicular to the triangles, keep the shape of the boundary.

    Args:
        mesh: the mesh; its quadrics are changed.
        borders: (b,) half-edges at the boundary.
    """
    points, corners = mesh.points, mesh.corners
    normals = np.empty((len(corners) // 3, 3))
    for face in range(len(normals)):
        a, b, c = corners[3 * face], corners[3 * face + 1], corners[3 * face + 2]
        x, y, z, size, _ = normal_and_shape(points, a, b, c)
        normals[face] = x, y, z
        offset = -(x * points[a, 0] + y * points[a, 1] + z * points[a, 2])
        for vertex in (a, b, c):
            add_plane(mesh, vertex, normals[face], offset, 1.0 / max(size, 1e-300))
    for border in borders:
        face, side = border // 3, border % 3
        tail, head = corners[3 * face + (side + 1) % 3], corners[3 * face + (side + 2) % 3]
        along, normal = points[head] - points[tail], normals[face]
        size = (normal * normal).sum()
        across = np.cross(along, normal) / math.sqrt(max(size, 1e-300))
        offset = -(across * points[tail]).sum()
        for vertex in (tail, head):
            add_plane(mesh, vertex, across, offset, 1.0)


@compiled
def edge_cost(points: FloatArray, quadrics: FloatArray, tail: int, head: int) -> float:
    """Return the rounded cost of the collapse of a vertex to another one."""
    x, y, z = points[head, 0], points[head, 1], points[head, 2]
    a, b = quadrics[tail], quadrics[head]
    cost = (
        (a[0] + b[0]) * x * x + (a[2] + b[2]) * y * y + (a[5] + b[5]) * z * z + (a[9] + b[9])
        + 2.0 * ((a[1] + b[1]) * x * y + (a[3] + b[3]) * x * z + (a[4] + b[4]) * y * z)
        + 2.0 * ((a[6] + b[6]) * x + (a[7] + b[7]) * y + (a[8] + b[8]) * z)
    )  # fmt: skip
    x, y, z = x - points[tail, 0], y - points[tail, 1], z - points[tail, 2]
    square = x * x + y * y + z * z
    cost += LENGTH_WEIGHT * square * square
    return TEN_DIGITS * cost - (TEN_DIGITS * cost - cost)


@compiled
def cheapest_edge(mesh: Collapses, tail: int, passed: float, last_head: int) -> tuple[float, float, int, int]:
    """Return the cheapest edge from a vertex that comes after one with a given cost and head: cost, key, ends."""
    lowest_cost, to, corner = np.inf, tail, -1 if mesh.is_anchor[tail] else mesh.first[tail]
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
def link_corners(mesh: Collapses) -> None:
    """Make the lists of the corners at all vertices; `first` is -1 before."""
    for corner in range(len(mesh.corners)):
        link_corner(mesh, corner, mesh.corners[corner])


@compiled
def collapse(mesh: Collapses, tail: int, head: int) -> int:
    """Collapse a vertex to another one; return the number of triangles that are removed."""
    corners, first, after, removed = mesh.corners, mesh.first, mesh.after, 0
    after[mesh.last[tail]], chain = first[head], first[tail]
    first[tail] = first[head] = -1
    mesh.target[tail] = head
    for k in range(10):
        mesh.quadrics[head, k] += mesh.quadrics[tail, k]
    while chain >= 0:
        corner, chain = chain, after[chain]
        face = corner - corner % 3
        following, preceding = corners[face + (corner + 1) % 3], corners[face + (corner + 2) % 3]
        if corners[corner] == tail and head in (following, preceding):
            for k in range(face, face + 3):
                corners[k] = -1
            removed += 1
        elif corners[corner] >= 0:
            corners[corner] = head
            link_corner(mesh, corner, head)
    return removed


@compiled
def cheapest_edges(mesh: Collapses, heads: IntArray) -> None:
    """Write the cheapest edge from each vertex, and its cost, by a loop over the triangles.

    Large meshes do not fit into the caches: a loop over the triangles around each vertex takes three times as long.
    """
    mesh.cost[:] = np.inf
    for start in range(0, len(mesh.corners), 3):
        for corner in range(start, start + 3 if mesh.corners[start] >= 0 else start):
            tail = mesh.corners[corner]
            for step in range(1, 0 if mesh.is_anchor[tail] else 3 if mesh.is_boundary[tail] else 2):
                head = mesh.corners[start + (corner - start + step) % 3]
                cost = edge_cost(mesh.points, mesh.quadrics, tail, head)
                if cost < mesh.cost[tail] or (
                    cost == mesh.cost[tail] and mesh.key[head] < mesh.key[heads[tail]]
                ):
                    mesh.cost[tail], heads[tail] = cost, head


@compiled
def collapse_in_rounds(mesh: Collapses, seen: IntArray, left: int, count: int) -> int:
    """Collapse edges until about `count` triangles are left; return their number.

    In each round, cheap edges collapse whose vertices have not changed in it. It ends early if few edges can.

    Args:
        mesh: the mesh, modified.
        seen: (n,) -1 on entry, a work array.
        left: the number of triangles that it has.
        count: the number of triangles.
    """
    order, heads = np.argsort(mesh.key), np.full(len(mesh.key), -1, np.int64)
    changed, before, stamp, turn = np.zeros(len(mesh.key), np.int64), 2 * left, 0, 0
    while left > count and left < MIN_PROGRESS * before:
        before, turn = left, turn + 1
        order = order[mesh.first[order] >= 0]
        cheapest_edges(mesh, heads)
        limit = np.partition(mesh.cost[order], 3 * len(order) // 4)[3 * len(order) // 4]
        for tail in order:
            head = heads[tail]
            if (
                not mesh.cost[tail] <= limit
                or mesh.cost[tail] == np.inf
                or changed[tail] == turn
                or changed[head] == turn
            ):
                continue
            stamp += 1
            if mesh.first[head] >= 0 and can_collapse(mesh, seen, stamp, tail, head):
                left -= collapse(mesh, tail, head)
                changed[head] = turn
            if left <= count:
                break
    seen[:] = -1
    return left


@compiled
def collapse_cheapest(mesh: Collapses, seen: IntArray, left: int, count: int) -> None:
    """Collapse edges, the cheapest first, until at most `count` triangles are left.

    Args:
        mesh: the mesh, modified.
        seen: (n,) -1 on entry, a work array.
        left: the number of triangles that it has.
        count: the number of triangles.
    """
    points, quadrics, corners, first, after = mesh.points, mesh.quadrics, mesh.corners, mesh.first, mesh.after
    before, stamp = len(corners) // 3 + left, 0
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
            left -= collapse(mesh, tail, head)
            corner = first[head]
            while corner >= 0:
                for step in range(1, 3):
                    vertex = corners[corner - corner % 3 + (corner + step) % 3]
                    if edge_cost(points, quadrics, vertex, head) < mesh.cost[vertex]:
                        heapq.heappush(heap, cheapest_edge(mesh, vertex, -np.inf, vertex))
                corner = after[corner]
            heapq.heappush(heap, cheapest_edge(mesh, head, -np.inf, head))
