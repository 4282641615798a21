"""Simplification of meshes: edges collapse to one of their ends."""

from __future__ import annotations

import heapq

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
    collapse_edges(points, faces, _quadrics(mesh, points), mesh.is_boundary_vertex, key, count)
    kept, corners = np.unique(faces[faces[:, 0] >= 0], return_inverse=True)
    return TriangleMesh(mesh.vertices[kept], corners.reshape(-1, 3)), kept, np.flatnonzero(faces[:, 0] >= 0)


def _quadrics(mesh: TriangleMesh, points: FloatArray) -> FloatArray:
    """Return (n, 10) for each vertex the squared distances to the planes of its triangles, multiplied by areas.

    They are symmetric matrices of four by four, the lower triangles by rows. Planes through boundary edges,
    perpendicular to the triangles, keep the shape of the boundary.
    """
    one, two, three = points[mesh.faces].transpose(1, 0, 2)
    normals = np.cross(two - one, three - one)
    sides = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
    (tails, heads), near = mesh.ends_of(sides), normals[sides // 3]
    along = points[heads] - points[tails]
    size = np.sqrt(dots(along, along) / np.maximum(dots(near, near), 1e-300))
    across = np.cross(along, near) * size[:, None]
    found, (row, column) = np.zeros((len(points), 10)), np.tril_indices(4)
    planes = (normals, one, mesh.faces.T), (across, points[tails], np.stack([tails, heads]))
    for normal, place, vertices in planes:
        # Multiplied by the root of the area.
        plane = np.column_stack([normal, -dots(normal, place)])
        plane /= np.maximum(dots(normal, normal), 1e-300)[:, None] ** 0.25
        for i in range(10):
            for vertex in vertices:
                found[:, i] += np.bincount(vertex, plane[:, row[i]] * plane[:, column[i]], len(points))
    return found


@compiled
def collapse_edges(
    points: FloatArray,
    faces: IntArray,
    quadrics: FloatArray,
    is_boundary: BoolArray,
    key: FloatArray,
    count: int,
) -> None:
    """Collapse edges, the cheapest first, until at most `count` triangles are left; those removed become -1.

    Args:
        points: (n, 3) vertices.
        faces: (m, 3) vertex indices, modified.
        quadrics: (n, 10), modified: a vertex gets those of the vertices that collapse to it.
        is_boundary: (n,) the vertices of the boundary, which collapse only along it.
        key: (n,) keys that break ties, see `tie_key`.
        count: the number of triangles.
    """
    corners, left, before = faces.ravel(), len(faces), 2 * len(faces)
    # The corners of each vertex are a linked list.
    first, last, after = np.full(len(points), -1), np.full(len(points), -1), np.full(len(corners), -1)
    seen, stamp, known = np.full(len(points), -1), 0, np.full(len(points), np.inf)
    for corner, vertex in enumerate(corners):
        last[vertex] = corner if first[vertex] < 0 else last[vertex]
        after[corner], first[vertex] = first[vertex], corner

    def cost_of(tail: int, head: int) -> float:
        cost, square, k = 0.0, 0.0, 0
        for i in range(4):
            x = 1.0 if i == 3 else points[head, i]
            square += 0.0 if i == 3 else (x - points[tail, i]) ** 2
            for j in range(i + 1):
                y = 1.0 if j == 3 else points[head, j]
                cost += (1.0 if i == j else 2.0) * x * y * (quadrics[tail, k] + quadrics[head, k])
                k += 1
        return cost + LENGTH_WEIGHT * square**2

    def entry(tail: int, passed: float, last_head: int) -> tuple[float, float, int, int]:
        """Return the cheapest edge from a vertex that comes after one with a given cost and head."""
        least, to, corner = np.inf, tail, first[tail]
        while corner >= 0:
            # Around an inner vertex, the next corners are all its neighbours.
            for step in range(1, 3 if is_boundary[tail] else 2):
                head = corners[corner - corner % 3 + (corner + step) % 3]
                cost = cost_of(tail, head) if head >= 0 else np.inf
                if (passed, key[last_head]) < (cost, key[head]) < (least, key[to]):
                    least, to = cost, head
            corner = after[corner]
        known[tail] = least
        return least, key[tail], tail, to

    def normal(one: int, two: int, three: int) -> tuple[float, float, float, float, float]:
        x, y, z = points[one, 0], points[one, 1], points[one, 2]
        a, b, c = points[two, 0] - x, points[two, 1] - y, points[two, 2] - z
        d, e, f = points[three, 0] - x, points[three, 1] - y, points[three, 2] - z
        g, h, i = b * f - c * e, c * d - a * f, a * e - b * d
        size = np.sqrt(g * g + h * h + i * i)
        sides = a * a + b * b + c * c + d * d + e * e + f * f - (a * d + b * e + c * f)
        return g, h, i, size, size / sides

    # Edges that could not collapse are tried again after the others, unless these were few.
    while count < left < 0.9 * before:
        before = left
        heap = [entry(tail, -np.inf, tail) for tail in range(len(points)) if first[tail] >= 0]
        heapq.heapify(heap)
        while left > count and len(heap):
            cost, _, tail, head = heapq.heappop(heap)
            # The entry of a vertex that was pushed last counts.
            if first[tail] < 0 or cost == np.inf or cost != known[tail]:
                continue
            # Costs only rise, as vertices do not move.
            if first[head] < 0 or cost_of(tail, head) > cost:
                heapq.heappush(heap, entry(tail, -np.inf, tail))
                continue
            corner, shared, common, is_bad, stamp = first[tail], 0, 0, False, stamp + 1
            while corner >= 0:
                face = corner - corner % 3
                one, two = corners[face + (corner + 1) % 3], corners[face + (corner + 2) % 3]
                if one >= 0:
                    seen[one] = seen[two] = stamp
                if head in (one, two):
                    shared += 1
                elif one >= 0:
                    a, b, c, old, shape = normal(tail, one, two)
                    d, e, f, new, new_shape = normal(head, one, two)
                    is_bad |= not new_shape > min(shape, MIN_SHAPE)
                    is_bad |= shape > MIN_SHAPE**4 and a * d + b * e + c * f < MAX_ROTATION * old * new
                corner = after[corner]
            corner = first[head]
            while corner >= 0:
                face = corner - corner % 3
                for step in range(1, 3):
                    vertex = corners[face + (corner + step) % 3]
                    if vertex >= 0 and seen[vertex] == stamp:
                        common += 1
                        seen[vertex] = -1
                corner = after[corner]
            # The topology stays if the ends have no common neighbours but those in their common triangles.
            if is_bad or common != shared or (is_boundary[tail] and shared != 1):
                heapq.heappush(heap, entry(tail, cost, head))
                continue
            after[last[tail]], chain = first[head], first[tail]
            first[tail] = first[head] = -1
            quadrics[head] += quadrics[tail]
            while chain >= 0:
                corner, chain = chain, after[chain]
                face = corner - corner % 3
                one, two = corners[face + (corner + 1) % 3], corners[face + (corner + 2) % 3]
                if corners[corner] == tail and head in (one, two):
                    corners[face : face + 3] = -1
                    left -= 1
                elif corners[corner] >= 0:
                    corners[corner] = head
                    last[head] = corner if first[head] < 0 else last[head]
                    after[corner], first[head] = first[head], corner
                    for vertex in (one, two):
                        if cost_of(vertex, head) < known[vertex]:
                            heapq.heappush(heap, entry(vertex, -np.inf, vertex))
            heapq.heappush(heap, entry(head, -np.inf, head))
