"""Nearest points of a triangle mesh to points in space: on the whole mesh, or near a previous point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ...base import FloatArray, IntArray, compiled, dots

# Points whose nearest triangles are found at once, which bounds memory.
POINTS_AT_ONCE = 20_000


def surface_distances(vertices: FloatArray, faces: IntArray, queries: FloatArray) -> FloatArray:
    """Return (q,) the exact distances of points from a surface.

    A triangle can only be nearest if its centroid is not farther away than the nearest vertex plus its own radius.
    Triangles are searched in groups of similar radius, the smallest first.

    Args:
        vertices, faces: (n, 3), (m, 3) the surface.
        queries: (q, 3) points.
    """
    corners = np.ascontiguousarray(vertices[faces], dtype=np.float64)
    centres = corners.mean(axis=1)
    radii = np.sqrt(dots(corners - centres[:, None], corners - centres[:, None]).max(axis=1))
    group = np.frexp(radii)[1]
    best = cKDTree(corners.reshape(-1, 3)).query(queries)[0]
    for own in (np.flatnonzero(group == one) for one in np.unique(group)):
        tree, most = cKDTree(centres[own]), 1.0001 * radii[own].max()
        for block in (slice(k, k + POINTS_AT_ONCE) for k in range(0, len(queries), POINTS_AT_ONCE)):
            near = tree.query_ball_point(queries[block], best[block] + most)
            ends = np.cumsum([len(one) for one in near])
            candidates = own[np.concatenate([*near, []]).astype(np.int64)]
            _lower(corners, candidates, ends, queries[block], best[block])
    return best


@compiled
def _lower(
    corners: FloatArray, candidates: IntArray, ends: IntArray, queries: FloatArray, best: FloatArray
) -> None:
    """Lower the distances of points to those from their candidates, which end at `ends` for each point."""
    weights, k = np.empty(3), 0
    for q in range(len(queries)):
        while k < ends[q]:
            c = corners[candidates[k]]
            best[q] = min(best[q], np.sqrt(nearest_in_triangle(queries[q], c[0], c[1], c[2], weights)))
            k += 1


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
