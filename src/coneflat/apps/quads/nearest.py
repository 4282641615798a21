"""Nearest points of a triangle mesh to points in space: on the whole mesh, or near a previous point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base import FloatArray, IntArray, compiled

# Triangles per leaf of the tree of boxes.
LEAF_TRIANGLES = 4


def surface_distances(vertices: FloatArray, faces: IntArray, queries: FloatArray) -> FloatArray:
    """Return (q,) the exact distances of points from a surface, by a tree of bounding boxes.

    Args:
        vertices, faces: (n, 3), (m, 3) the surface.
        queries: (q, 3) points.
    """
    corners = np.ascontiguousarray(vertices[faces], dtype=np.float64)
    order = _leaf_order(corners.mean(axis=1))
    low, high = corners.min(axis=1)[order], corners.max(axis=1)[order]
    low, high = (
        low.reshape(-1, LEAF_TRIANGLES, 3).min(axis=1),
        high.reshape(-1, LEAF_TRIANGLES, 3).max(axis=1),
    )
    boxes = [np.concatenate([low, high], axis=1)]
    while len(low) > 1:
        low, high = np.minimum(low[::2], low[1::2]), np.maximum(high[::2], high[1::2])
        boxes.append(np.concatenate([low, high], axis=1))
    tree = np.concatenate(boxes[::-1])
    squares = np.empty(len(queries))
    _fill_squares(tree, order, corners, np.ascontiguousarray(queries, dtype=np.float64), squares)
    return np.sqrt(squares)


def _leaf_order(centres: FloatArray) -> IntArray:
    """Return triangles in the order of the tree's leaves, 2**k * `LEAF_TRIANGLES` of them; some occur twice."""
    leaves = 2 ** max(0, int(np.ceil(np.log2(len(centres) / LEAF_TRIANGLES))))
    order = np.arange(leaves * LEAF_TRIANGLES) * len(centres) // (leaves * LEAF_TRIANGLES)
    groups = 1
    while groups < leaves:
        parts = order.reshape(groups, -1)
        points = centres[parts]
        widest = np.argmax(points.max(axis=1) - points.min(axis=1), axis=1)
        keys = np.take_along_axis(points, widest[:, None, None], axis=2)[..., 0]
        order = np.take_along_axis(parts, np.argsort(keys, axis=1, kind="stable"), axis=1).ravel()
        groups *= 2
    return order


@compiled
def _fill_squares(
    tree: FloatArray, order: IntArray, corners: FloatArray, queries: FloatArray, squares: FloatArray
) -> None:
    """Fill in (q,) the squared distances of points from triangles.

    tree: (2 k - 1, 6) boxes, lowest and highest corner; the children of node i are 2 i + 1 and 2 i + 2. The last k
        nodes are leaves with `LEAF_TRIANGLES` triangles each, in the order of `order`.
    """
    first_leaf = len(tree) // 2
    stack = np.empty(128, dtype=np.int64)
    weights = np.empty(3)
    for q in range(len(queries)):
        point = queries[q]
        best, top = np.inf, 1
        stack[0] = 0
        while top > 0:
            top -= 1
            node = stack[top]
            if _box_square(tree[node], point) >= best:
                continue
            if node >= first_leaf:
                for i in range(
                    LEAF_TRIANGLES * (node - first_leaf), LEAF_TRIANGLES * (node - first_leaf + 1)
                ):
                    c = corners[order[i]]
                    best = min(best, nearest_in_triangle(point, c[0], c[1], c[2], weights))
                continue
            one, two = 2 * node + 1, 2 * node + 2
            if _box_square(tree[one], point) < _box_square(tree[two], point):
                one, two = two, one
            stack[top] = one  # the farther child
            stack[top + 1] = two
            top += 2
        squares[q] = best


@compiled
def _box_square(box: FloatArray, point: FloatArray) -> float:
    total = 0.0
    for x in range(3):
        off = max(box[x] - point[x], point[x] - box[3 + x], 0.0)
        total += off * off
    return total


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


@dataclass(frozen=True, eq=False)
class Stars:
    """A triangle mesh with the triangles around each vertex.

    Attributes:
        vertices, faces: (n, 3), (m, 3) the mesh.
        start, star: (n + 1,), (3m,) vertex v is in the faces star[start[v]:start[v + 1]].
    """

    vertices: FloatArray
    faces: IntArray
    start: IntArray
    star: IntArray

    @classmethod
    def of(cls, vertices: FloatArray, faces: IntArray) -> Stars:
        """Return a mesh with the triangles around each vertex."""
        degree = np.bincount(faces.ravel(), minlength=len(vertices))
        star = np.argsort(faces.ravel(), kind="stable") // 3
        return cls(vertices, faces, np.concatenate([[0], np.cumsum(degree)]), star)

    def at(self, on_faces: IntArray, barycentric: FloatArray) -> FloatArray:
        """Return (q, 3) the positions of points given by triangles (q,) and barycentric coordinates (q, 3)."""
        return np.einsum("qi,qix->qx", barycentric, self.vertices[self.faces[on_faces]])

    def axes(self, face: int) -> FloatArray:
        """Return (2, 3) orthonormal axes of a triangle's plane, the first along its longest side."""
        corners = self.vertices[self.faces[face]]
        sides = np.roll(corners, -1, axis=0) - corners
        longest = int(np.argmax(np.linalg.norm(sides, axis=1)))
        along = sides[longest] / np.linalg.norm(sides[longest])
        across = sides[longest - 1] - (sides[longest - 1] @ along) * along
        return np.stack([along, -across / max(float(np.linalg.norm(across)), np.finfo(float).tiny)])


def slide_near(surface: Stars, targets: FloatArray, on_faces: IntArray, barycentric: FloatArray) -> None:
    """Move points along a surface to local minima of the distance to their targets.

    A point moves to a triangle with a common vertex as long as this is nearer to its target. So it never jumps to a
    different sheet of the surface nearby.

    Args:
        surface: the triangles.
        targets: (q, 3).
        on_faces, barycentric: (q,), (q, 3) the points, updated in place.
    """
    _slide(surface.vertices, surface.faces, surface.start, surface.star, targets, on_faces, barycentric)


@compiled
def _slide(
    vertices: FloatArray,
    faces: IntArray,
    start: IntArray,
    star: IntArray,
    targets: FloatArray,
    on_faces: IntArray,
    barycentric: FloatArray,
) -> None:
    weights = np.empty(3)
    for q in range(len(targets)):
        best, f = np.inf, on_faces[q]
        moved = True
        while moved:
            moved = False
            for i in range(3):
                v = faces[f, i]
                for k in range(start[v], start[v + 1]):
                    g = star[k]
                    square = nearest_in_triangle(
                        targets[q],
                        vertices[faces[g, 0]],
                        vertices[faces[g, 1]],
                        vertices[faces[g, 2]],
                        weights,
                    )
                    if square < best:
                        best, on_faces[q], moved = square, g, True
                        barycentric[q] = weights
            f = on_faces[q]
