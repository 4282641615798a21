"""Nearest points of a triangle mesh to points in space: on the whole mesh, or near a previous point."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..base import FloatArray, IntArray, compiled, dots
from .triangles import face_normals

#: A triangle that faces away from the normal of a point counts as farther by this fraction of the model's diagonal,
#: so that the two sides of a thin wall are not confused.
OPPOSITE = 0.01


class TriangleTree:
    """A binary tree of boxes around triangles; node i has the children 2 i + 1 and 2 i + 2.

    Args:
        vertices, faces: (n, 3), (m, 3) the surface.
        leaf: triangles per leaf; fewer make the tree deeper, more make each leaf slower.
    """

    def __init__(self, vertices: FloatArray, faces: IntArray, leaf: int = 4) -> None:
        corners = np.ascontiguousarray(vertices[faces])
        centres, count = corners.mean(axis=1), len(faces)
        self._levels = max(int(np.ceil(np.log2(count / leaf))), 0)
        order = np.arange(count)
        for level in range(self._levels):
            start = self._starts(level, count)
            sizes = np.diff(start)
            ordered = centres[order]
            spread = np.maximum.reduceat(ordered, start[:-1]) - np.minimum.reduceat(ordered, start[:-1])
            axis = np.repeat(spread.argmax(axis=1), sizes)
            order = order[np.lexsort((centres[order, axis], np.repeat(np.arange(len(sizes)), sizes)))]
        self._order, self._leaves = order, self._starts(self._levels, count)
        low = np.minimum.reduceat(corners.min(axis=1)[order], self._leaves[:-1])
        high = np.maximum.reduceat(corners.max(axis=1)[order], self._leaves[:-1])
        boxes = [np.stack([low, high], axis=1)]
        for _ in range(self._levels):
            below = boxes[0].reshape(-1, 2, 2, 3)
            boxes.insert(0, np.stack([below[:, :, 0].min(axis=1), below[:, :, 1].max(axis=1)], axis=1))
        self._boxes = np.concatenate(boxes)
        self._corners, self._normals = corners, face_normals(vertices, faces)
        self.diagonal = float(np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0)))

    @staticmethod
    def _starts(level: int, count: int) -> IntArray:
        """Return (2^level + 1,) where the triangles of each node of a level begin, and the end."""
        return (np.arange(2**level + 1) * count) >> level

    def nearest(self, points: FloatArray, normals: FloatArray | None = None) -> tuple[IntArray, FloatArray]:
        """Return (q,) the triangles nearest to points, and (q, 3) the barycentric coordinates of the nearest points.

        Args:
            points: (q, 3), the faster the closer each is to the one before.
            normals: (q, 3) direction to which the surface of each point faces; triangles that face away are avoided.
        """
        normals = np.zeros_like(points) if normals is None else normals
        triangles, weights = np.empty(len(points), np.int64), np.empty((len(points), 3))
        _search(
            self._boxes, self._leaves, self._order, self._corners, self._normals,
            (OPPOSITE * self.diagonal) ** 2, points, normals, triangles, weights,
        )  # fmt: skip
        return triangles, weights


@compiled
def _search(
    boxes: FloatArray,
    leaves: IntArray,
    order: IntArray,
    corners: FloatArray,
    normals: FloatArray,
    opposite: float,
    points: FloatArray,
    directions: FloatArray,
    triangles: IntArray,
    weights: FloatArray,
) -> None:
    """Find the nearest triangle of each point, depth first, the nearer child first."""
    stack, trial = np.empty(128, np.int64), np.empty(3)

    def square_to(f: int, q: int) -> float:
        """Return the squared distance of point q from triangle f, more if it faces away, and fill in `trial`."""
        square = nearest_in_triangle(points[q], corners[f, 0], corners[f, 1], corners[f, 2], trial)
        along = 0.0
        for k in range(3):
            along += normals[f, k] * directions[q, k]
        return square + opposite if along < 0 else square

    def square_to_box(node: int, q: int) -> float:
        total = 0.0
        for k in range(3):
            outside = max(boxes[node, 0, k] - points[q, k], points[q, k] - boxes[node, 1, k], 0.0)
            total += outside * outside
        return total

    first_leaf, last = len(leaves) - 2, order[0]
    for q in range(len(points)):
        # The triangle of the point before gives a first bound.
        best = square_to(last, q)
        triangles[q], weights[q] = last, trial
        stack[0], size = 0, 1
        while size > 0:
            size -= 1
            node = stack[size]
            if square_to_box(node, q) > best:
                continue
            if node < first_leaf:
                left, right = 2 * node + 1, 2 * node + 2
                if square_to_box(left, q) < square_to_box(right, q):
                    left, right = right, left
                stack[size], stack[size + 1] = left, right
                size += 2
                continue
            for k in range(leaves[node - first_leaf], leaves[node - first_leaf + 1]):
                f = order[k]
                square = square_to(f, q)
                if square <= best:
                    best, triangles[q], weights[q] = square, f, trial
        last = triangles[q]


def surface_distances(vertices: FloatArray, faces: IntArray, queries: FloatArray) -> FloatArray:
    """Return (q,) the exact distances of points (q, 3) from a surface of vertices (n, 3) and triangles (m, 3)."""
    on, weights = TriangleTree(vertices, faces).nearest(queries)
    points = np.einsum("qi,qix->qx", weights, vertices[faces[on]])
    return np.asarray(np.linalg.norm(points - queries, axis=1))


@compiled
def nearest_in_triangle(
    point: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray, weights: FloatArray
) -> float:
    """Return the squared distance of a point from a triangle, and fill in the nearest point's barycentric coordinates.

    The nearest point is the foot of the perpendicular if this is inside the triangle, else the nearest point on a side.
    """
    # Scalars instead of arrays avoid temporary arrays.
    bx, by, bz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    cx, cy, cz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    px, py, pz = point[0] - a[0], point[1] - a[1], point[2] - a[2]
    bb, bc, cc = bx * bx + by * by + bz * bz, bx * cx + by * cy + bz * cz, cx * cx + cy * cy + cz * cz
    pb, pc = px * bx + py * by + pz * bz, px * cx + py * cy + pz * cz
    area, v, w = bb * cc - bc * bc, cc * pb - bc * pc, bb * pc - bc * pb
    if area > 0 and v >= 0 and w >= 0 and v + w <= area:
        v, w = v / area, w / area
        weights[0] = max(1 - v - w, 0.0)  # rounding can make it negative
        weights[1] = v
        weights[2] = w
        x, y, z = px - v * bx - w * cx, py - v * by - w * cy, pz - v * bz - w * cz
        return x * x + y * y + z * z
    best = np.inf
    for i in range(3):
        if i == 0:
            along, length, x, y, z = pb, bb, bx, by, bz
        elif i == 1:
            along, length, x, y, z = pb - pc - bc + cc, bb - 2 * bc + cc, bx - cx, by - cy, bz - cz
        else:
            along, length, x, y, z = pc, cc, cx, cy, cz
        share = min(max(along / length, 0.0), 1.0) if length > 0 else 0.0
        x, y, z = px - share * x, py - share * y, pz - share * z
        if i == 1:
            x, y, z = x - cx, y - cy, z - cz
        square = x * x + y * y + z * z
        if square < best:
            best = square
            weights[0] = 0.0 if i == 1 else 1 - share
            weights[1] = 0.0 if i == 2 else share
            weights[2] = 0.0 if i == 0 else (share if i == 2 else 1 - share)
    return best


class Stars(NamedTuple):
    """A mesh of triangles, or of quads, with the faces around each vertex.

    Attributes:
        vertices, faces: (n, 3), (m, k) the mesh.
        start, star: (n + 1,), (km,) vertex v is in the faces star[start[v]:start[v + 1]].
    """

    vertices: FloatArray
    faces: IntArray
    start: IntArray
    star: IntArray

    @classmethod
    def of(cls, vertices: FloatArray, faces: IntArray) -> Stars:
        """Return a mesh with the faces around each vertex."""
        degree = np.bincount(faces.ravel(), minlength=len(vertices))
        star = np.argsort(faces.ravel(), kind="stable") // faces.shape[1]
        return cls(vertices, faces, np.concatenate([[0], np.cumsum(degree)]), star)

    def at(self, on_faces: IntArray, barycentric: FloatArray) -> FloatArray:
        """Return (q, 3) the positions of points given by triangles (q,) and barycentric coordinates (q, 3)."""
        return np.einsum("qi,qix->qx", barycentric, self.vertices[self.faces[on_faces]])

    def axes(self, faces: IntArray) -> FloatArray:
        """Return (k, 2, 3) orthonormal axes of the planes of triangles (k,), the first along the longest side."""
        corners, rows = self.vertices[self.faces[faces]], np.arange(len(faces))
        sides = np.roll(corners, -1, axis=1) - corners
        longest = np.linalg.norm(sides, axis=2).argmax(axis=1)
        along, across = sides[rows, longest], -sides[rows, longest - 1]
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        across -= dots(across, along)[:, None] * along
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), np.finfo(float).tiny)
        return np.stack([along, across], axis=1)


@compiled
def slide_near(surface: Stars, targets: FloatArray, on_faces: IntArray, barycentric: FloatArray) -> None:
    """Move points along a surface to local minima of the distance to their targets.

    A point moves to a triangle with a common vertex as long as this is nearer to its target. So it never jumps to a
    different sheet of the surface nearby.

    Args:
        surface: the triangles.
        targets: (q, 3).
        on_faces, barycentric: (q,), (q, 3) the points, updated in place.
    """
    vertices, faces, start, star = surface
    weights = np.empty(3)
    for q in range(len(targets)):
        best, f, moved = np.inf, on_faces[q], True
        while moved:
            moved = False
            for i in range(3):
                v = faces[f, i]
                for k in range(start[v], start[v + 1]):
                    g = star[k]
                    a, b, c = vertices[faces[g, 0]], vertices[faces[g, 1]], vertices[faces[g, 2]]
                    square = nearest_in_triangle(targets[q], a, b, c, weights)
                    if square < best:
                        best, on_faces[q], moved = square, g, True
                        barycentric[q] = weights
            f = on_faces[q]
